"""Steps under commands at a rate: the two-step formula between commands, the one-step method for all else."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.integrators.base import ErrorState, Integrator, Step
from ldcs_ros.integrators.control import TRANSPORT_FACTOR, AdaptiveSteps, Pace
from ldcs_ros.integrators.implicit.command_run import NO_JUMP, CommandedRun, StepRow
from ldcs_ros.physics.inputs import NO_INPUTS, HeldCommands
from ldcs_ros.physics.model import Motion
from ldcs_ros.schema.units import TIME_TOLERANCE

if TYPE_CHECKING:
    # Loaded when commands come at a rate: the compiled force knows effects that a scene may not name.
    from ldcs_ros.integrators.implicit.command_formula import CommandFormula

# Commands come at a rate if the last two intervals between them are no longer [s], and no shorter than any step.
LONGEST_INTERVAL = 0.03
# The formula goes on for as long after the last command [s]; then the motion is smooth, and long steps are cheaper.
LONGEST_WAIT = 0.06
# Commands are regular if two intervals between them differ by less than this share.
REGULAR = 0.01
# Without a known end, steps are taken in rows of so many.
ROW = 8
# The first step at 1e-5 m asked [s], and the bounds of all.
FIRST_STEP = 1e-3
SHORTEST_STEP, LONGEST_STEP = 2e-5, 2.5e-3
# The carried error, times TRANSPORT_FACTOR, may reach this fraction of the asked accuracy.
BUDGET = 0.7
# A step length stays for so long [s]; for less where the error grows above what it may reach.
DWELL, SHORT_DWELL = 0.02, 0.005
# A growth of the error is taken to go on for so long [s].
AHEAD = 0.05
# Steps become longer by this factor where the error does not grow and is below this fraction of what it may be.
GROWTH, CALM = 1.4, 0.6
LEAST_GROWTH, LEAST_CHANGE = 0.5, 1.2
# Velocities that are wrong already let the error grow whatever steps do: by this fraction of what it may reach.
LEAST_ROOM = 0.3
# BDF2 is zero-stable up to 1 + sqrt(2) (Hairer, Norsett and Wanner, section III.5); this keeps a distance.
MOST_RATIO = 2.0
# After a failure the one-step method serves for so many commands.
PAUSE = 2
# A step costs less than an evaluation of the one-step method with all that belongs to it. If it does not pay, that
# method serves for so many commands.
MOST_STEPS, LONG_PAUSE = 1.0, 50


@dataclass(frozen=True)
class CommandPace(Pace):
    """A pace that knows of commands at a rate.

    Attributes:
        run: The formula's present state; None while the one-step method serves.
        last: The one-step method's last step.
        held: Commands during it.
        pause: Commands until the formula is tried again.
        count: Evaluations so far at the last command; -1 before the first.
        cost: Evaluations of the one-step method between the last two commands that it served; 0 before there were any.
        interval: Time between the last two commands [s].
        is_regular: The one before that was as long.
    """

    run: CommandedRun | None = None
    last: Step | None = None
    held: HeldCommands = NO_INPUTS
    pause: int = 0
    count: int = -1
    cost: int = 0
    interval: float = math.inf
    is_regular: bool = False


def _changed(pace: CommandPace, **values: object) -> CommandPace:
    # As `CommandedRun.changed`.
    other = object.__new__(CommandPace)
    other.__dict__.update(pace.__dict__, **values)
    return other


def _is_rate(interval: float) -> bool:
    return SHORTEST_STEP <= interval <= LONGEST_INTERVAL


class CommandSteps(AdaptiveSteps):
    """Adaptive steps that change to the two-step formula while commands come at a rate.

    The one-step method takes the first steps and hands over its last one as history. It takes over again at contact
    that begins or ends, where an iteration fails, and when no command has come for a while.
    """

    def __init__(
        self,
        integrator: Integrator,
        accuracy: float,
        one_thread: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        """Args: integrator: the one-step method; accuracy: asked [m]; one_thread: context of what uses BLAS."""
        super().__init__(integrator, accuracy)
        self._one_thread = one_thread
        self._target = BUDGET * accuracy / TRANSPORT_FACTOR

    @cached_property
    def _formula(self) -> CommandFormula | None:
        """The compiled formula; None for effects or a shape that it does not know."""
        from ldcs_ros.integrators.implicit.command_formula import command_formula

        return command_formula(self.integrator.model, self.accuracy, self._one_thread)

    def answers_jumps(self, pace: Pace) -> bool:
        """Return whether the next step finds the jumps of commands by itself."""
        return isinstance(pace, CommandPace) and pace.run is not None

    def advance(
        self,
        motion: Motion,
        inputs: HeldCommands,
        pace: Pace,
        stop: float,
        *,
        opening: bool,
        until: float = math.inf,
        expected: float = math.inf,
    ) -> tuple[Step, Pace]:
        known = pace if isinstance(pace, CommandPace) else CommandPace(**vars(pace))
        pause, run = max(known.pause - opening, 0), known.run
        interval, is_regular = known.interval, known.is_regular
        if opening:
            interval = expected - motion.time
            is_regular = interval < math.inf and abs(interval - known.interval) <= REGULAR * interval
            evaluations = self.integrator.counters.evaluations
            cost = evaluations - known.count if run is None and known.count >= 0 else known.cost
            known = _changed(known, count=evaluations, cost=cost)
            if run is not None and not self._pays(run.h, interval, known.cost):
                run, pause = None, LONG_PAUSE
        if run is not None and run.has_failed:
            run, pause = None, PAUSE
        elif run is None and opening and pause == 0 and _is_rate(interval) and _is_rate(known.interval):
            run = self._entered(motion, known, interval)
        if run is not None:
            barrier = min(stop, expected) if is_regular else stop
            run = self._taken(run, motion, inputs, barrier, until, opening=opening)
            if run is not None and run.time > motion.time:
                return run.step, self._paced(known, run, interval, is_regular=is_regular)
            pause = PAUSE
        with self._one_thread():
            if known.run is not None:
                motion = self._restarted(motion, inputs)
            step, after = super().advance(
                motion, inputs, known, stop, opening=opening, until=until, expected=expected
            )
        shared = {name: value for name, value in vars(after).items() if name in Pace.__dataclass_fields__}
        return step, CommandPace(
            **shared,
            last=step,
            held=inputs,
            pause=pause,
            count=known.count,
            cost=known.cost,
            interval=interval,
            is_regular=is_regular,
        )

    def _pays(self, h: float, interval: float, cost: int) -> bool:
        """Return whether steps of a length [s] cost less than the one-step method between two commands."""
        return interval <= MOST_STEPS * cost * h

    def _paced(
        self, known: CommandPace, run: CommandedRun, interval: float, *, is_regular: bool
    ) -> CommandPace:
        carried = ErrorState(run.vectors[2], run.vectors[3], run.distance, run.distance)
        return _changed(
            known,
            errors=(carried,),
            inside=0.0,
            run=run,
            last=None,
            pause=0,
            interval=interval,
            is_regular=is_regular,
        )

    def _restarted(self, motion: Motion, inputs: HeldCommands) -> Motion:
        """Return a motion of the formula with the accelerations that the one-step method begins with."""
        start = self.integrator.start(motion.time, motion.q, motion.u, inputs)
        lasting = motion.a + self.integrator.smooth_jump(motion, start.a - motion.a)
        return replace(start, lasting=lasting)

    def _entered(self, motion: Motion, pace: CommandPace, interval: float) -> CommandedRun | None:
        """Return a run that goes on from the one-step method's last step, or None if that does not lead here."""
        last, formula = pace.last, self._formula
        h = min(max(FIRST_STEP * math.sqrt(self.accuracy / 1e-5), SHORTEST_STEP), LONGEST_STEP)
        if formula is None or last is None or not self._pays(h, interval, pace.cost):
            return None
        if not last.left.time < motion.time <= last.right.time + TIME_TOLERANCE:
            return None
        loads = formula.loads(pace.held)
        if loads is None:
            return None
        left, inside = last.left, last.at(motion.time, self.integrator.model)
        first = left.a if left.lasting is None else left.lasting
        error = pace.errors[-1] if pace.errors else ErrorState(0.0 * inside.a, 0.0 * inside.a)
        return CommandedRun(
            motion.time,
            left.time,
            motion.time - left.time,
            np.stack([motion.q, motion.u, left.q, left.u]),
            np.stack([first, inside.a, error.q, error.u, error.q, error.u]),
            loads,
            motion.time,
            h,
            motion.time,
            error.distance,
            StepRow(motion.time, h, 0, motion.time),
        )

    def _taken(
        self,
        run: CommandedRun,
        motion: Motion,
        inputs: HeldCommands,
        stop: float,
        until: float,
        *,
        opening: bool,
    ) -> CommandedRun | None:
        """Return the run after all steps up to a time, or up to a failure; None if the commands are not for it."""
        formula = self._formula
        assert formula is not None
        if motion.time < run.time - TIME_TOLERANCE:
            cut = formula.shortened(run, motion.time, self.integrator.counters)
            if cut is None:
                return None
            run = cut
        loads, jump = run.loads, NO_JUMP
        if loads.held is not inputs:
            after = formula.loads(inputs)
            if after is None:
                return None
            jump, loads = formula.jump(run.time, loads, after), after
            run = run.changed(loads=loads, row=StepRow(run.time, run.h, 0, run.time), index=0)
        if opening:
            run = run.changed(commanded=run.time)
        if run.has_failed:
            return None
        until = min(until, stop)
        while run.time < until - TIME_TOLERANCE:
            if run.index >= run.row.count:
                if run.time - run.commanded > LONGEST_WAIT or run.h < SHORTEST_STEP:
                    return run.changed(has_failed=True)
                run = self._controlled(run)
                run = run.changed(row=self._row(run, stop), index=0)
            begin = run.time
            run = formula.advance(run, jump, until, self.integrator.counters)
            if run.has_failed:
                return run
            if run.time > begin:
                jump = NO_JUMP
        return run

    def _row(self, run: CommandedRun, stop: float) -> StepRow:
        """Return the next row of steps: all of one length, as long as the history and the error allow."""
        most = min(run.h, MOST_RATIO * run.length)
        left = stop - run.time
        if left == math.inf:
            count = ROW if most == run.h else 1
            return StepRow(run.time, most, count, run.time + count * most, is_open=True)
        count = math.ceil(left / most * (1.0 - 1e-3))
        if most < run.h and count > 1:
            # The history is short: the next step may be longer than this one.
            most = min(most, 0.5 * left)
            return StepRow(run.time, most, 1, run.time + most, is_open=True)
        return StepRow(run.time, left / count, count, stop)

    def _controlled(self, run: CommandedRun) -> CommandedRun:
        """Return the run with the length of steps that the carried error asks for.

        The error grows with the square of the steps, and what lasts of it is its level: steps follow its growth.
        """
        elapsed, growth = run.time - run.since, run.distance - run.level
        factor = GROWTH if run.distance < CALM * self._target else 1.0
        is_too_large = growth > 0.0 and run.distance > self._target
        if elapsed < (SHORT_DWELL if is_too_large else DWELL) - TIME_TOLERANCE:
            return run
        if growth > 0.0:
            room = max(self._target - run.distance, LEAST_ROOM * self._target)
            factor = min(max(math.sqrt(room * elapsed / (growth * AHEAD)), LEAST_GROWTH), factor)
        if factor >= LEAST_CHANGE or factor * LEAST_CHANGE <= 1.0:
            run = run.changed(h=min(factor * run.h, LONGEST_STEP))
        return run.changed(since=run.time, level=run.distance)
