"""The sensors of a twin: built from its scene, measuring at their own ticks, reported through its messages."""

from __future__ import annotations

import math

import numpy as np

from ldcs_ros.physics.points import point_at
from ldcs_ros.physics.state import State
from ldcs_ros.scene.scene import Scene
from ldcs_ros.sensors import PressureSensor, PressureSensorParameters, Tracker, TrackerParameters
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.twin.reports import Reports
from ldcs_ros.twin.settings import RunSettings


def tracker_parameters(scene: Scene, settings: RunSettings) -> TrackerParameters | None:
    """Return the parameters of the tracker; None for a scene without one."""
    if "tracker" not in scene.sensors:
        return None
    rate = {} if settings.tracker_rate is None else {"rate": settings.tracker_rate}
    return TrackerParameters(**(dict(scene.sensors["tracker"]) | rate))


def pressure_parameters(scene: Scene, simulation: Simulation) -> PressureSensorParameters | None:
    """Return the parameters of the pressure sensors; None without them, or without chambers to measure."""
    if "pressure" not in scene.sensors or simulation.inputs.pressure is None:
        return None
    return PressureSensorParameters(**scene.sensors["pressure"])


class SensorSuite:
    """The sensors of one simulation, an event source.

    Args:
        simulation: The simulation that they measure.
        reports: Builder of their messages.
        tracker: Parameters of the tracker; None for none.
        pressure: Parameters of the pressure sensors; None for none.
        seed: Seed of their noise; None for each one's own.
    """

    def __init__(
        self,
        simulation: Simulation,
        reports: Reports,
        *,
        tracker: TrackerParameters | None,
        pressure: PressureSensorParameters | None,
        seed: int | None,
    ) -> None:
        self._reports = reports
        self._seed = seed
        self._tracker_parameters = tracker
        self._pressure_parameters = pressure
        tracked = () if tracker is None else tracker.points
        self._points = {name: point_at(simulation.lattice, name, simulation.points) for name in tracked}
        self.start(simulation.time)

    def start(self, time: float) -> None:
        """Restart at a time [s], noise included."""
        self._tracker: Tracker | None = None
        self._gauges: PressureSensor | None = None
        # One stream per sensor: adding a sensor does not change the noise of the others.
        if (tracker := self._tracker_parameters) is not None:
            self._tracker = Tracker(tracker, self._generator(0, tracker.seed), time)
        if (pressure := self._pressure_parameters) is not None:
            self._gauges = PressureSensor(pressure, self._generator(1, pressure.seed), time)

    @property
    def next_time(self) -> float:
        """Time of the next measurement or delivery [s], infinity for none."""
        delivery = math.inf if self._tracker is None else self._tracker.next_delivery
        return min(self._next_measurement, delivery)

    def needs_state(self, time: float) -> bool:
        """Return whether a sensor measures at a time [s]; a delivery alone needs no state."""
        return self._next_measurement <= time

    def report(self, time: float, state: State) -> None:
        """Measure what is due at a time [s], and report what is delivered."""
        if self._tracker is not None:
            if self._tracker.next_tick <= time:
                self._tracker.measure(lambda name: self._points[name].pose(state.position))
            self._reports.report_tracker(self._tracker.deliver(time))
        if self._gauges is not None and self._gauges.next_tick <= time:
            self._reports.report_pressure(time, self._gauges.measure(state.pressure))

    @property
    def _next_measurement(self) -> float:
        sensors = (one for one in (self._tracker, self._gauges) if one is not None)
        return min((one.next_tick for one in sensors), default=math.inf)

    def _generator(self, sensor: int, seed: int) -> np.random.Generator:
        return np.random.default_rng([sensor, seed if self._seed is None else self._seed])
