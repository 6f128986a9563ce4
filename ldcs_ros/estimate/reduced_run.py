"""A fast reduced model of a scene whose arms are driven by pressure, with an estimate of its error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import splu
from scipy.spatial.distance import cdist

from ldcs_ros.errors import DivergenceError, SceneError
from ldcs_ros.estimate.manifold import QuadraticManifold, fit_manifold
from ldcs_ros.estimate.training import PERIOD, FullRun, full_run, random_commands
from ldcs_ros.physics.kernels.coverage import is_covered
from ldcs_ros.physics.kernels.manifold_step import LEAD, fill_projection, manifold_step
from ldcs_ros.physics.kernels.total_force import TotalForce
from ldcs_ros.scene import Scene
from ldcs_ros.simulation.inputs import Inputs
from ldcs_ros.simulation.linear_model import mass_matrix, stiffness_and_damping
from ldcs_ros.simulation.threads import one_thread

TOLERANCE = 2e-5  # of an iteration, displacement of all nodes together [m]
MOST_ITERATIONS = 20
LEADING = 10  # coordinates that the quadratic part of the projection depends on
PLACES = 2000  # shapes at which it is computed
COMPONENTS = 48  # stiff coordinates have small entries and large forces: 24 leave errors of a millimetre
SMOOTHING = 1e-4
RANK = 1e-12  # of the largest eigenvalue of the components: below it is rounding
FORGETTING = 0.1  # s: time constant of the error that the steps leave
AIM = 3.2  # the estimate over the expected largest error
UNCONVERGED = 0.004  # m: added to the indicator where an iteration needs a new projection
MARGIN = 0.1  # beyond the samples, as a fraction of their range


class ReducedRun:
    """A reduced model that follows pressure commands at 50 Hz.

    The coordinates z of a quadratic manifold follow M a = f(q, u) of the full model by BDF3 with a step a period.
    All forces are those of the full model, in one compiled call. The residual vanishes in the projection V S^-1, with
    S the Jacobian of the step and V the encoder: the result is the shape of the manifold nearest to the full model's.
    A projection on the manifold's own tangents weighs stiff directions more and is millimetres off.
    V S^-1 depends on the shape, by kinks where supports let go. Its main components are a quadratic function of the
    leading z plus what samples differ from it, interpolated by their distances.

    Args:
        scene: A scene whose arms are driven by pressure, with axial springs.
        samples: Runs of the full model that span its shapes.
        calibration: Runs that set the estimate of the error.
        slew: Largest change of a pressure that it is for [Pa/s].
        modes: Coordinates of the manifold.

    Attributes:
        manifold: The manifold.
        slew: Largest change of a pressure that it was made for [Pa/s].
        time: Time of the state [s].
        outside: Why the state is outside of the range of the model, in words; '' inside.
        indicator: Largest sum, fading, of what the prediction of the steps left [m].
        refactored: Iterations that needed a new projection.

    Raises:
        SceneError: The scene has no arms that are driven by pressure, or effects that the compiled force does not know.
    """

    def __init__(
        self,
        scene: Scene,
        samples: Sequence[FullRun],
        calibration: Sequence[FullRun],
        *,
        slew: float,
        modes: int = 14,
    ) -> None:
        self._simulation = scene.edited({"inputs": None}).build()
        model = self._model = self._simulation.model
        if model.arms is None or model.arms.arms.drive != "pressure" or not is_covered(model):
            raise SceneError(
                f"{scene.name}: expected arms that are driven by pressure, axial springs and numba for a reduced model"
            )
        self.slew = slew
        self._limit = np.array([own.pressure_limit for own in model.arms.each])
        self._force = TotalForce(model)
        self._weights = np.zeros(model.n_coordinates)
        self._weights[model.free[: model.n_free_nodes]] = model.mass
        states = np.concatenate([run.coordinates for run in samples])
        self.manifold: QuadraticManifold = fit_manifold(states[::4], modes)
        self._level, self._slope = 0.0, 0.0
        with one_thread():
            self._at = self._simulation.operating_point()
            self._mass = mass_matrix(model, self.manifold.centre)
            self._fit_projection(self.manifold.encode(states[::4]))
            self.reset(calibration[0].commands[0], calibration[0].coordinates[0])
            self._calibrate(calibration)

    def reset(self, pressure: np.ndarray, coordinates: np.ndarray) -> None:
        """Begin at a rest state.

        Args:
            pressure: Gauge pressures [Pa], shape (n_arms,).
            coordinates: Coordinates of the full model at rest under them [m, rad].
        """
        z = self.manifold.encode(coordinates)
        q = self.manifold.decode(z)
        self.time, self.outside, self.refactored, self._kept = 0.0, "", 0, 0
        self._zs, self._qs = np.array([z] * 3), np.array([q] * 3)
        self._us = np.zeros_like(self._qs)
        self._last = np.array(pressure, dtype=float)
        self._inputs = Inputs(self._model, lambda: self.time)
        self._inputs.set_pressure(pressure)
        self._inputs.settle()
        self._left = self.indicator = 0.0

    @property
    def position(self) -> np.ndarray:
        """Node positions in ldcs_base [m], shape (n_nodes, 3)."""
        return self._qs[0, : 3 * self._model.lattice.n_nodes].reshape(-1, 3)

    @property
    def coordinates(self) -> np.ndarray:
        """Coordinates of the whole model [m, rad], shape (n_q,)."""
        return self._qs[0]

    @property
    def error_estimate(self) -> float:
        """Estimate of the largest error of a node since the start [m]."""
        return AIM * (self._level + self._slope * self.indicator)

    def advance(self, pressure: np.ndarray) -> None:
        """Command gauge pressures [Pa], shape (n_arms,), and advance by a period.

        Raises:
            DivergenceError: A step does not converge; the state is that before it.
        """
        self._check(pressure)
        self._inputs.set_pressure(pressure)
        if self._kept == 0:
            self._projection = self._projection_at(self._zs[0])
        self.time += PERIOD
        while self._inputs.next_valve_change() <= self.time:
            self._inputs.apply_valve_change()
        self._step(self._force.drive(self.time, self._inputs.held()))
        self._kept = max(self._kept - 1, 0)
        if ((self._zs[0] < self._low) | (self._zs[0] > self._high)).any():
            self.outside = self.outside or f"a shape at t = {self.time:.2f} s is unlike those of the samples"

    def _check(self, pressure: np.ndarray) -> None:
        change = float(np.abs(pressure - self._last).max())
        if change > self.slew * PERIOD * (1.0 + 1e-9):
            self.outside = self.outside or (
                f"a pressure changes by {change / PERIOD:.4g} Pa/s at t = {self.time:.2f} s, expected at most "
                f"{self.slew:.4g} Pa/s"
            )
        self._last[:] = pressure

    def _step(self, drive: np.ndarray) -> None:
        force, manifold = self._force, self.manifold
        for _ in range(3):
            iterations, unforeseen = manifold_step(
                force.tables,
                drive,
                force.constant,
                force.scratch,
                self._weights,
                manifold.mean,
                manifold.decoder,
                self._projection,
                manifold.scale,
                self._zs,
                self._qs,
                self._us,
                PERIOD,
                TOLERANCE,
                MOST_ITERATIONS,
            )
            if iterations > 0:
                break
            self.refactored += 1
            self._left += UNCONVERGED
            self._projection, self._kept = self._exact_projection(self._zs[0]), 1
        else:
            raise DivergenceError(f"a step of the reduced model at t = {self.time:.3f} s does not converge")
        self._left += unforeseen - self._left * PERIOD / FORGETTING
        self.indicator = max(self.indicator, self._left)

    def _features(self, z: np.ndarray) -> np.ndarray:
        leading = z[:LEADING]
        return np.concatenate([[1.0], leading, leading[self._first] * leading[self._second]])

    def _projection_at(self, z: np.ndarray) -> np.ndarray:
        flat = np.empty(self._components.shape[1], dtype=np.float32)
        fill_projection(
            z,
            min(LEADING, self.manifold.n),
            self._fractions,
            self._metric,
            self._places,
            self._differences,
            self._components,
            flat,
        )
        return flat.astype(float).reshape(self.manifold.n, -1)

    def _exact_projection(self, z: np.ndarray) -> np.ndarray:
        model, at, free = self._model, self._at, self._model.free
        q = self.manifold.decode(z)
        by_q, by_u = stiffness_and_damping(model, 0.0, q, np.zeros_like(q), at.held)
        matrix = ((LEAD / PERIOD) ** 2 * self._mass - LEAD / PERIOD * by_u - by_q).tocsc()
        solved = splu(matrix).solve(np.ascontiguousarray(self.manifold.encoder[:, free].T), trans="T").T
        tangent = self.manifold.tangent(z)[:, free]
        projection = np.zeros((self.manifold.n, model.n_coordinates))
        projection[:, free] = np.linalg.solve(solved @ (matrix @ tangent.T), solved)
        return projection

    def _fit_projection(self, z: np.ndarray) -> None:
        manifold = self.manifold
        reach = manifold.high - manifold.low
        self._low, self._high = manifold.low - MARGIN * reach, manifold.high + MARGIN * reach
        self._first, self._second = np.triu_indices(min(LEADING, manifold.n))
        # Half of the shapes far from each other, half of them as often as they occur.
        leading = (z * manifold.scale)[:, :LEADING]
        chosen, apart = [0], ((leading - leading[0]) ** 2).sum(axis=1)
        while len(chosen) < PLACES // 2:
            chosen.append(int(apart.argmax()))
            apart = np.minimum(apart, ((leading - leading[chosen[-1]]) ** 2).sum(axis=1))
        chosen += np.linspace(0, len(z) - 1, PLACES - len(chosen)).astype(int).tolist()
        chosen = sorted(set(chosen))
        exact = np.array([self._exact_projection(z[k]).ravel() for k in chosen])
        mean = exact.mean(axis=0)
        exact -= mean
        # The components are eigenvectors of the smaller of both Gram matrices.
        values, vectors = np.linalg.eigh(exact @ exact.T)
        kept = np.flatnonzero(values > RANK * values[-1])[-COMPONENTS:]
        components = (vectors[:, kept] / np.sqrt(values[kept])).T @ exact
        wanted = exact @ components.T
        features = np.array([self._features(z[k]) for k in chosen])
        gram = features.T @ features + 1e-6 * len(features) * np.eye(features.shape[1])
        self._fractions = np.linalg.solve(gram, features.T @ wanted)
        self._metric = np.sqrt(manifold.scale / manifold.scale[0])
        self._places = z[chosen] * self._metric
        far = cdist(self._places, self._places)
        self._differences = np.linalg.solve(
            far - SMOOTHING * np.eye(len(far)), features @ self._fractions - wanted
        )
        self._components = np.vstack([components, mean]).astype(np.float32)

    def _calibrate(self, runs: Sequence[FullRun]) -> None:
        """Set the estimate to the largest errors of runs as a line of the indicator, neither part negative."""
        from scipy.optimize import nnls

        rows, errors = [], []
        for run in runs:
            found = self.follow(run)
            # Relative: a run with small errors counts as much as one with large ones.
            errors.append(float(found.max()))
            rows.append([1.0, self.indicator])
        scaled = np.array(rows) / np.array(errors)[:, None]
        (self._level, self._slope), _ = nnls(scaled, np.ones(len(errors)))

    def follow(self, run: FullRun) -> np.ndarray:
        """Return the largest node error at each time of a run of the full model [m], shape (n,)."""
        nodes = 3 * self._model.lattice.n_nodes
        self.reset(run.commands[0], run.coordinates[0])
        errors = [self._largest(run.coordinates[0], nodes)]
        for command, truth in zip(run.commands[1:], run.coordinates[1:], strict=True):
            self.advance(command)
            errors.append(self._largest(truth, nodes))
        return np.array(errors)

    def _largest(self, truth: np.ndarray, nodes: int) -> float:
        apart = (self._qs[0, :nodes] - truth[:nodes]).reshape(-1, 3)
        return float(np.sqrt(np.nanmax((apart**2).sum(axis=1))))


def train(scene: Scene, slew: float, *, runs: int = 30, duration: float = 8.0, seed: int = 0) -> ReducedRun:
    """Return the reduced model of a scene; it takes a minute.

    Args:
        scene: A scene whose arms are driven by pressure.
        slew: Largest change of a pressure in its range [Pa/s]; the samples go half as far again.
        runs: Runs of the full model for samples; half as many, shorter ones calibrate the estimate.
        duration: Duration of each [s].
        seed: Seed of the commands.
    """
    arms = scene.build().model.arms
    if arms is None:
        raise SceneError(f"{scene.name}: expected arms that are driven by pressure for the reduced model")
    limit = np.array([own.pressure_limit for own in arms.each])
    draw = np.random.default_rng(seed)
    count = round(duration / PERIOD)
    samples = [full_run(scene, random_commands(limit, 1.5 * slew, count, draw)) for _ in range(runs)]
    calibration = [
        full_run(scene, random_commands(limit, slew, count // 4, draw)) for _ in range(max(runs // 2, 4))
    ]
    return ReducedRun(scene, samples, calibration, slew=slew)
