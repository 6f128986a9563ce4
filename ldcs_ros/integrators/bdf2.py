"""BDF2 for held commands: one implicit stage a step, its prediction, iteration and error in one compiled function."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ldcs_ros.integrators.base import Step, StepFailure
from ldcs_ros.integrators.esdirk43 import Esdirk43
from ldcs_ros.integrators.implicit.block_tridiagonal import BlockTridiagonal
from ldcs_ros.integrators.implicit.stage_kernel import StageKernel
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.kernels.coverage import is_covered
from ldcs_ros.physics.kernels.total_force import TotalForce
from ldcs_ros.physics.model import Motion

# What the iteration may leave, as a fraction of the step's tolerance.
ITERATION_FRACTION = 0.05
# BDF2 is zero-stable up to 1 + sqrt(2) (Hairer, Norsett and Wanner, section III.5); this keeps a distance.
MAX_STEP_RATIO = 2.0
# Kept factors serve rate steps within this ratio of theirs.
RATE_STEP_RATIO = 1.35
# A contraction rate above this asks for new factors before the next step.
SLOW_RATE = 0.3
UNKNOWN_RATE = 0.3
NO_JUMP = np.zeros(0)


@dataclass(frozen=True)
class History:
    """The step before the present one.

    Attributes:
        step: That step; its start is the second last point of the formula.
        accelerations: Those of the formula at its start and its end, shape (2, n_free).
        inputs: Commands that were held during it.
        one_step: The one-step method took it.
    """

    step: Step
    accelerations: np.ndarray
    inputs: HeldCommands
    one_step: bool


class Bdf2(Esdirk43):
    """The two-step backward difference formula with variable steps.

    With h the step, w = h / (the step before), b = (1 + w) / (1 + 2 w) and c = w^2 / (1 + 2 w),

        u = u_n + c (u_n - u_(n-1)) + b h A,    q = q_n + c (q_n - q_(n-1)) + b h u,    M(q) A = f(t, q, u).

    Each interval between commands has its own constant torques and forces. The formula answers their jump J with
    b h R J, R = (1 - b h A)^-1, the motion with h phi_1(h A) J. (alpha R + beta R^2) J makes up for the difference,
    with alpha + beta = w / (1 + 2 w) and alpha + 2 beta = -1 / (2 b (1 + 2 w)). Valves are continuous and need none.
    The one-step method starts the formula, and takes steps without history or compiled force, or if an iteration fails.
    """

    name: ClassVar[str] = "bdf2"
    order: ClassVar[int] = 2
    error_order: ClassVar[int] = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        # Of the last steps that were tried; a rejected one leaves the one before it valid.
        self._histories: tuple[History, ...] = ()
        self._kept: Factors | None = None
        self._kept_rate = UNKNOWN_RATE
        self._moving = tuple(term for term in self.model.prescribing if term.name != "clamp")

    @cached_property
    def _kernel(self) -> StageKernel | None:
        """The compiled step; None for effects or a shape that it does not know."""
        if not is_covered(self.model):
            return None
        try:
            return StageKernel(self.model, TotalForce(self.model), LinearSystem(self.model, BlockTridiagonal))
        except ValueError:
            return None

    @property
    def memory(self) -> Any:
        return super().memory, self._histories, self._kept, self._kept_rate

    def recall(self, memory: Any) -> None:
        one_step, self._histories, self._kept, self._kept_rate = memory
        super().recall(one_step)

    def jump(self, motion: Motion, before: HeldCommands, after: HeldCommands) -> np.ndarray:
        past = self._past(motion)
        # The formula needs no acceleration at the start of a step, and the one-step method then makes it itself.
        if past is not None and not past.one_step:
            return np.zeros(len(self.model.free))
        return super().jump(motion, before, after)

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        try:
            return self.formula(motion, inputs, h, tolerance)
        except StepFailure:
            return self.one_step(motion, inputs, h, tolerance)

    def initial_error(self) -> None:
        """Return None: two-step steps have no stages whose factors could transport errors."""

    def one_step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        """Return the one-step method's step, which starts the formula."""
        past = self._past(motion)
        if past is not None and not past.one_step:
            # The formula's acceleration holds the correction of a jump.
            a = self.model.accelerate(motion.time, motion.q, motion.u, inputs)
            self.counters.evaluations += 1
            motion = Motion(motion.time, motion.q, motion.u, a, motion.lasting)
        step = super().step(motion, inputs, h, tolerance)
        start = motion.a if motion.lasting is None else motion.lasting
        self._remember(past, History(step, np.stack([start, step.right.a]), inputs, True))
        return step

    def formula(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        """Return the step of the two-step formula.

        Raises:
            StepFailure: It has no history or no compiled form, or its iteration does not converge.
        """
        past, kernel = self._past(motion), self._kernel
        if past is None or kernel is None:
            raise StepFailure("the two-step formula cannot start here", 1.0)
        left, time = past.step.left, motion.time + h
        ratio = h / (motion.time - left.time)
        steady = kernel.force.steady(inputs)
        if ratio > MAX_STEP_RATIO * (1.0 + 1e-6) or steady is None:
            raise StepFailure("the step grows too fast, or a held wrench turns with the sheet", 1.0)
        drive = kernel.force.drive(time, inputs)
        jump = self._force_jump(motion, past.inputs, inputs)
        if jump.size:
            jump = jump[self.model.free]
        accelerations = past.accelerations.copy()
        q, u, a = motion.q.copy(), motion.u.copy(), np.empty(len(self.model.free))
        for term in self._moving:
            term.prescribe(time, q, u)
        factors = self._present_factors(motion, inputs, (1.0 + ratio) / (1.0 + 2.0 * ratio) * h)
        iterations, rate, error = kernel.step(
            factors,
            drive,
            steady,
            left,
            accelerations,
            jump,
            h=h,
            ratio=ratio,
            tolerance=tolerance,
            allowed=ITERATION_FRACTION * tolerance,
            rate=self._kept_rate,
            iterations=self.patience,
            a=a,
            q=q,
            u=u,
        )
        self.counters.evaluations += abs(iterations)
        self.counters.solves += abs(iterations)
        if iterations <= 0:
            self._kept = None
            raise StepFailure(f"the iteration of a step at t = {motion.time:.9g} s does not converge")
        if iterations > 1:
            self._kept_rate = rate
        self.counters.steps += 1
        # Stiff parts leave the acceleration of a jump at once; the curve inside the step begins with what lasts.
        start = motion if motion.lasting is None else replace(motion, lasting=accelerations[1])
        step = Step(start, Motion(time, q, u, a), error)
        self._remember(past, History(step, np.stack([accelerations[1], a]), inputs, False))
        return step

    def _force_jump(self, motion: Motion, before: HeldCommands, after: HeldCommands) -> np.ndarray:
        """Return the jump of the force on all coordinates, shape (n_coordinates,), or (0,) if there is none."""
        if before is after:
            return NO_JUMP
        jump = self.model.force_jump(motion.time, motion.q, motion.u, before, after)
        return jump if jump.any() else NO_JUMP

    def _remember(self, past: History | None, new: History) -> None:
        self._histories = (new,) if past is None else (past, new)

    def _past(self, motion: Motion) -> History | None:
        for past in self._histories:
            if motion.q is past.step.right.q and motion.u is past.step.right.u:
                return past
        for past in self._histories:
            if past.step.left.time < motion.time < past.step.right.time:
                inside = past.step.at(motion.time, self.model)
                if np.array_equal(inside.q, motion.q) and np.array_equal(inside.u, motion.u):
                    return past
        return None

    def _present_factors(self, motion: Motion, inputs: HeldCommands, rate_step: float) -> Factors:
        """Return kept factors with the arms' border of now, or new ones."""
        assert self._kernel is not None
        system, kept = self._kernel.system, self._kept
        where = motion.time, motion.q, motion.u, inputs, rate_step
        if (
            kept is None
            or self._kept_rate > SLOW_RATE
            or not (1.0 / RATE_STEP_RATIO <= rate_step / kept.rate_step <= RATE_STEP_RATIO)
        ):
            self.counters.factorisations += 1
            try:
                kept = system.factor(*where, corotated=True)
            except np.linalg.LinAlgError as error:
                raise StepFailure(str(error)) from error
            self._kept_rate = UNKNOWN_RATE
        elif system.links_turned(kept, motion.q):
            kept = system.turn(kept, *where)
        self._kept = kept
        return kept
