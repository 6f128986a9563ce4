"""The rig's own bag: its readings under the twin's topic names, its set-points, and every raw packet."""

from __future__ import annotations

import os

import numpy as np

from ldcs_ros import bags as recording
from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import encode, message_class, nanoseconds
from ldcs_ros.rig.link import RawPacket
from ldcs_ros.rig.reading_validator import Reading
from ldcs_ros.rig.rig_report import reading_message

_BYTES = "std_msgs/msg/UInt8MultiArray"
_COMMAND = "std_msgs/msg/Float64MultiArray"


class RigBag:
    """A bag of a rig's data that replay, comparison and identification read like the twin's.

    Readings and set-points have the names of the twin's topics; raw packets under `raw/<link>/received`
    and `raw/<link>/sent`, messages of other ROS topics under their own names. Times are the twin's.

    Args:
        folder: Bag folder; one that exists is never overwritten.
        namespace: Namespace put before the names.
        arms: Names of the arms.
        custom_data: Texts stored with the bag.

    Raises:
        RecordingError: The folder exists or cannot be written.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        *,
        namespace: str,
        arms: tuple[str, ...],
        custom_data: dict[str, str],
    ) -> None:
        self._writer = recording.BagWriter(folder, topics={}, custom_data=custom_data)
        self._namespace = namespace.rstrip("/")
        self._arms = arms
        self._setpoints: dict[str, float] = {}
        self._last_command: tuple[float, ...] | None = None

    @property
    def error(self) -> str | None:
        """Reason why recording stopped, in one line; None for none."""
        return self._writer.error

    @property
    def count(self) -> int:
        """Messages recorded."""
        return self._writer.count

    def reading(self, reading: Reading, time: float, received: float) -> None:
        """Record a valid reading measured at a time and received at another [s of the twin]."""
        if reading.kind == "pressure_command":
            self._setpoint(reading, received)
            return
        made = reading_message(reading, time, self._arms)
        if made is not None:
            kind = (
                "geometry_msgs/msg/PoseStamped"
                if reading.kind == "position"
                else "sensor_msgs/msg/FluidPressure"
            )
            self._write(f"{self._namespace}/{made[0]}", kind, made[1], received)

    def packet(self, packet: RawPacket, time: float) -> None:
        """Record a raw packet that went over a link at a time [s of the twin]."""
        if packet.type:
            self._write(packet.link, packet.type, packet.data, time)
            return
        layout = message_class("std_msgs/msg/MultiArrayLayout")(dim=[], data_offset=0)
        data = np.frombuffer(packet.data, dtype=np.uint8)
        topic = f"{self._namespace}/raw/{packet.link}/{'sent' if packet.sent else 'received'}"
        self._write(topic, _BYTES, encode(message_class(_BYTES)(layout=layout, data=data)), time)

    def close(self) -> None:
        """End the bag."""
        self._writer.close()

    def _setpoint(self, reading: Reading, received: float) -> None:
        # A command is an event: repeated set-points would only make a replay slow.
        self._setpoints[reading.name] = float(reading.value)
        command = tuple(self._setpoints.get(arm, 0.0) for arm in self._arms)
        if reading.name == self._arms[-1] and command != self._last_command:
            self._last_command = command
            cdr = messages.pressure_command(np.array(command))
            self._write(f"{self._namespace}/pressure_command", _COMMAND, cdr, received)

    def _write(self, topic: str, message_type: str, cdr: bytes, time: float) -> None:
        self._writer.write(topic, message_type, cdr, nanoseconds(max(time, 0.0)))
