"""The electromagnetic tracker (trakSTAR): poses of points at its own rate, late, noisy and rounded."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.errors import SceneError
from ldcs_ros.schema.fields import check_fields, quantity
from ldcs_ros.sensors.ticks import Ticks

Pose = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class TrackerParameters:
    """The parameters of a tracker.

    The orientation comes without noise: the maker gives a static accuracy of half a degree, most of it bias,
    and no figure for its noise.

    Attributes:
        points: Names of the points that carry a probe, probe 0 first.
        rate: Measurements per second [Hz].
        delay: From a measurement to its delivery [s].
        noise: Standard deviation of the position, each axis on its own [m].
        quantum: Step of the reported position [m]; 0 for none.
        seed: Seed of the noise.
    """

    points: tuple[str, ...]
    rate: float = quantity(80.0, "Hz", "measurements per second", low=1e-3, high=1e4)
    delay: float = quantity(0.0, "s", "time from a measurement to its delivery", low=0.0, high=10.0)
    noise: float = quantity(1.0e-4, "m", "standard deviation of the position, per axis", low=0.0, high=1.0)
    quantum: float = quantity(2.8e-5, "m", "step of the reported position; 0 for none", low=0.0, high=1.0)
    seed: int = quantity(1, "", "seed of the noise", low=0, high=2**63 - 1)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", tuple(self.points))
        named = all(isinstance(point, str) for point in self.points)
        if not self.points or not named or len(set(self.points)) != len(self.points):
            raise SceneError(
                f"got {list(self.points)}, expected different names of points @ sensors.tracker.points"
            )
        check_fields(self, "sensors.tracker", SceneError)


@dataclass(frozen=True)
class Measurement:
    """One pose of one probe, as reported.

    Attributes:
        probe: Number of the probe.
        point: Name of the point that carries it.
        time: Time of the measurement [s].
        delivered: Time of its delivery [s].
        position: Reported position in ldcs_base [m], shape (3,).
        orientation: Quaternion x, y, z, w from the point's frame to ldcs_base, shape (4,).
    """

    probe: int
    point: str
    time: float
    delivered: float
    position: np.ndarray
    orientation: np.ndarray


class Tracker:
    """Measures at its ticks and delivers `delay` later, in order.

    Args:
        parameters: Parameters of the scene.
        generator: Source of the noise; each tick draws three numbers a probe, so a run is repeatable.
        start: Time of the first possible tick [s].
    """

    def __init__(
        self, parameters: TrackerParameters, generator: np.random.Generator, start: float = 0.0
    ) -> None:
        self.parameters = parameters
        self._generator = generator
        self._ticks = Ticks.starting_at(parameters.rate, start)
        self._under_way: deque[Measurement] = deque()

    @property
    def next_tick(self) -> float:
        """Time of the next measurement [s]."""
        return self._ticks.time

    @property
    def next_delivery(self) -> float:
        """Time of the next delivery [s]; infinite while no measurement is under way."""
        return self._under_way[0].delivered if self._under_way else math.inf

    def measure(self, pose: Callable[[str], Pose]) -> None:
        """Measure all probes at the present tick; `pose(point)` gives position [m] and quaternion."""
        time = self._ticks.time
        for probe, point in enumerate(self.parameters.points):
            position, orientation = pose(point)
            reported = self._report(np.asarray(position, dtype=float))
            delivered = time + self.parameters.delay
            self._under_way.append(
                Measurement(probe, point, time, delivered, reported, np.asarray(orientation))
            )
        self._ticks.advance()

    def deliver(self, time: float) -> list[Measurement]:
        """Return the measurements that are due at `time` [s], oldest first."""
        due = []
        while self.next_delivery <= time:
            due.append(self._under_way.popleft())
        return due

    def _report(self, position: np.ndarray) -> np.ndarray:
        noisy = position + self._generator.normal(0.0, 1.0, 3) * self.parameters.noise
        quantum = self.parameters.quantum
        return np.round(noisy / quantum) * quantum if quantum > 0.0 else noisy
