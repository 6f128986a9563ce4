"""Messages of the bridge about a rig: its readings in the twin's terms, and the residuals."""

from __future__ import annotations

import numpy as np

from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import encode, header, message_class, nanoseconds
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.rig.reading_validator import Reading
from ldcs_ros.rig.units import AMBIENT
from ldcs_ros.twin.twin import Twin

_UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class RigReport:
    """Emits through a twin, so that publishers and recorders get one stream.

    Args:
        twin: The twin; its topics hold those of the bridge.
    """

    def __init__(self, twin: Twin) -> None:
        self._twin = twin

    def reading(self, reading: Reading, time: float) -> None:
        """Report a valid reading that was measured at a time of the twin [s]."""
        made = reading_message(reading, time, self._twin.simulation.arm_names)
        if made is not None:
            self._emit(f"rig/{made[0]}", made[1])

    def residual(self, point: str, time: float, residual: np.ndarray) -> None:
        """Report measured minus predicted position [m], shape (3,)."""
        x, y, z = residual.tolist()
        vector = message_class("geometry_msgs/msg/Vector3")(x=x, y=y, z=z)
        stamped = message_class("geometry_msgs/msg/Vector3Stamped")
        self._emit(f"residual/{point}", encode(stamped(header=_head(time), vector=vector)))

    def _emit(self, name: str, cdr: bytes) -> None:
        topic = self._twin.topics.get(name)
        if topic is not None:
            self._twin.emit(topic, cdr, nanoseconds(self._twin.time))


def reading_message(reading: Reading, time: float, arms: tuple[str, ...]) -> tuple[str, bytes] | None:
    """Return the twin's topic for a reading and its message; None for a set-point, which goes in pairs."""
    if reading.kind == "position":
        return f"{reading.name}/pose", messages.pose(nanoseconds(max(time, 0.0)), reading.value, _UPRIGHT)
    if reading.kind == "pressure" and reading.name in arms:
        stamp = nanoseconds(max(time, 0.0))
        cdr = messages.fluid_pressure(stamp, BASE_FRAME, float(reading.value) + AMBIENT, 0.0)
        return f"{reading.name}/pressure", cdr
    return None


def _head(time: float) -> object:
    return header(nanoseconds(max(time, 0.0)), BASE_FRAME)
