"""The state estimator of mode mirror: measurements correct an estimate of the whole surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.estimate.basis_process import BasisProcess
from ldcs_ros.estimate.filter import MODES, SurfaceEstimate, SurfaceFilter
from ldcs_ros.messages.cdr import encode, header, message_class, nanoseconds
from ldcs_ros.messages.diagnostics import ERROR, OK, WARN, Status
from ldcs_ros.messages.lattice import NodeCloud
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.rig.reading_validator import Reading
from ldcs_ros.twin.twin import Twin

_CONSISTENT = (0.5, 2.0)
_STALE = 1.0
_PATIENCE = 1.0  # s: time without any pressure after which none is expected
_MOST_POSITIONS = 16  # in one pass: 30 ms of work on a free core


class StateEstimator:
    """A SurfaceFilter that is corrected by the readings of a rig and emits its estimate.

    A process of its own finds the reduced basis, so the loop goes on meanwhile; restarts of the filter keep it.

    Args:
        twin: The twin, through which the estimate is emitted; its publish rate holds here, too.

    Attributes:
        filter: The filter; None until the basis is known.
        failure: Reason why there is no filter; '' otherwise.
        skipped: Measured positions that came faster than the machine could take them.
    """

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self._points = tuple(twin.simulation.points)
        self._period = 1.0 / twin.settings.publish_rate
        self._cloud = NodeCloud(twin.simulation.lattice.nodes)
        self._pressure: dict[str, float] = {}
        self._next_report = 0.0
        self._corrected_at = 0.0
        self.skipped = 0
        self.filter: SurfaceFilter | None = None
        self.failure = ""
        self._basis: BasisProcess | None = BasisProcess(twin.scene, self._points[-1], MODES)

    def close(self) -> None:
        """End the search for the basis."""
        if self._basis is not None:
            self._basis.close()
            self._basis = None

    def take(self, readings: Sequence[tuple[Reading, float]]) -> None:
        """Take valid readings, each with the time of the twin at which it was measured [s].

        A late pass has a backlog: the newest positions of it count, so that no pass takes long.
        """
        if self.filter is None:
            self._start_filter()
        positions = [pair for pair in readings if pair[0].kind == "position" and pair[0].name in self._points]
        dropped = {id(reading) for reading, _ in positions[:-_MOST_POSITIONS]}
        if self.filter is not None:
            self.skipped += len(dropped)
        for reading, time in readings:
            if reading.kind == "pressure":
                self._take_pressure(reading, time)
            elif reading.kind == "position" and reading.name in self._points and id(reading) not in dropped:
                self._take_position(reading, time)

    def _take_pressure(self, reading: Reading, time: float) -> None:
        arms = self._twin.simulation.arm_names
        self._pressure[reading.name] = max(float(reading.value), 0.0)
        if self.filter is not None and reading.name == arms[-1]:
            self.filter.pressure(time, np.array([self._pressure.get(arm, 0.0) for arm in arms]))

    def _take_position(self, reading: Reading, time: float) -> None:
        if self.filter is None or (not self._pressure and time < _PATIENCE):
            return
        try:
            if self.filter.correct(time, {reading.name: reading.value}) is not None:
                self._corrected_at = time
        except DivergenceError:
            self.filter.restart(time)

    def _start_filter(self) -> None:
        """Start the filter once the basis is known."""
        if self._basis is None:
            return
        try:
            basis = self._basis.result()
            if basis is None:
                return
            self.filter = SurfaceFilter(self._twin.scene, self._points, basis=basis, start=self._twin.time)
        except DivergenceError as error:
            self.failure = str(error)
        self.close()

    def report(self, time: float) -> None:
        """Emit the estimate for a time of the twin [s], at the twin's publish rate."""
        if self.filter is None or time < self._next_report or time - self._corrected_at > _STALE:
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
        """Return the health of the filter."""
        if self.filter is None:
            if self.failure:
                return Status("estimate", ERROR, self.failure, {})
            return Status("estimate", WARN, "the shapes of the sheet are being computed", {})
        surface = self.filter
        silent = self._twin.time - self._corrected_at
        estimate = surface.at(surface.time)
        values: dict[str, object] = {
            "normalised innovation squared": surface.consistency,
            "outliers": surface.outliers,
            "restarts": surface.restarts,
            "skipped positions": self.skipped,
        }
        for name, value in estimate.parameters.items():
            values[name] = f"{value:.3f} +- {estimate.deviation[name]:.3f}"
        if silent > _STALE:
            return Status(
                "estimate", ERROR, f"no position measured for {silent:.1f} s: nothing to correct by", values
            )
        low, high = _CONSISTENT
        words = ", ".join(f"{name} {values[name]}" for name in estimate.parameters)
        if not low <= surface.consistency <= high:
            return Status("estimate", WARN, f"its covariance does not fit what is measured; {words}", values)
        return Status("estimate", OK, words, values)


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
