"""A rig on ROS topics as a device: a function publishes, messages are handed in; no rclpy here."""

from __future__ import annotations

from collections.abc import Callable

from ldcs_ros.rig.limits import Pressures
from ldcs_ros.rig.output.device import Device
from ldcs_ros.rig.units import PressureUnit


class TopicDevice(Device):
    """A rig that takes set-points from a topic.

    A topic confirms nothing by itself: the rig's own topic of set-points, or else its measured pressures, do.

    Args:
        publish: Publishes set-points in the rig's unit, one for each arm.
        unit: The rig's unit.
        clock: Steady clock [s].
        rate: Messages per second [Hz].
        reads_back: Whether the rig reports the set-points it works to.
    """

    acknowledges = False

    def __init__(
        self,
        publish: Callable[[list[float]], None],
        unit: PressureUnit,
        clock: Callable[[], float],
        *,
        rate: float,
        reads_back: bool,
    ) -> None:
        super().__init__("topic output", clock, rate, 1e-3 * unit.step)
        self.reads_back = reads_back
        self._publish, self._unit = publish, unit

    def open(self) -> None:
        """DDS connects by itself."""

    def close(self) -> None:
        """DDS disconnects by itself."""

    def exchange(self, setpoint: Pressures | None) -> None:
        if setpoint is not None:
            self.heartbeats += 1
            self._publish([self._unit.from_pascal(value) for value in setpoint])
