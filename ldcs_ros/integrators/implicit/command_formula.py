"""The two-step formula under held commands: what it carries, its loads and factors, and its compiled row of steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager

import numpy as np

from ldcs_ros.integrators.base import Counters
from ldcs_ros.integrators.implicit import command_kernel as kernel
from ldcs_ros.integrators.implicit.block_tridiagonal import BlockTridiagonal
from ldcs_ros.integrators.implicit.bordered_kernel import factor_tables
from ldcs_ros.integrators.implicit.command_run import FRESH_RATES, NO_JUMP, CommandedRun, Loads, StepRow
from ldcs_ros.integrators.implicit.system import LinearSystem
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.kernels.coverage import is_covered
from ldcs_ros.physics.kernels.total_force import TotalForce
from ldcs_ros.physics.model import Model
from ldcs_ros.schema.units import TIME_TOLERANCE

# What an iteration may leave, as a fraction of the asked accuracy: it adds up over hundreds of steps.
ITERATION_FRACTION = 1e-4
PATIENCE = 12
# Kept factors serve rate steps within this ratio of theirs; rows of a few steps are not worth new ones.
RATE_STEP_RATIO, FEW_STEPS = 1.35, 3
FARTHEST_RATIO = 3.0
# A later contraction rate above this asks for new factors.
SLOW_RATE = 0.25
# Factors turn with the sheet when nodes have moved by this fraction of the spacing.
TURNING = 0.01
# A step that a command ends within this fraction of its length becomes a part of the one before.
SHORT = 0.35


class CommandFormula:
    """The compiled formula with the tables of one model.

    Args:
        model: A model that `TotalForce` serves.
        accuracy: Asked accuracy [m].
        one_thread: Makes the context in which factors are made.

    Raises:
        ValueError: The sheet has no slabs of equal size.
    """

    def __init__(
        self, model: Model, accuracy: float, one_thread: Callable[[], AbstractContextManager[None]]
    ) -> None:
        self._one_thread = one_thread
        self._model, self._force = model, TotalForce(model)
        self._system = LinearSystem(model, BlockTridiagonal)
        n_free, n_nodes = len(model.free), model.n_free_nodes
        self._weights = np.ones((2, n_free))
        self._weights[0, :n_nodes] = model.mass
        self._weights[1, n_nodes:] = model.lattice.size[0]
        self._allowed = ITERATION_FRACTION * accuracy
        self._turning = TURNING * min(model.lattice.spacing)

    def loads(self, held: HeldCommands) -> Loads | None:
        """Return what the kernel needs of held commands; None if a wrench turns with the sheet, or for a curve."""
        steady, arms = self._force.steady(held), self._model.arms
        if steady is None or held.curve is not None:
            return None
        if arms is None:
            return Loads(held, steady, np.zeros((4, 0, 0)), is_constant=True)
        drive = np.zeros((4, arms.n_arms, arms.n_links))
        drive[3] = 1.0
        if not held.chambers:
            drive[0] = arms.drive_torque(0.0, held)
            return Loads(held, steady, drive, is_constant=True)
        for k, chamber in enumerate(held.chambers):
            gain = np.where(arms.used[k], arms.each[k].pressure_gain, 0.0)
            lag = chamber.time_constant
            drive[0, k] = gain * chamber.target
            if lag > 0.0:
                drive[1, k], drive[2, k], drive[3, k] = (
                    gain * (chamber.pressure - chamber.target),
                    chamber.time,
                    lag,
                )
        return Loads(held, steady, drive, is_constant=False)

    def jump(self, time: float, before: Loads, after: Loads) -> np.ndarray:
        """Return the jump of the force on the free coordinates, shape (n_free,), or (0,) if there is none."""
        change = after.torque(time) - before.torque(time)
        # A valve is continuous but for rounding.
        if not after.is_constant and np.abs(change).max() <= 1e-12 * np.abs(after.drive[0]).max():
            change[:] = 0.0
        if after.steady is before.steady and not change.any():
            return NO_JUMP
        jump = (after.steady - before.steady)[self._model.free]
        if self._model.n_free_angles:
            torque = jump[self._model.n_free_nodes :].reshape(change.shape)
            torque += change
            torque[:, :-1] -= change[:, 1:]
        return jump

    def advance(self, run: CommandedRun, jump: np.ndarray, until: float, counters: Counters) -> CommandedRun:
        """Return the run after the steps of its row that a time [s] asks for, with the error at the last one's end.

        It has failed if one of them could not be taken; the steps before that one are part of it.
        """
        if run.index == 0:
            prepared = self._prepared(run, counters)
            if prepared is None:
                return run.changed(has_failed=True)
            run = prepared
        row = run.row
        last = run.index
        while last + 1 < row.count and row.time(last + 1) < until - TIME_TOLERANCE:
            last += 1
        if last + 1 == row.count and not row.is_open and row.end <= until + TIME_TOLERANCE:
            return self._steps(run, jump, row.count, counters).changed(previous=None)
        # A command may come within the last step: what leads to it is kept, and so is the step before.
        if last - 1 > run.index:
            run, jump = self._steps(run, jump, last - 1, counters), NO_JUMP
            run = run.changed(previous=None)
        while run.index <= last and not run.has_failed:
            base = run if run.previous is None else run.changed(previous=run.previous.changed(previous=None))
            run = self._steps(base, jump, run.index + 1, counters).changed(previous=base, jump=jump)
            jump = NO_JUMP
        return run

    def shortened(self, run: CommandedRun, time: float, counters: Counters) -> CommandedRun | None:
        """Return the run with its last step taken again up to a time inside it [s]; None if that is not to be had."""
        base, jump = run.previous, run.jump
        if base is None or not base.time < time:
            return None
        earlier = base.previous
        if earlier is not None and earlier.loads is run.loads and time - base.time < SHORT * run.row.h:
            # A step a little longer than the others instead of a very short one, for which kept factors are no use.
            base, jump = earlier, base.jump
        base = base.changed(row=StepRow(base.time, time - base.time, 1, time), index=0)
        prepared = self._prepared(base, counters)
        moved = None if prepared is None else self._steps(prepared, jump, 1, counters)
        return None if moved is None or moved.has_failed else moved.changed(previous=None)

    def _steps(self, run: CommandedRun, jump: np.ndarray, end: int, counters: Counters) -> CommandedRun:
        """Return the run after the steps before number `end`, with new factors where kept ones do not converge."""
        moved, reason = self._moved(run, jump, end, counters)
        if reason == kernel.SLOW:
            again = self._prepared(moved.changed(factors=None, has_failed=False), counters)
            if again is not None:
                moved, _ = self._moved(again, jump if moved.time == run.time else NO_JUMP, end, counters)
        return moved

    def _prepared(self, run: CommandedRun, counters: Counters) -> CommandedRun | None:
        """Return the run with factors that serve its row; None if there are none."""
        kept, rate_step = run.factors, 2.0 / 3.0 * run.row.h
        where = run.time, run.motion[0], run.motion[1], run.loads.held
        if (
            kept is not None
            and not 1.0 / RATE_STEP_RATIO <= run.length / (1.5 * kept.rate_step) <= RATE_STEP_RATIO
        ):
            # Steps of another length say nothing about these factors.
            run = run.changed(rates=FRESH_RATES)
        most = FARTHEST_RATIO if run.row.count <= FEW_STEPS else RATE_STEP_RATIO
        is_near = kept is not None and 1.0 / most <= rate_step / kept.rate_step <= most
        if kept is None or run.rates[1] > SLOW_RATE or not is_near:
            counters.factorisations += 1
            try:
                with self._one_thread():
                    kept = self._system.factor(*where, rate_step, corotated=True)
            except np.linalg.LinAlgError:
                return None
            run = run.changed(rates=FRESH_RATES)
        elif self._system.links_turned(kept, run.motion[0]):
            with self._one_thread():
                kept = self._system.turn(kept, *where, kept.rate_step)
        if kept is run.factors:
            return run
        n = 0 if self._system.columns is None else len(self._system.columns)
        tables = factor_tables(self._system, kept)
        return run.changed(factors=kept, tables=tables, rotations=np.zeros((2, n, 3, 3)), travelled=math.inf)

    def _moved(
        self, run: CommandedRun, jump: np.ndarray, end: int, counters: Counters
    ) -> tuple[CommandedRun, float]:
        row, force = run.row, self._force
        assert run.factors is not None and run.tables is not None and run.rotations is not None
        motion, vectors, rotations = run.motion.copy(), run.vectors.copy(), run.rotations.copy()
        scale = self._system.rescaling(run.factors, 2.0 / 3.0 * row.h)
        numbers = np.array(
            [
                row.begin,
                row.h,
                run.index,
                end,
                run.length,
                self._allowed,
                *run.rates,
                self._model.relaxation_time,
                PATIENCE,
                scale,
                self._turning,
                run.travelled,
            ]
        )
        results = np.empty(kernel.N_RESULTS)
        kernel.advance(
            force.tables,
            run.loads.drive,
            run.loads.steady,
            force.scratch,
            self._model.free,
            run.tables,
            self._weights,
            numbers,
            motion,
            vectors,
            jump,
            rotations,
            results,
        )
        done, iterations = int(results[kernel.DONE]), int(results[kernel.ITERATIONS])
        counters.steps += done
        counters.evaluations += iterations + done
        counters.solves += iterations + done + (2 if jump.size else 0)
        failed = bool(results[kernel.REASON])
        counters.rejected_steps += failed
        index = run.index + done
        moved = run.changed(
            time=row.time(index) if done else run.time,
            before=row.time(index - 1) if done else run.before,
            length=row.h if done else run.length,
            motion=motion,
            vectors=vectors,
            index=index,
            rotations=rotations,
            travelled=float(results[kernel.MOVED]),
            rates=(float(results[kernel.FIRST_SEEN]), float(results[kernel.LATER_SEEN])),
            distance=max(run.distance if run.index else 0.0, float(results[kernel.CARRIED])),
            has_failed=failed,
        )
        return moved, float(results[kernel.REASON])


def command_formula(
    model: Model, accuracy: float, one_thread: Callable[[], AbstractContextManager[None]]
) -> CommandFormula | None:
    """Return the formula for a model and an asked accuracy [m]; None where the one-step method has to serve.

    A loose sheet keeps errors of its momenta for good, and moving supports are no part of the compiled loop.
    """
    held = all(term.name == "clamp" for term in model.prescribing) and not model.is_unconstrained
    if not (held and model.relaxation_time < math.inf and is_covered(model)):
        return None
    try:
        return CommandFormula(model, accuracy, one_thread)
    except ValueError:
        return None
