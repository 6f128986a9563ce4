"""Mirror: in mode mirror, measurements pull an estimate of the whole surface to the rig."""

from __future__ import annotations

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.estimate.filter import SurfaceEstimate, SurfaceFilter
from ldcs_ros.messages.cdr import encode, header, message_class, nanoseconds
from ldcs_ros.messages.diagnostics import ERROR, OK, WARN, Status
from ldcs_ros.messages.lattice import NodeCloud
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.rig.intake import Sample
from ldcs_ros.twin.twin import Twin

_DISHONEST = (0.5, 2.0)
_STALE = 1.0
_PATIENCE = 1.0  # s: so long it waits for the first pressure before it believes that none will come


class Mirror:
    """Feeds a SurfaceFilter with what a rig measures and emits what it believes.

    Args:
        twin: The twin, through which the estimate is emitted; its publish rate holds here, too.

    Attributes:
        filter: The filter.
        restarts: How often it had to begin anew.
    """

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self._points = tuple(twin.simulation.points)
        self._period = 1.0 / twin.settings.publish_rate
        self._cloud = NodeCloud(twin.simulation.lattice.nodes)
        self._pressure: dict[str, float] = {}
        self._next_report = 0.0
        self._corrected_at = 0.0
        self.restarts = 0
        self.filter = self._new(0.0)

    def take(self, sample: Sample, time: float) -> None:
        """Take a sound sample that was measured at a time of the twin [s]."""
        arms = self._twin.simulation.arm_names
        if sample.kind == "pressure":
            self._pressure[sample.name] = max(float(sample.value), 0.0)
            if sample.name == arms[-1]:
                self.filter.pressure(time, np.array([self._pressure.get(arm, 0.0) for arm in arms]))
        elif sample.kind == "position" and sample.name in self._points:
            if not self._pressure and time < _PATIENCE:
                return
            try:
                if self.filter.correct(time, {sample.name: sample.value}) is not None:
                    self._corrected_at = time
            except DivergenceError:
                self.restarts += 1
                self.filter = self._new(time)

    def report(self, time: float) -> None:
        """Emit the estimate for a time of the twin [s], at the twin's publish rate."""
        if time < self._next_report or time - self._corrected_at > _STALE:
            return
        self._next_report = max(self._next_report + self._period, time - self._period)
        if not self._pressure:
            self.filter.pressure(time, self._twin.simulation.state.pressure)
        estimate, now = self.filter.at(time), nanoseconds(time)
        self._twin.emit(
            self._twin.topics["estimate/nodes"],
            self._cloud.build(now, estimate.position, estimate.velocity),
            now,
        )
        for point in self._points:
            self._twin.emit(self._twin.topics[f"estimate/{point}/pose"], _pose(now, point, estimate), now)

    def status(self) -> Status:
        """Return what the filter says of itself."""
        surface = self.filter
        silent = self._twin.time - self._corrected_at
        estimate = surface.at(surface.time)
        values: dict[str, object] = {
            "normalised innovation squared": surface.consistency,
            "outliers": surface.outliers,
            "restarts": self.restarts + surface.restarts,
        }
        for name, value in estimate.parameters.items():
            values[name] = f"{value:.3f} +- {estimate.deviation[name]:.3f}"
        if silent > _STALE:
            return Status(
                "estimate", ERROR, f"no position measured for {silent:.1f} s: nothing to correct by", values
            )
        low, high = _DISHONEST
        words = ", ".join(f"{name} {values[name]}" for name in estimate.parameters)
        if not low <= surface.consistency <= high:
            return Status("estimate", WARN, f"its covariance does not fit what is measured; {words}", values)
        return Status("estimate", OK, words, values)

    def _new(self, start: float) -> SurfaceFilter:
        return SurfaceFilter(self._twin.scene, self._points, start=start)


def _pose(now: int, point: str, estimate: SurfaceEstimate) -> bytes:
    place, covariance = estimate.points[point]
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = covariance
    x, y, z = place.tolist()
    pose = message_class("geometry_msgs/msg/Pose")(
        position=message_class("geometry_msgs/msg/Point")(x=x, y=y, z=z),
        orientation=message_class("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0),
    )
    with_covariance = message_class("geometry_msgs/msg/PoseWithCovariance")
    stamped = message_class("geometry_msgs/msg/PoseWithCovarianceStamped")
    return encode(
        stamped(header=header(now, BASE_FRAME), pose=with_covariance(pose=pose, covariance=matrix.ravel()))
    )
