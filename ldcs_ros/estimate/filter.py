"""SurfaceFilter: an extended Kalman filter on reduced coordinates, their rates and three slow parameters."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from ldcs_ros.errors import DivergenceError
from ldcs_ros.estimate.reduced import NOMINAL, PARAMETERS, ReducedModel
from ldcs_ros.scene import Scene
from ldcs_ros.simulation.threads import one_thread

MODES = 24
LONGEST_STEP = 0.0125
_SAME_MOMENT = 0.004
_SHAPE, _RATE = 2e-4, 1e-3  # m, m/s: deviations that no parameter explains at the start
_OUTLIER = 30.0
_MOST_OUTLIERS = 8
_PATIENCE = 0.05
_SCALES = (0.1, 1000.0)
_LOWEST = np.array([0.2, -1.0, 0.3])
_HIGHEST = np.array([3.0, 3.0, 3.0])


@dataclass(frozen=True)
class Noise:
    """The standard deviations that the filter assumes.

    Attributes:
        position: Standard deviation of a measured position, each axis [m].
        gain: Standard deviation of the arms' gain at the start.
        load: Standard deviation of the unknown load at the start [N].
        stiffness: Standard deviation of the springs' factor at the start.
        drift: Growth of each parameter's deviation per second, as a fraction of that at the start.
        motion: Standard deviation of unmodelled motion at zero velocity [m per root s].
        motion_gain: The same, added for each m/s of the points' speed.
        pressure_sigma: Standard deviation, at the start, of the pressure whose equilibrium the present shape is [Pa].
        pressure_rate_sigma: Standard deviation, at the start, of that pressure's rate [Pa/s].
    """

    position: float = 1.0e-4
    gain: float = 0.3
    load: float = 0.3
    stiffness: float = 0.2
    drift: float = 0.02
    motion: float = 4.0e-5
    motion_gain: float = 3.0e-3
    pressure_sigma: float = 2.0e4
    pressure_rate_sigma: float = 1.0e5


@dataclass(frozen=True)
class SurfaceEstimate:
    """The estimate of the filter at an instant.

    Attributes:
        time: Its time [s].
        position: Node positions in ldcs_base [m], shape (n_nodes, 3).
        velocity: Node velocities [m/s], shape (n_nodes, 3).
        parameters: gain, load [N], stiffness, by name.
        deviation: Standard deviations of the parameters, by name.
        points: Position [m] and its covariance [m^2] of each measured point.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    parameters: dict[str, float]
    deviation: dict[str, float]
    points: dict[str, tuple[np.ndarray, np.ndarray]]


class SurfaceFilter:
    """A filter that corrects the whole surface by measured positions of a few points.

    The state is x = (a, a', theta) at the time of the last measurement, which may be late; `at` predicts to the
    present. Prediction integrates the projected nonlinear forces; the covariance follows the linearised flow.
    Pressures are measured (or commanded) ones, linear between two times.

    Chosen by measurement on the scene `rig` against a truth with springs 20 % stiffer, a gain 30 % smaller and
    20 g more at the free edge, under slow waves of pressure, tracker at 80 Hz with 0.1 mm noise and 20 ms delay.
    RMS over all nodes after the first second, normalised innovation squared (NIS) a degree of freedom, CPU
    time a measurement on one core:

        open-loop twin                            9.0 mm
        filter on the state alone, 24 modes       6.5 mm    NIS 0.70   1.6 ms
        with parameters, 12 modes                 0.61 mm   NIS 1.08   1.2 ms
        with parameters, 16 modes                 0.18 mm   NIS 1.05   1.4 ms
        with parameters, 24 modes                 0.13 mm   NIS 1.02   1.6 ms
        with parameters, 32 modes                 0.08 mm   NIS 1.02   2.0 ms
        24 modes of more pressures (this)         0.04 mm   NIS 0.99   1.6 ms
        an ensemble of full twins                 not built: each takes 0.25 s per second under 100 commands per second

    The rows before had no equilibria with the pressure of one arm below that of the others. With three arms, this
    choice changes 0.7 to 0.13 mm. A missing mode acts like a lock on the stiff couplings of the arms. So 12 modes are
    worse than their fraction of the sheet's motion suggests. A measurement far outside of the predicted covariance is
    left out, unless several
    follow each other.

    Args:
        scene: The twin's scene; its arms are driven by pressure.
        points: Measured points.
        loaded: Point that carries the unknown load; the last measured one if None.
        noise: Assumed standard deviations.
        modes: Number of modes.
        basis: Mean shape and main directions of the sheet; None to compute them, which takes seconds.
        start: Time of the start [s], at rest without pressure.

    Attributes:
        time: Time of the state [s].
        innovations: Normalised innovation squared of the last corrections, and its degrees of freedom.
        outliers: Measurements that were left out.
        restarts: Restarts after many outliers in a row.
    """

    def __init__(
        self,
        scene: Scene,
        points: tuple[str, ...],
        *,
        loaded: str | None = None,
        noise: Noise | None = None,
        modes: int = MODES,
        basis: tuple[np.ndarray, np.ndarray] | None = None,
        start: float = 0.0,
    ) -> None:
        self.noise = noise or Noise()
        self._reduced = ReducedModel(scene, loaded or points[-1], modes=modes, basis=basis)
        self.points = points
        self._places = {point: self._reduced.place(point) for point in points}
        self._length = scene.lattice.size[0]
        self._pressures: deque[tuple[float, np.ndarray]] = deque(maxlen=2000)
        self._pressures.append((start, np.zeros(len(self._reduced.simulation.arm_names))))
        self._has_pressure = self._has_begun = False
        self.innovations: deque[tuple[float, int]] = deque(maxlen=800)
        self.outliers = self.restarts = 0
        self._outliers_in_a_row: Counter[tuple[str, ...]] = Counter()
        self._a: np.ndarray
        self._v: np.ndarray
        self._theta: np.ndarray
        self._covariance: np.ndarray
        self._scale: float
        self._begin(start)

    def pressure(self, time: float, gauge: np.ndarray) -> None:
        """Take measured gauge pressures [Pa], shape (n_arms,), of a time [s]."""
        if not self._has_pressure:
            self._has_pressure = True
            self._pressures.clear()
            self._pressures.append((time, np.asarray(gauge, dtype=float)))
        if time > self._pressures[-1][0]:
            self._pressures.append((time, np.asarray(gauge, dtype=float)))

    def correct(self, time: float, measured: Mapping[str, np.ndarray]) -> float | None:
        """Predict to the time of measurements [s] and correct the state by them.

        Args:
            time: Time of the measurements; those older than the state are ignored.
            measured: Position in ldcs_base [m] by point, shape (3,) each.

        Returns:
            The normalised innovation squared, or None if they were ignored.

        Raises:
            DivergenceError: The prediction left the finite numbers; call `restart`.
        """
        known = [point for point in measured if point in self._places]
        if time < self.time - _SAME_MOMENT or not known:
            return None
        if not self._has_begun:
            self._begin(time)
            self._has_begun = True
        with one_thread():
            self._predict(time)
            n, size = self._reduced.n, len(self._covariance)
            matrix = np.zeros((3 * len(known), size))
            innovation = np.empty(3 * len(known))
            for i, point in enumerate(known):
                offset, rows = self._places[point]
                matrix[3 * i : 3 * i + 3, :n] = rows
                innovation[3 * i : 3 * i + 3] = measured[point] - offset - rows @ self._a
            believed = matrix @ self._covariance @ matrix.T
            noise = self.noise.position**2 * np.eye(len(innovation))
            if self._is_outlier(tuple(known), _squared(innovation, believed + noise), time):
                return None
            # A straight line misses a bent sheet by the square of the distance over its length.
            noise += (float(innovation @ innovation) / self._length) ** 2 * np.eye(len(innovation))
            squared = len(innovation) * _squared(innovation, believed + noise)
            gain = np.linalg.solve(believed + noise, matrix @ self._covariance).T
            change = gain @ innovation
            self._a = self._a + change[:n]
            self._v = self._v + change[n : 2 * n]
            self._theta = np.clip(self._theta + change[2 * n :], _LOWEST, _HIGHEST)
            kept = np.eye(size) - gain @ matrix
            self._covariance = kept @ self._covariance @ kept.T + gain @ noise @ gain.T
        self.innovations.append((squared, len(innovation)))
        # Covariance matching: the innovations give the size of unmodelled motion (Mehra 1972).
        surprise = min(squared / len(innovation), 10.0) - 1.0
        self._scale = float(np.clip(self._scale * np.exp(_PATIENCE * surprise), *_SCALES))
        return squared

    def restart(self, time: float) -> None:
        """Reset all but the reduced model and the pressures; begin at a time [s], at zero velocity."""
        self.restarts += 1
        self.innovations.clear()
        self._begin(time)

    def at(self, time: float) -> SurfaceEstimate:
        """Return the estimate at a time [s], not before that of the state; the state is unchanged."""
        with one_thread():
            a, v = self._flow(self._a, self._v, self.time, max(time, self.time))
        n = self._reduced.n
        points = {}
        for point, (offset, rows) in self._places.items():
            points[point] = (offset + rows @ a, rows @ self._covariance[:n, :n] @ rows.T)
        deviation = np.sqrt(np.maximum(np.diag(self._covariance)[2 * n :], 0.0))
        return SurfaceEstimate(
            time,
            self._reduced.position(a),
            self._reduced.velocity(v),
            dict(zip(PARAMETERS, self._theta.tolist(), strict=True)),
            dict(zip(PARAMETERS, deviation.tolist(), strict=True)),
            points,
        )

    def _begin(self, time: float) -> None:
        """Begin at the equilibrium of the present pressures, the best guess without measurements."""
        self.time = time
        self._theta = NOMINAL.copy()
        self._scale = 1.0
        self._outliers_in_a_row.clear()
        pressure = self._pressure_at(time)
        with one_thread():
            self._a = self._reduced.equilibrium(pressure, self._theta)
            self._v = np.zeros(self._reduced.n)
            self._slopes = self._reduced.slopes(self._a, self._v, pressure, self._theta)
            self._covariance = self._first_covariance()

    def _is_outlier(self, points: tuple[str, ...], squared: float, time: float) -> bool:
        if squared < _OUTLIER:
            self._outliers_in_a_row[points] = 0
            return False
        self.outliers += 1
        self._outliers_in_a_row[points] += 1
        if self._outliers_in_a_row[points] > _MOST_OUTLIERS:
            # A row of outliers means that the estimate is wrong, not the measurements.
            self.restarts += 1
            self._begin(time)
        return True

    @property
    def consistency(self) -> float:
        """Mean normalised innovation squared a degree of freedom, over the last corrections; 1 is consistent."""
        freedom = sum(count for _, count in self.innovations)
        return sum(squared for squared, _ in self.innovations) / freedom if freedom else 1.0

    def _predict(self, time: float) -> None:
        duration = time - self.time
        if duration <= 0.0:
            return
        n = self._reduced.n
        pressure = self._pressure_at(0.5 * (self.time + time))
        self._slopes = self._reduced.slopes(self._a, self._v, pressure, self._theta)
        by_a, by_v, by_theta = self._slopes
        mass = self._reduced.mass(self._theta)
        flow = np.zeros((2 * n + 3, 2 * n + 3))
        flow[:n, n : 2 * n] = np.eye(n)
        flow[n : 2 * n] = np.linalg.solve(mass, np.hstack([by_a, by_v, by_theta]))
        transition = expm(duration * flow)
        a, v = self._flow(self._a, self._v, self.time, time)
        if not (np.isfinite(a).all() and np.isfinite(transition).all()):
            raise DivergenceError(
                f"the estimate left the finite numbers at t = {time:.3f} s; restart the filter"
            )
        self._a, self._v = a, v
        self._covariance = transition @ self._covariance @ transition.T + self._process_noise(duration)
        self._covariance = 0.5 * (self._covariance + self._covariance.T)
        self.time = time

    def _flow(self, a: np.ndarray, v: np.ndarray, start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        steps = int(np.ceil((end - start) / LONGEST_STEP - 1e-9))
        for k in range(steps):
            h = (end - start) / steps
            pressure = self._pressure_at(start + (k + 0.5) * h)
            a, v = self._reduced.step(a, v, pressure, self._theta, h, self._slopes)
        return a, v

    def _process_noise(self, duration: float) -> np.ndarray:
        n, noise = self._reduced.n, self.noise
        variance = np.zeros(2 * n + 3)
        speed = float(np.sqrt(np.mean(np.sum(self._reduced.velocity(self._v) ** 2, axis=1))))
        # Reduced coordinates are distances over all nodes: the root of their number times the mean one.
        nodes = self._reduced.model.lattice.n_nodes
        variance[:n] = self._scale * nodes * (noise.motion + noise.motion_gain * speed) ** 2 * duration / n
        start = np.array([noise.gain, noise.load, noise.stiffness])
        variance[2 * n :] = (noise.drift * start) ** 2 * duration
        return np.diag(variance)

    def _first_covariance(self) -> np.ndarray:
        """Return the covariance of the start: of the parameters, of the shape under them, and of its lag."""
        n, noise, nodes = self._reduced.n, self.noise, self._reduced.model.lattice.n_nodes
        by_a, _, by_theta = self._slopes
        shift = np.vstack([-np.linalg.solve(by_a, by_theta), np.zeros((n, 3)), np.eye(3)])
        start = np.array([noise.gain, noise.load, noise.stiffness])
        covariance = shift @ np.diag(start**2) @ shift.T
        by_pressure = np.linalg.solve(by_a, self._reduced.drive)
        lagging = by_pressure @ by_pressure.T
        covariance[:n, :n] += noise.pressure_sigma**2 * lagging + np.eye(n) * nodes * _SHAPE**2 / n
        rates = slice(n, 2 * n)
        covariance[rates, rates] += noise.pressure_rate_sigma**2 * lagging + np.eye(n) * nodes * _RATE**2 / n
        return np.array(covariance)

    def _pressure_at(self, time: float) -> np.ndarray:
        # Newest first: most times are recent.
        after: tuple[float, np.ndarray] | None = None
        for then, value in reversed(self._pressures):
            if then <= time:
                if after is None:
                    return np.array(value)
                fraction = (time - then) / (after[0] - then)
                return np.array((1.0 - fraction) * value + fraction * after[1])
            after = (then, value)
        return np.array(self._pressures[0][1])


def _squared(innovation: np.ndarray, spread: np.ndarray) -> float:
    """Return the normalised innovation squared, a degree of freedom."""
    return float(innovation @ np.linalg.solve(spread, innovation)) / len(innovation)
