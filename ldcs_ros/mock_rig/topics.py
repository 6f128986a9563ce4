"""The mock rig on ROS topics: the messages of a rig controller and a tracker driver, as bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import decode, nanoseconds
from ldcs_ros.mock_rig.rig import MockRig
from ldcs_ros.rig.units import AMBIENT, PressureUnit

ARRAY = "std_msgs/msg/Float64MultiArray"
FLUID = "sensor_msgs/msg/FluidPressure"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
SETPOINT, COMMAND, TRACKER = "/rig/pressure_setpoint", "/rig/pressure_command", "/rig/trakstar_msg"
_MBAR = PressureUnit("mbar")


class Topics:
    """The rig on topics: publishes its reports and takes commands.

    Args:
        rig: The rig.
        publish: Sends a message: topic, type, CDR bytes.
        pressures: Publish pressures and take commands; else only the tracker, for a rig on another transport.
        namespace: Namespace of the topics, such as '/left_stand'; '' for none.

    Attributes:
        command: Topic of the commands.
        tracker: Topic of the tracker.
    """

    def __init__(
        self,
        rig: MockRig,
        publish: Callable[[str, str, bytes], None],
        *,
        pressures: bool = True,
        namespace: str = "",
    ) -> None:
        self._rig, self._publish, self._pressures = rig, publish, pressures
        self._namespace = namespace
        self.command, self.tracker = namespace + COMMAND, namespace + TRACKER
        self._setpoint = namespace + SETPOINT
        self._last = 0

    def start(self) -> None:
        """Nothing to open."""

    def stop(self) -> None:
        """Nothing to close."""

    def outgoing(self) -> dict[str, str]:
        """Return the topics that it publishes, with their types."""
        topics = {self.tracker: TRANSFORM}
        if self._pressures:
            topics |= {self._setpoint: ARRAY}
            topics |= {self._pressure(arm): FLUID for arm in self._rig.simulation.arm_names}
        return topics

    def describe(self) -> dict[str, Any]:
        """Return the link of a rig file that connects to it."""
        probes = {f"trakstar{i}": point for i, point in enumerate(self._rig.probes)}
        receive: list[dict[str, Any]] = [
            {
                "topic": self.tracker,
                "type": TRANSFORM,
                "gives": "position",
                "names": probes,
                "age": self._rig.tracker_delay,
            }
        ]
        link: dict[str, Any] = {"type": "topics", "receive": receive}
        if self._pressures:
            arms = list(self._rig.simulation.arm_names)
            common = {"gives": "pressure", "unit": "Pa", "reference": "absolute"}
            receive += [
                {"topic": self._pressure(arm), "type": FLUID, "names": [arm], **common} for arm in arms
            ]
            setpoint = {"topic": self._setpoint, "type": ARRAY, "gives": "pressure_command"}
            receive.append({**setpoint, "names": arms, "unit": "mbar"})
            link["send"] = {"topic": self.command, "unit": "mbar"}
        return link

    def receive(self, cdr: bytes) -> None:
        """Take a command's bytes [mbar]; invalid bytes change nothing."""
        try:
            values = [_MBAR.to_pascal(float(value)) for value in decode(ARRAY, cdr).data]
        except Exception:  # foreign bytes: the decoder fails in as many ways as there are bytes
            return
        self._rig.command(values)

    def work(self) -> None:
        """Publish what is due; called about as often as the rig reports."""
        for stamp, measured in self._rig.tracked():
            moment = nanoseconds(stamp)
            self._publish(self.tracker, TRANSFORM, messages.trakstar(moment, measured))
        if not self._pressures:
            return
        for status in self._rig.statuses(self._last):
            self._last = max(self._last, status.number)
            setpoint = np.array([_MBAR.from_pascal(value) for value in status.setpoint])
            self._publish(self._setpoint, ARRAY, messages.pressure_command(setpoint))
            for arm, value in zip(self._rig.simulation.arm_names, status.pressure, strict=True):
                message = messages.fluid_pressure(nanoseconds(status.stamp), "rig", value + AMBIENT, 0.0)
                self._publish(self._pressure(arm), FLUID, message)

    def _pressure(self, arm: str) -> str:
        return f"{self._namespace}/rig/{arm}/pressure"
