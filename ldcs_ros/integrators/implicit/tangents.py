"""Tangents of a run: derivatives of its steps, which are frozen, by the linearised equations of their stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.integrators.base import Step
from ldcs_ros.integrators.implicit.esdirk import RATE_SHARE, Dirk
from ldcs_ros.integrators.implicit.linearisation import Linearisation, add_balance, solve_stage
from ldcs_ros.physics.inputs import HeldCommands

# d(f - M a)/dp of all columns at fixed free coordinates, rates and accelerations, shape (n_free, k).
ForceTangents = Callable[[float, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


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
        self._linearisation = Linearisation(self._model)
        self.reach = np.ones(len(self._model.free))
        self.reach[self._model.n_free_nodes :] = self._model.lattice.size[0]

    def at_start(
        self, step: Step, held: HeldCommands, q: np.ndarray, u: np.ndarray, forces: ForceTangents
    ) -> Tangents:
        """Return the tangents at the start of a step, the accelerations by the equation of motion."""
        left, model = step.left, self._model
        by_q, by_u, _ = self._linearisation.at(left.time, left.q, left.u, left.a, held)
        force = forces(left.time, left.q, left.u, left.a) + by_q @ q + by_u @ u
        n = model.n_free_nodes
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
            forces: d(f - M a)/dp at an instant.
            tolerance: Error of each column below which its estimate is not refined, shape (k,).
            solved: Error that a stage's linear equation may keep, relative to its solution.

        Returns:
            The tangents, and the estimated error of each column's positions, shape (k,), an angle as its arm's tip.
        """
        model, tableau, left = self._model, self._integrator.tableau, step.left
        stages, factors = self._integrator.last_stages
        h, free, n_stages = step.right.time - left.time, model.free, len(tableau.c)
        rate_step = tableau.diagonal * h
        rates, bends = np.empty((n_stages, *start.q.shape)), np.empty((n_stages, *start.q.shape))
        rates[0], bends[0] = start.u, start.a
        own_rates = np.empty((n_stages, len(free)))
        own_rates[0] = left.u[free]
        weight = self.reach**2
        end_q, contraction = start.q, 1.0
        for i in range(1, n_stages):
            time, row = left.time + tableau.c[i] * h, h * tableau.a[i, :i]
            own_rates[i] = left.u[free] + row @ stages[:i] + rate_step * stages[i]
            q, u = left.q.copy(), left.u.copy()
            q[free] = left.q[free] + row @ own_rates[:i] + rate_step * own_rates[i]
            u[free] = own_rates[i]
            model.prescribe(time, q, u)
            matrices = _, by_u, mass = self._linearisation.at(time, q, u, stages[i], held)
            matrix = self._linearisation.stage(matrices, rate_step)
            known_q = start.q + np.tensordot(row, rates[:i], 1)
            known_u = start.u + np.tensordot(row, bends[:i], 1)
            guess = self._guess(bends, tableau.c, i)
            left_over, guessed_rate = forces(time, q, u, stages[i]), known_u + rate_step * guess
            add_balance(matrices, known_q + rate_step * guessed_rate, guessed_rate, guess, left_over)
            bends[i], contraction = solve_stage(
                matrix, factors[i - 1], left_over, guess, weight, solved, contraction
            )
            rates[i] = known_u + rate_step * bends[i]
            end_q = known_q + rate_step * rates[i]
        end = Tangents(end_q, rates[-1], bends[-1])
        defect = h * np.tensordot(tableau.error_weights, rates, 1)
        rate_defect = h * np.tensordot(tableau.error_weights, bends, 1)
        error = self.size(np.maximum(np.abs(defect), RATE_SHARE * h * np.abs(rate_defect)))
        if (error > tolerance).any():
            # Shampine's filter, as in the step itself: what stiff parts have forgotten at its end does not count.
            known = mass @ (defect + rate_step * rate_defect) - rate_step * (by_u @ defect)
            error = np.minimum(error, self.size(factors[-1].solve(known)))
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
