"""Tangents of a run: derivatives of its steps, which are frozen, by the linearised equations of their stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.integrators.base import Step
from ldcs_ros.integrators.implicit.esdirk import RATE_SHARE, Dirk
from ldcs_ros.integrators.implicit.linearisation import Linearisation
from ldcs_ros.integrators.tableaux import Tableau
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model

if TYPE_CHECKING:
    from ldcs_ros.integrators.implicit.linear_kernel import LinearKernel

# d(f - M a)/dp of all columns at instants: times, coordinates, rates and free accelerations, a row each; returns shape
# (n_instants, k, n_free).
ForceTangents = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Tangents:
    """Derivatives of a motion's free coordinates by k numbers.

    Attributes:
        q: Of the coordinates, shape (n_free, k).
        u: Of their rates.
        a: Of the accelerations.
    """

    q: np.ndarray
    u: np.ndarray
    a: np.ndarray

    def toward(self, end: Tangents, h: float, s: float, *, jumped: bool) -> Tangents:
        """Return the tangents at the fraction s of the step of length h [s] that leads to `end`.

        The quintic of `Step.at`; after a jump of accelerations a quartic without that at the start, which stiff parts
        have for microseconds only.
        """
        gap, rate = end.q - self.q - h * self.u, h * (end.u - self.u)
        if jumped:
            c2, c3, c4 = _quartic(gap, rate, h * h * end.a)
            c5: np.ndarray | float = 0.0
        else:
            c2 = 0.5 * h * h * self.a
            bend = h * h * (end.a - self.a)
            gap, rate = gap - c2, rate - 2.0 * c2
            c3 = 10.0 * gap - 4.0 * rate + 0.5 * bend
            c4 = -15.0 * gap + 7.0 * rate - bend
            c5 = 6.0 * gap - 3.0 * rate + 0.5 * bend
        q = self.q + s * (h * self.u + s * (c2 + s * (c3 + s * (c4 + s * c5))))
        u = self.u + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))) / h
        a = (2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h)
        return Tangents(q, u, a)


def _quartic(
    gap: np.ndarray, rate: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # c2 + c3 + c4 = gap, 2 c2 + 3 c3 + 4 c4 = rate, 2 c2 + 6 c3 + 12 c4 = last.
    return (
        6.0 * gap - 3.0 * rate + 0.5 * last,
        -8.0 * gap + 5.0 * rate - last,
        3.0 * gap - 2.0 * rate + 0.5 * last,
    )


class EquationChoice:
    """The stages' linear equations: compiled ones where they serve.

    Args:
        integrator: The method.
        weight: Weight of each coordinate's square in norms, shape (n_free,).
    """

    def __init__(self, integrator: Dirk, weight: np.ndarray) -> None:
        self._kernel = integrator.kernel
        self._sparse = Linearisation(integrator.model, weight)
        self._compiled: LinearKernel | None = None
        if self._kernel is not None:
            from ldcs_ros.integrators.implicit.linear_kernel import LinearKernel

            self._compiled = LinearKernel(self._kernel, self._sparse)

    def under(self, held: HeldCommands) -> Linearisation | LinearKernel:
        """Return the equations under held commands; a wrench that rotates with the sheet has no compiled ones."""
        is_covered = self._kernel is not None and self._kernel.force.steady(held) is not None
        return self._compiled if is_covered and self._compiled is not None else self._sparse


class TangentSteps:
    """Carries tangents over the steps of an ESDIRK method.

    A stage solves M(q) a = f(t, q, u, p) with q = q* + h g u and u = u* + h g a. Its derivative by p with h frozen is
    linear, with the exact matrix of the stage; the factors that the step was taken with serve as preconditioner. So
    the tangents are those of the computed motion itself, not of another discretisation.

    Args:
        integrator: The method. The tangents are exact for its stages as they are, so far as those are iterated
            (`iteration_share`).
    """

    def __init__(self, integrator: Dirk) -> None:
        self._integrator, self._model = integrator, integrator.model
        self.reach = np.ones(len(self._model.free))
        self.reach[self._model.n_free_nodes :] = self._model.lattice.size[0]
        self._equations = EquationChoice(integrator, self.reach**2)

    def at_start(
        self, step: Step, held: HeldCommands, q: np.ndarray, u: np.ndarray, forces: ForceTangents
    ) -> Tangents:
        """Return the tangents at the start of a step, the accelerations by the equation of motion."""
        left, model = step.left, self._model
        equations = self._equations.under(held)
        equations.linearise(left.time, left.q, left.u, left.a, held)
        (rows,) = forces(np.array([left.time]), left.q[None], left.u[None], left.a[None])
        equations.balance(_rows(q), _rows(u), np.zeros(rows.shape), rows)
        force, n = rows.T, model.n_free_nodes
        force[:n] /= model.mass[:, None]
        blocks = model.inertia(left.q)
        if blocks is not None:
            links = blocks.shape[1]
            angles = force[n:].reshape(len(blocks), links, -1)
            force[n:] = np.linalg.solve(blocks, angles).reshape(len(force) - n, -1)
        return Tangents(q, u, force)

    def advance(
        self,
        step: Step,
        held: HeldCommands,
        start: Tangents,
        forces: ForceTangents,
        *,
        tolerance: np.ndarray,
        solved: float,
    ) -> tuple[Tangents, np.ndarray]:
        """Return the tangents at the end of the step that was taken last, and the error that the step made in them.

        Args:
            step: The step.
            held: The commands during it.
            start: The tangents at its start.
            forces: d(f - M a)/dp at instants.
            tolerance: Error of each column below which its estimate is not refined, shape (k,).
            solved: Error that a stage's linear equation may keep, relative to its solution.

        Returns:
            The tangents, and the estimated error of each column's positions, shape (k,), an angle as its arm's tip.
        """
        tableau = self._integrator.tableau
        stages, factors = self._integrator.last_stages
        h, n_stages = step.right.time - step.left.time, len(tableau.c)
        rate_step, shape = tableau.diagonal * h, start.q.T.shape
        times, q, u = stage_motions(self._model, tableau, step, stages)
        left_over = forces(times[1:], q[1:], u[1:], stages[1:])
        rates, bends = np.empty((n_stages, *shape)), np.empty((n_stages, *shape))
        start_q, rates[0], bends[0] = _rows(start.q), start.u.T, start.a.T
        end_q, contraction, equations = start_q, 1.0, self._equations.under(held)
        for i in range(1, n_stages):
            row = h * tableau.a[i, :i]
            equations.linearise(times[i], q[i], u[i], stages[i], held)
            known_q, known_u = start_q + _combined(row, rates), rates[0] + _combined(row, bends)
            bends[i] = self._guess(bends, tableau.c, i)
            guessed_rate = known_u + rate_step * bends[i]
            equations.balance(known_q + rate_step * guessed_rate, guessed_rate, bends[i], left_over[i - 1])
            contraction = equations.solve(
                factors[i - 1], rate_step, left_over[i - 1], bends[i], solved, contraction
            )
            np.multiply(rate_step, bends[i], out=rates[i])
            rates[i] += known_u
            end_q = known_q + rate_step * rates[i]
        end = Tangents(end_q.T, rates[-1].T, bends[-1].T)
        defect = _combined(h * tableau.error_weights, rates)
        rate_defect = _combined(h * tableau.error_weights, bends)
        error = self.size(np.maximum(np.abs(defect), RATE_SHARE * h * np.abs(rate_defect)).T)
        if (error > tolerance).any():
            # Shampine's filter, as in the step itself: what stiff parts have forgotten at its end does not count.
            # `known` is M (defect + h g rate_defect) - h g C defect.
            known = np.zeros(shape)
            still = np.zeros(shape)
            equations.balance(still, -rate_step * defect, -(defect + rate_step * rate_defect), known)
            error = np.minimum(error, self.size(factors[-1].solve(known.T)))
        return end, error

    def size(self, values: np.ndarray) -> np.ndarray:
        """Return the largest displacement in each column, shape (k,); an angle counts as its arm's tip."""
        return np.asarray((np.abs(values) * self.reach[:, None]).max(axis=0, initial=0.0))

    @staticmethod
    def _guess(bends: np.ndarray, c: np.ndarray, i: int) -> np.ndarray:
        if i < 3:
            # The first stage may hold a jump: nothing can be extrapolated from it.
            return np.asarray(bends[i - 1])
        order = np.argsort(c[1:i])[-2:] + 1
        near, far = order[1], order[0]
        if c[near] == c[far]:
            return np.asarray(bends[near])
        return np.asarray(bends[near] + (c[i] - c[near]) / (c[near] - c[far]) * (bends[near] - bends[far]))


def stage_motions(
    model: Model, tableau: Tableau, step: Step, accelerations: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times of the start and the stages of a step, and coordinates and rates, shape (n_stages, n_coordinates).

    Args:
        model: The model.
        tableau: The method's.
        step: The step.
        accelerations: Of the free coordinates at start and stages, shape (n_stages, n_free).
    """
    left, free = step.left, model.free
    h, n_stages = step.right.time - left.time, len(tableau.c)
    weights = h * tableau.a
    times, rates = left.time + tableau.c * h, left.u[free] + weights @ accelerations
    q, u = np.tile(left.q, (n_stages, 1)), np.tile(left.u, (n_stages, 1))
    q[:, free] += weights @ rates
    u[:, free] = rates
    for instant in zip(times, q, u, strict=True):
        model.prescribe(*instant)
    return times, q, u


def _rows(columns: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(columns.T)


def _combined(weights: np.ndarray, stages: np.ndarray) -> np.ndarray:
    # A product of matrices: a tenth of the time of np.tensordot.
    n = len(weights)
    return np.asarray(weights @ stages[:n].reshape(n, -1)).reshape(stages.shape[1:])
