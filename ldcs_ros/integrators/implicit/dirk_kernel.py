"""The stages of a DIRK step as one compiled function, for scenes that the compiled force covers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ldcs_ros.integrators.implicit.banded import BandFactors, solve_band
from ldcs_ros.integrators.implicit.bordered_kernel import (
    fill_both_rotations,
    fill_residual,
    into_sheet,
    out_of_sheet,
    times_mass,
)
from ldcs_ros.integrators.implicit.broyden import (
    MOST_UPDATES,
    WILD_RATE,
    apply_updates,
    extend_updates,
    place,
)
from ldcs_ros.integrators.implicit.system import TURN, Factors, LinearSystem
from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.kernels.total_force import ForceTables, TotalForce
from ldcs_ros.physics.model import Model, Motion

# How a call of `solve_stages` ends: all stages are done, the arms' border is wanted anew, the iteration of the stage
# does not converge, or its numbers are not finite.
DONE, BORDER_WANTED, NOT_CONVERGED, NOT_FINITE = range(4)


class SheetTables(NamedTuple):
    """What kernels read of a model.

    Attributes:
        force: The effects.
        scratch: Room for the force.
        free: Free coordinates, nodes first, shape (n_free,).
        mass: Of the free coordinates of nodes [kg], shape (n_free_nodes,).
        reach: Displacement of a node for a coordinate's unit, shape (n_free,).
        inertia: Room for the mass matrix of each arm whose angles are free, shape (n_arms or 0, n_links, n_links).
    """

    force: ForceTables
    scratch: np.ndarray
    free: np.ndarray
    mass: np.ndarray
    reach: np.ndarray
    inertia: np.ndarray


class BandTables(NamedTuple):
    """Kept factors of banded storage; see `FactorTables` for what both have.

    Attributes:
        lower: Columns of the Cholesky factor.
        inverse_diagonal: Of that.
        angles: Link angles at which the border was taken [rad].
    """

    order: np.ndarray
    lower: np.ndarray
    inverse_diagonal: np.ndarray
    border: np.ndarray
    corner: np.ndarray
    columns: np.ndarray
    neighbours: np.ndarray
    frames: np.ndarray
    angles: np.ndarray


class StageNumbers(NamedTuple):
    """The numbers of one step.

    Attributes:
        h: The step [s].
        rate_step: h g [s].
        allowed: Displacement that may be left of an iteration [m].
        rate: Contraction rate to expect until two iterations measured it.
        scale: Factor on the solution of kept factors.
        ahead: Time ahead of the second rotation of the columns [s].
        turning_move: Displacement after which the columns are looked at again [m].
        patience: Iterations at most.
    """

    h: float
    rate_step: float
    allowed: float
    rate: float
    scale: float
    ahead: float
    turning_move: float
    patience: int


class StageProgress(NamedTuple):
    """Where the iteration stands, so that it goes on after new factors.

    Attributes:
        status: How the call ended.
        stage: Stage at work.
        iteration: Its iteration; -1 before its guess.
        before: Displacement of the iteration before [m].
        rate: Contraction rate.
        worst: Worst one in this stage.
        most: Worst one of the stages that are done; -1 if none was measured.
        updates: Number of Broyden updates.
        solves: Solves in this call.
    """

    status: int
    stage: int
    iteration: int
    before: float
    rate: float
    worst: float
    most: float
    updates: int
    solves: int


START = StageProgress(DONE, 1, -1, np.inf, 0.0, 0.0, -1.0, 0, 0)


@compiled
def solve_turned(factors, turns, scale, right):  # type: ignore[no-untyped-def]
    """Replace a right side by `scale` times the solution with turned band factors, free coordinates."""
    nodes = np.empty(factors.order.size)
    into_sheet(factors, turns, right, nodes)
    solve_band(factors.lower, factors.inverse_diagonal, nodes)
    out_of_sheet(factors, turns, scale, nodes, right)


@compiled
def _predict(stage, numbers, sheet, a, bend, offset, q, u, rates, accelerations, known):  # type: ignore[no-untyped-def]
    # What the stages before give of positions and rates, and a guess of the accelerations, placed in q and u.
    free, h = sheet.free, numbers.h
    guess, last = accelerations[stage], accelerations[stage - 1]
    earlier = accelerations[max(stage - 2, 0)]
    for i in range(free.size):
        position = rate = 0.0
        for j in range(stage):
            position += a[stage, j] * rates[j, i]
            rate += a[stage, j] * accelerations[j, i]
        known[0, i] = q[0, free[i]] + h * position
        known[1, i] = rates[0, i] + h * rate
        guess[i] = last[i]
    if offset.shape[1] > 0:
        for i in range(free.size):
            guess[i] += offset[stage, i]
    if stage > 1:
        for i in range(free.size):
            guess[i] += bend[stage] * (last[i] - earlier[i])
    place(free, known[0], known[1], guess, numbers.rate_step, q[stage], u[stage])


@compiled
def solve_stages(  # type: ignore[no-untyped-def]
    progress,
    numbers,
    sheet,
    factors,
    a,
    drive,
    steady,
    bend,
    offset,
    before,
    after,
    squares,
    q,
    u,
    rates,
    accelerations,
    known,
    change,
    turns,
):
    """Solve the stages of a step from the one at work on, as `Dirk` does it one by one; return the new `StageProgress`.

    Args:
        progress: Where to begin.
        numbers: The step's `StageNumbers`.
        sheet: `SheetTables`.
        factors: `BandTables` of kept factors.
        a: The tableau's coefficients, shape (n_stages, n_stages).
        drive: Drive torque of each joint at each stage [N m], shape (n_stages, n_arms, n_links).
        steady: Constant forces on all coordinates [N, N m].
        bend: Guess of a stage: last + bend (last - the one before) + offset, shape (n_stages,).
        offset: Shape (n_stages, n_free), or (n_stages, 0) for none.
        before, after, squares: Broyden's updates.
        q, u: Start, and stages with their prescribed coordinates, shape (n_stages, n_coordinates).
        rates, accelerations: Of the free coordinates, shape (n_stages, n_free); the start's are given.
        known: Room, shape (2, n_free): position and rate without the stage's own acceleration.
        change: Room: the last change of the accelerations, shape (n_free,).
        turns: Rotations of the columns at each stage, shape (n_stages, 2, n_columns, 3, 3).
    """
    free, n_free, rate_step = sheet.free, sheet.free.size, numbers.rate_step
    stage, iteration, count, solves = progress.stage, progress.iteration, progress.updates, 0
    previous, rate, worst, most = progress.before, progress.rate, progress.worst, progress.most
    residual, force = np.empty(n_free), np.empty(q.shape[1])
    while stage < a.shape[0]:
        x, v, acceleration = q[stage], u[stage], accelerations[stage]
        if iteration < 0:
            _predict(stage, numbers, sheet, a, bend, offset, q, u, rates, accelerations, known)
            iteration, previous, rate, worst = 0, np.inf, numbers.rate, 0.0
        moved, status = np.inf, NOT_CONVERGED
        while iteration < numbers.patience:
            if moved > numbers.turning_move:
                fill_both_rotations(factors, sheet.scratch.shape[1], numbers.ahead, x, v, turns[stage])
                for i in range(factors.angles.size):
                    if abs(x[x.size - factors.angles.size + i] - factors.angles[i]) > TURN:
                        return StageProgress(
                            BORDER_WANTED, stage, iteration, previous, rate, worst, most, count, solves
                        )
            fill_residual(
                sheet.force, drive[stage], steady, sheet.scratch, free, sheet.mass, x, v, acceleration,
                sheet.inertia, force, residual,
            )  # fmt: skip
            solve_turned(factors, turns[stage], numbers.scale, residual)
            solves += 1
            apply_updates(before, after, squares, count, sheet.reach, residual)
            if iteration > 0 and count < MOST_UPDATES:
                if extend_updates(change, sheet.reach, residual, before, after, squares, count):
                    count += 1
            moved = 0.0
            for i in range(n_free):
                size = abs(residual[i]) * sheet.reach[i]
                if not size < np.inf:
                    status = NOT_FINITE
                    break
                moved = max(moved, size)
                change[i] = residual[i]
                acceleration[i] += residual[i]
            if status == NOT_FINITE:
                break
            moved *= rate_step * rate_step
            place(free, known[0], known[1], acceleration, rate_step, x, v)
            iteration += 1
            if iteration > 1:
                rate = moved / previous if previous > 0.0 else 0.0
                worst = max(worst, rate)
                if rate > WILD_RATE or (iteration > 5 and rate > 0.95):
                    break
            if moved == 0.0 or (rate < 1.0 and moved * rate / (1.0 - rate) <= numbers.allowed):
                status = DONE
                break
            previous = moved
        if status != DONE:
            # The guess again: new factors are taken there.
            _predict(stage, numbers, sheet, a, bend, offset, q, u, rates, accelerations, known)
            return StageProgress(status, stage, -1, np.inf, rate, 0.0, most, count, solves)
        if iteration > 1:
            most = max(most, worst)
        for i in range(n_free):
            rates[stage, i] = v[free[i]]
        stage, iteration = stage + 1, -1
    return StageProgress(DONE, stage, -1, np.inf, 0.0, 0.0, most, count, solves)


@compiled
def _decay_rate(sheet, drive, steady, q, u, a):  # type: ignore[no-untyped-def]
    # As `Model.damping_rate`.
    free = sheet.free
    still, rate, force, residual = u.copy(), np.empty(free.size), np.empty(q.size), np.empty(free.size)
    for i in range(free.size):
        rate[i] = u[free[i]]
        still[free[i]] = 0.0
    fill_residual(
        sheet.force, drive, steady, sheet.scratch, free, sheet.mass, q, still, a, sheet.inertia, force, residual
    )  # fmt: skip
    power = energy = 0.0
    momentum = rate.copy()
    times_mass(sheet.inertia, sheet.mass, momentum, sheet.mass.size)
    for i in range(free.size):
        power += rate[i] * residual[i]
        energy += rate[i] * momentum[i]
    return 0.5 * power / energy if energy > 0.0 else np.inf


class DirkKernel:
    """The tables of one model and method for `solve_stages` and what else a step asks of compiled code."""

    def __init__(self, model: Model, system: LinearSystem, reach: np.ndarray) -> None:
        self.force, self.system, self._model = TotalForce(model), system, model
        links = 0 if model.arms is None or not model.n_free_angles else model.arms.n_links
        arms = 0 if not links else model.n_free_angles // links
        self.sheet = SheetTables(
            self.force.tables,
            self.force.scratch,
            model.free,
            model.mass,
            reach,
            np.zeros((arms, links, links)),
        )
        # A clamp's values never change.
        self._moving = tuple(term for term in model.prescribing if term.name != "clamp")
        self.n_columns = 0 if system.columns is None else len(system.columns)

    def places(self, motion: Motion, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a motion's coordinates and rates with the prescribed ones of each time, shape (n, n_coordinates)."""
        q, u = np.empty((2, len(times), len(motion.q)))
        q[:], u[:] = motion.q, motion.u
        for term in self._moving:
            for time, x, v in zip(times, q, u, strict=True):
                if time != motion.time:
                    term.prescribe(time, x, v)
        return q, u

    def drives(self, times: np.ndarray, inputs: HeldCommands) -> np.ndarray:
        """Return the drive torque of each joint at each time [N m], shape (n, n_arms, n_links)."""
        arms = self._model.arms
        return np.zeros((len(times), 0, 0)) if arms is None else arms.drive_torques(times, inputs)

    def damping_rate(self, motion: Motion, inputs: HeldCommands) -> float | None:
        """Return the same as `Model.damping_rate` [1/s]; None for a held wrench that rotates."""
        steady = self.force.steady(inputs)
        if steady is None:
            return None
        drive = self.force.drive(motion.time, inputs)
        return float(_decay_rate(self.sheet, drive, steady, motion.q, motion.u, motion.a))

    def tables(self, factors: Factors) -> BandTables:
        """Return the tables of kept factors."""
        if factors.tables is None:
            nodes, border, reach, corner = factors.parts
            assert isinstance(nodes, BandFactors)
            columns = self.system.columns
            factors.tables = BandTables(
                self.system.order,
                nodes.lower,
                nodes.inverse_diagonal,
                np.stack([border, reach]),
                corner,
                np.zeros(0, dtype=np.int64) if columns is None else columns,
                self._model.lattice.column_neighbours,
                factors.frames,
                factors.angles,
            )
        assert isinstance(factors.tables, BandTables)
        return factors.tables
