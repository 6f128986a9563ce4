"""The error of a run, transported over each step by the linearised equation of motion with the step's kept factors."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.integrators.base import Counters, ErrorState, Step
from ldcs_ros.integrators.implicit.error_kernels import (
    INNER,
    STAGE_PLACES,
    apply_stage,
    column_spins,
    finish_stage,
    interpolate,
    known_part,
    largest_bulge,
    largest_distance,
    moments,
    rotate_vectors,
    subtract_spin,
)
from ldcs_ros.integrators.implicit.momenta import Momenta
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.physics.inputs import HeldCommands

if TYPE_CHECKING:
    from ldcs_ros.integrators.implicit.dirk_kernel import DirkKernel

# Within a step an error grows at most by this factor beside its own motion, and by so many times the step's estimate.
MAX_GROWTH = 1.3
MAX_LOCAL = 10.0
# A held and strongly damped sheet that turns far in a long step is not resolved by three stages: their answer to the
# residual is up to ten times too large (measured on `gripper_strip`). There the step's own estimate bounds growth.
UNRESOLVED_ANGLE = 0.03  # rad
UNRESOLVED_STEP = 2e-3  # s, and the same for the springs' relaxation time
UNRESOLVED_LOCAL = 3.0


# Weights of stages of the transport that are free to choose: with these, all stay below 0.7.
FREE_WEIGHTS = -1.0 / 6.0, 0.065, 0.41


@lru_cache(maxsize=64)
def _tableau(diagonal: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return coefficients, times and the first moment of linear forcing of five stages with a common diagonal.

    They are stiffly accurate, of fourth order for constant coefficients, and L-stable for a diagonal of 0.248 to 0.676
    (Hairer and Wanner, Solving ODEs II, table IV.6.4); below that, oscillations grow by at most 1e-5 in a step of
    0.7 / omega. The second to the fourth stage are at Lobatto's inner points.
    """
    a, (early, late), (third, fourth, fifth) = np.diag(np.full(5, diagonal)), INNER, FREE_WEIGHTS
    a[1, 0] = late - diagonal
    a[2, :2] = early - diagonal - third, third
    a[3, :3] = late - diagonal - fourth - fifth, fourth, fifth
    times = a[:4, :4].sum(axis=1)
    second = a[:4, :4] @ times
    rows = np.array([np.ones(4), times, second, a[:4, :4] @ second])
    moments_of_last = np.array([1.0, 1 / 2, 1 / 6, 1 / 24]) - diagonal * np.array([1.0, 1.0, 1 / 2, 1 / 6])
    a[4, :4] = np.linalg.solve(rows, moments_of_last)
    c = a.sum(axis=1)
    return a, c, float(a[-1] @ a @ c)


class ErrorTransport:
    """Transports e = (true motion) - (computed motion) over a step.

    With p the quintic of the step, M e'' = f(p + e) - f(p) + r, r = f(p) - M p''. Lobatto's rule gives the mean and the
    first moment of the residual r. Five implicit stages of one solve each advance e; their diagonal is that of the
    factors, whatever the step's length. Broyden's updates stay out: those learned with another length damp the
    error of an undamped swing. Each column of nodes has its residual in axes that turn with it at a constant
    rate: a force along a stiff spring must not push across it where the spring has turned. A sheet that nothing holds
    has its error in axes that turn with the whole sheet, too. While no force has a moment about its centre of mass, the
    angular momentum that the stages got wrong is put right in the step and in e: nothing would forget it.
    """

    def __init__(self, system: LinearSystem, kernel: DirkKernel | None) -> None:
        self._system, self._model, self._kernel = system, system.model, kernel
        self._is_loose = self._model.is_unconstrained
        self._is_viscous = not self._is_loose and self._model.relaxation_time > UNRESOLVED_STEP
        self._no_spin = np.zeros((0, 3))
        self._momenta = Momenta(self._model) if self._is_loose else None

    def initial(self) -> ErrorState:
        """Return the error of a given start: none."""
        return ErrorState(np.zeros(len(self._model.free)), np.zeros(len(self._model.free)))

    def size(self, error: np.ndarray) -> float:
        """Return the largest distance of a node [m] in an error of the free coordinates, or speed [m/s] of rates."""
        return float(largest_distance(self._model.free, error, self._model.n_free_nodes))

    def advance(
        self,
        step: Step,
        inputs: HeldCommands,
        error: ErrorState,
        factors: tuple[Factors, Factors, Factors],
        counters: Counters,
    ) -> tuple[Step, ErrorState]:
        """Return a step with the momenta of a loose sheet corrected, and the error at its end.

        Args:
            step: The step.
            inputs: What is commanded during it.
            error: The error at its start.
            factors: Those of its stages near INNER and at its end, of one h.
            counters: Where evaluations and solves are counted.
        """
        are_turned: list[bool] = []
        found = self._carried_at_once(step, inputs, error, factors)
        if found is None:
            angle, column_spin = self._column_spin(step)
            try:
                carried = self._transport(step, inputs, error, factors, column_spin, are_turned)
            except DivergenceError:
                # The error is so large that its place is no shape of a sheet.
                carried = ErrorState(np.full_like(error.q, math.inf), error.u)
        else:
            angle, carried = found
        counters.evaluations += 2 + len(STAGE_PLACES)
        counters.solves += len(STAGE_PLACES)
        h = step.right.time - step.left.time
        q, u = self.size(error.q), self.size(error.u)
        if self._is_viscous and angle > UNRESOLVED_ANGLE and h > UNRESOLVED_STEP:
            most_q, most_u = q + UNRESOLVED_LOCAL * step.error, u + UNRESOLVED_LOCAL * step.rate_error
        else:
            most_q = MAX_GROWTH * (q + h * u) + MAX_LOCAL * step.error
            most_u = MAX_GROWTH * (u + q / h) + MAX_LOCAL * step.rate_error
        new_q, new_u = self.size(carried.q), self.size(carried.u)
        if not new_q + new_u < math.inf:
            return step, ErrorState(error.q, error.u, most_q, speed=most_u)
        scale = min(1.0, most_q / max(new_q, 1e-300), most_u / max(new_u, 1e-300))
        distance = min(max(new_q, carried.distance), most_q)
        speed = min(max(new_u, carried.speed), most_u)
        moved = ErrorState(scale * carried.q, scale * carried.u, distance, speed=speed)
        return self._spinning_on(step, error, moved) if are_turned == [False, False] else (step, moved)

    def _spinning_on(self, step: Step, before: ErrorState, after: ErrorState) -> tuple[Step, ErrorState]:
        """Return the step with the angular momentum of its start, and its error with that of the error before."""
        assert self._momenta is not None
        free, momenta, start, end = self._model.free, self._momenta, step.left, step.right
        lost = momenta.of_rates(start.q, start.u[free]) - momenta.of_rates(end.q, end.u[free])
        u = end.u.copy()
        u[free] += momenta.spinning(end.q, lost)
        step = replace(step, right=replace(end, u=u), drift=0.0)
        lost = momenta.of_error(start, before) - momenta.of_error(step.right, after)
        return step, replace(after, u=after.u + momenta.spinning(end.q, lost))

    def _carried_at_once(
        self,
        step: Step,
        inputs: HeldCommands,
        error: ErrorState,
        factors: tuple[Factors, Factors, Factors],
    ) -> tuple[float, ErrorState] | None:
        """Return the largest angle that a column turns in a step [rad], and the error at its end, by one function.

        None for a loose sheet, and for effects that compiled code does not know.
        """
        kernel = self._kernel
        steady = None if kernel is None or self._is_loose else kernel.force.steady(inputs)
        if kernel is None or steady is None:
            return None
        from ldcs_ros.integrators.implicit.transport_kernel import carry_error

        start, end, rate_step = step.left, step.right, factors[0].rate_step
        h = end.time - start.time
        times = np.array([start.time + INNER[0] * h, start.time + INNER[1] * h, end.time])
        q, u = kernel.places(end, times)
        a, c, moment = _tableau(rate_step / h)
        carried = np.empty((2, len(self._model.free)))
        inside, speed, angle = carry_error(
            kernel.sheet,
            kernel.tables(factors[2]),
            a,
            c,
            moment,
            h,
            rate_step,
            np.array([one.turns for one in factors]),
            kernel.drives(times, inputs),
            steady,
            start.a if start.lasting is None else start.lasting,
            start.q,
            start.u,
            end.a,
            q,
            u,
            error.q,
            error.u,
            carried,
        )
        return float(angle), ErrorState(carried[0], carried[1], float(inside), speed=float(speed))

    def _transport(
        self,
        step: Step,
        inputs: HeldCommands,
        error: ErrorState,
        factors: tuple[Factors, Factors, Factors],
        column_spin: np.ndarray,
        are_turned: list[bool],
    ) -> ErrorState:
        model, free, order = self._model, self._model.free, self._system.order
        spin = self._mean_spin(column_spin)
        start, end = step.left, step.right
        h, rate_step, n_free = end.time - start.time, factors[0].rate_step, len(free)
        a, c, moment = _tableau(rate_step / h)
        first = start.a if start.lasting is None else start.lasting
        places, forces, residuals = [], [], np.empty((2, n_free))
        for k, s in enumerate(INNER):
            q, u, acceleration = start.q.copy(), start.u.copy(), np.empty(n_free)
            interpolate(free, h, s, start.q, start.u, first, end.q, end.u, end.a, q, u, acceleration)
            model.prescribe(start.time + s * h, q, u)
            force = model.force(start.time + s * h, q, u, inputs)
            if self._momenta is not None:
                are_turned.append(self._momenta.is_turned(q, force))
            residuals[k] = force - model.momentum(q, acceleration)
            rotate_vectors(order, column_spin, -s * h, residuals[k])
            places.append((start.time + s * h, q, u))
            forces.append(force)
        places.append((end.time, end.q.copy(), end.u.copy()))
        forces.append(model.momentum(end.q, end.a))
        if len(spin):
            system = self._system
            factors = tuple(system.turn(factors[2], *place, inputs, rate_step) for place in places)  # type: ignore[assignment]
        mean, slope = np.empty(n_free), np.empty(n_free)
        moments(residuals[0], residuals[1], moment, mean, slope)
        # Position, rate and acceleration of the error at each stage; its known part, without its own acceleration.
        errors, known = np.empty((len(c), 3, n_free)), np.empty((2, n_free))
        e_q, e_u = error.q, error.u.copy()
        subtract_spin(order, spin, e_q, e_u)
        for i, at in enumerate(STAGE_PLACES):
            time, q, u = places[at][0], places[at][1].copy(), places[at][2].copy()
            elapsed = time - start.time
            known_part(a, i, h, e_q, e_u, errors, known)
            force = mean + (c[i] - 0.5) * slope
            rotate_vectors(order, column_spin, elapsed, force)
            apply_stage(free, order, spin, elapsed, rate_step, model.mass, known, q, u, force)
            force += model.force(time, q, u, inputs)
            force -= forces[at]
            change = factors[at].solve(force)
            rotate_vectors(order, spin, -elapsed, change)
            finish_stage(i, rate_step, change, known, errors)
        # A linear forcing has the residual's mean; the residual's largest value inside the step is about twice that.
        inside = largest_bulge(free, model.n_free_nodes, c, e_q, errors)
        q, u = errors[-1, 0].copy(), errors[-1, 1].copy()
        subtract_spin(order, -spin, q, u)
        rotate_vectors(order, spin, h, q)
        rotate_vectors(order, spin, h, u)
        return ErrorState(q, u, inside, speed=max(self.size(rates) for rates in errors[:, 1]))

    def _column_spin(self, step: Step) -> tuple[float, np.ndarray]:
        """Return the largest angle that a column turns in a step [rad], and each node's angular velocity [rad/s]."""
        columns, h = self._system.columns, step.right.time - step.left.time
        if columns is None:
            return 0.0, self._no_spin
        spin = np.empty((len(columns), 3))
        now, then = self._system.frames(step.right.q), self._system.frames(step.left.q)
        return float(column_spins(now, then, columns, h, spin)), spin

    def _mean_spin(self, column_spin: np.ndarray) -> np.ndarray:
        """Return the angular velocity of the error's axes for each node: the columns' mean, none for a held sheet."""
        if not self._is_loose or not len(column_spin):
            return self._no_spin
        return np.broadcast_to(column_spin.mean(axis=0), column_spin.shape).copy()
