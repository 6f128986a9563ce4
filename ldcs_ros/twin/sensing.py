"""The sensors of a twin: built from its scene, measuring at their own ticks, reported through its outputs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ldcs_ros.sensors import PressureSensor, PressureSensorParameters, Tracker, TrackerParameters
from ldcs_ros.twin.outputs import Outputs


class Sensing:
    """The sensors of one simulation.

    Args:
        sensors: The scene's sensors: parameters by name.
        simulation: What they measure.
        seed: Seed of their noise; None for each one's own.
        tracker_rate: Rate of the tracker [Hz]; None for its own.

    Attributes:
        tracker: Parameters of the tracker; None without one.
        pressure: Parameters of the pressure sensors; None without them.
    """

    def __init__(
        self, sensors: Any, simulation: Any, *, seed: int | None, tracker_rate: float | None
    ) -> None:
        self._simulation = simulation
        self._seed = seed
        self.tracker: TrackerParameters | None = None
        self.pressure: PressureSensorParameters | None = None
        if "tracker" in sensors:
            rate = {} if tracker_rate is None else {"rate": tracker_rate}
            self.tracker = TrackerParameters(**(dict(sensors["tracker"]) | rate))
        # Arms that are not driven by pressure have no chambers to measure.
        if "pressure" in sensors and simulation.inputs.pressure is not None:
            self.pressure = PressureSensorParameters(**sensors["pressure"])
        self.start(simulation.time)

    def start(self, time: float) -> None:
        """Begin anew at a time [s], noise included."""
        self._tracker: Tracker | None = None
        self._gauges: PressureSensor | None = None
        if self.tracker is not None:
            self._tracker = Tracker(self.tracker, self._generator(0, self.tracker.seed), time)
        if self.pressure is not None:
            self._gauges = PressureSensor(self.pressure, self._generator(1, self.pressure.seed), time)

    @property
    def next_tick(self) -> float:
        """When one measures next [s], infinity for never."""
        return min(
            (one.next_tick for one in (self._tracker, self._gauges) if one is not None), default=math.inf
        )

    @property
    def next_delivery(self) -> float:
        """When a measurement that was made is delivered next [s], infinity for none."""
        return math.inf if self._tracker is None else self._tracker.next_delivery

    def report(self, time: float, outputs: Outputs) -> None:
        """Measure what is due at a time [s], to which the simulation has come, and report what is delivered."""
        if self._tracker is not None:
            if self._tracker.next_tick <= time:
                self._tracker.measure(self._simulation.pose)
            outputs.report_tracker(self._tracker.deliver(time))
        if self._gauges is not None and self._gauges.next_tick <= time:
            outputs.report_pressure(self._gauges.measure(self._simulation.state.pressure))

    def _generator(self, sensor: int, seed: int) -> np.random.Generator:
        # One stream a sensor: adding a sensor does not change what the others report.
        return np.random.default_rng([sensor, seed if self._seed is None else self._seed])
