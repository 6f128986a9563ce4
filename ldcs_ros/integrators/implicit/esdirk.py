"""The engine of the ESDIRK methods: stages by quasi-Newton iterations with kept factors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ldcs_ros.integrators.base import ErrorState, Integrator, Step, StepFailure
from ldcs_ros.integrators.implicit.broyden import WILD_RATE, BroydenUpdates, largest, place
from ldcs_ros.integrators.implicit.error_kernels import INNER, embedded_error
from ldcs_ros.integrators.implicit.error_outlook import ErrorOutlook
from ldcs_ros.integrators.implicit.error_transport import ErrorTransport
from ldcs_ros.integrators.implicit.predictor import StagePredictor
from ldcs_ros.integrators.implicit.system import Factors, LinearSystem
from ldcs_ros.integrators.tableaux import Tableau
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.kernels.coverage import is_covered
from ldcs_ros.physics.model import Motion

if TYPE_CHECKING:
    from ldcs_ros.integrators.implicit.dirk_kernel import DirkKernel

# An iteration stops when what is left of it is this share of the step's tolerance: its error then hides in
# the error estimate's own uncertainty.
ITERATION_SHARE = 0.02
# Above this contraction rate new factors cost less than the iterations that they save (measured on `arc`).
SLOW_RATE = 0.25
# Kept factors are used while the step is within this ratio of the one that they were made for.
STEP_RATIO = 1.35
# What an iteration leaves over must not lift a resting sheet off its contact: this fraction of the contact width.
ONSET_SHARE = 1e-3
# Factorings that a step may take: of its middle, and of a stage that does not converge with those.
MOST_FACTORISATIONS = 2
# An iteration that moves a node by more than this share of the spacing has turned the lattice noticeably.
TURNING_MOVE = 1e-3
# Iterations of Newton's method where kept factors have failed.
MOST_NEWTON = 15
# Contraction rate to expect of fresh factors, until one is measured.
FRESH_RATE = 0.1
# Until an iteration has measured it with these factors, no rate below this is relied on: a good first guess must not
# end it too soon. A rate measured in an earlier stage may have grown by this factor.
UNKNOWN_RATE = 0.4
RATE_SAFETY = 3.0
# Where in the step Newton's matrix is taken: half as far from its ends as its start is.
MIDDLE = 0.5
# An error h du in a rate counts as this share of it in a position: an oscillation's position error alone passes
# through zero twice a period.
RATE_SHARE = 0.25


@dataclass(frozen=True)
class Stage:
    """What a stage's equation is made of.

    Attributes:
        time: Its time [s].
        rate_step: h g [s].
        q_known: q* of the free coordinates.
        u_known: u* of the free coordinates.
        allowed: Displacement that may be left of the iteration [m].
    """

    time: float
    rate_step: float
    q_known: np.ndarray
    u_known: np.ndarray
    allowed: float


@dataclass(frozen=True)
class Stages:
    """The solved stages of a step.

    Attributes:
        trail: Accelerations before the step.
        accelerations: Of the start and each stage, shape (n_stages, n_free).
        rates: Of the free coordinates, same shape.
        q: Coordinates of the last stage.
        u: Their rates.
        factors: Those that each stage after the first was solved with.
        rate: The worst contraction rate, None if none was measured.
    """

    trail: StagePredictor
    accelerations: np.ndarray
    rates: np.ndarray
    q: np.ndarray
    u: np.ndarray
    factors: list[Factors]
    rate: float | None


class Dirk(Integrator):
    """q'' = M^-1 f as a first-order system in (q, q'), solved for the stage accelerations A_i.

    With h the step, g the tableau's diagonal and q*, u* what the stages before give,

        u_i = u* + h g A_i,     q_i = q* + h g u_i,     M(q_i) A_i - f(t_i, q_i, u_i) = 0.

    Newton's matrix is W = M - h g df/du - (h g)^2 df/dq. It is factored in the middle of a step, kept until the
    contraction rate or the step size says otherwise (Hairer and Wanner, Solving ODEs II, section IV.8), and turned
    with the sheet (`LinearSystem.turn`); Broyden's updates make up for what else has changed since. The last stage is
    the solution (stiffly accurate), its A the new acceleration. The error estimate is h sum d_i (u_i, A_i), the
    difference from the embedded solution.
    """

    tableau: ClassVar[Tableau]

    def __post_init__(self) -> None:
        super().__post_init__()
        self._system = LinearSystem(self.model)
        self._compiled: DirkKernel | None = None
        if self._system.is_banded and is_covered(self.model):
            from ldcs_ros.integrators.implicit.dirk_kernel import DirkKernel

            self._compiled = DirkKernel(self.model, self._system, self._reach)
        self._factors: Factors | None = None
        self._rate, self._measured = FRESH_RATE, False
        self._trails: tuple[StagePredictor, ...] = ()
        self._transport, self._outlook = (
            ErrorTransport(self._system, self._compiled),
            ErrorOutlook(self._system),
        )
        self._stage_factors: list[Factors] = []
        self._stage_accelerations = np.empty((0, len(self.model.free)))
        self.iteration_share = ITERATION_SHARE
        self._inner_stages = [int(np.argmin(np.abs(self.tableau.c[1:] - s))) for s in INNER]
        self._updates = BroydenUpdates(self._reach)
        self._turning_move = TURNING_MOVE * min(self.model.lattice.spacing)
        self._contact_width = min(term.contact_width for term in self.model.terms)

    @property
    def kernel(self) -> DirkKernel | None:
        """The compiled code that solves the stages; None where it does not know all effects of the model."""
        return self._compiled

    def call_effects_one_by_one(self) -> None:
        """Solve stages without compiled code for the whole of them, as scenes do that it does not cover."""
        self._compiled = None
        self._transport = ErrorTransport(self._system, None)

    @property
    def last_stages(self) -> tuple[np.ndarray, list[Factors]]:
        """Accelerations of the last step's stages, shape (n_stages, n_free), and factors of those after the first."""
        return self._stage_accelerations, self._stage_factors

    @property
    def memory(self) -> Any:
        kept = self._factors, self._rate, self._measured, self._trails
        return (*kept, self._updates.memory, self._outlook.memory)

    def recall(self, memory: Any) -> None:
        self._factors, self._rate, self._measured, self._trails, updates, outlook = memory
        self._updates.recall(updates)
        self._outlook.recall(outlook)

    def smooth_jump(self, motion: Motion, jump: np.ndarray) -> np.ndarray:
        # W^-1 M: stiff parts (light links against stiff couplings) have their acceleration for microseconds only;
        # a curve that began with it would carry it through all of the step.
        kept = self._factors
        return jump if kept is None else kept.solve(self.model.momentum(motion.q, jump))

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        try:
            return self._stages(motion, inputs, h, tolerance, exactly=False)
        except StepFailure:
            self._factors = None
            if self._contact_width == np.inf:
                raise
        return self._stages(motion, inputs, h, tolerance, exactly=True)

    def damping_rate(self, motion: Motion, inputs: HeldCommands) -> float:
        rate = None if self._compiled is None else self._compiled.damping_rate(motion, inputs)
        return super().damping_rate(motion, inputs) if rate is None else rate

    def initial_error(self) -> ErrorState | None:
        return self._transport.initial()

    def transport_error(self, step: Step, inputs: HeldCommands, error: ErrorState) -> tuple[Step, ErrorState]:
        first, second = (self._stage_factors[k] for k in self._inner_stages)
        last = self._stage_factors[-1]
        if not (first.frames is second.frames is last.frames):
            first = second = last  # of another factoring
        factors = last.turned(first.turns, 1.0), last.turned(second.turns, 1.0), last.turned(last.turns, 1.0)
        step, moved = self._transport.advance(step, inputs, error, factors, self.counters)
        h = step.right.time - step.left.time
        outlook = self._outlook.distance(h, step.right, inputs, moved, self.counters)
        return step, replace(moved, outlook=outlook)

    def _trail_to(self, motion: Motion) -> StagePredictor:
        """Return the trail that ends with a motion: that of the last step, of a rejected one's start, or a new one."""
        for trail in self._trails:
            if trail.points[-1][1] is motion.a:
                return trail
        if not self._trails:
            return StagePredictor(motion.time, ((motion.time, motion.a),))
        return self._trails[-1].jumped(motion.time, motion.a)

    def _present(self, motion: Motion, inputs: HeldCommands, h: float) -> tuple[Factors, bool]:
        """Return kept factors, or new ones of the middle of the step, and whether they are new."""
        kept, rate_step = self._factors, self.tableau.diagonal * h
        if kept is not None and self._rate <= SLOW_RATE:
            if 1 / STEP_RATIO <= rate_step / kept.rate_step <= STEP_RATIO:
                return kept, False
        free, ahead = self.model.free, MIDDLE * h
        q, u = motion.q.copy(), motion.u.copy()
        q[free] += ahead * (motion.u[free] + 0.5 * ahead * motion.a)
        u[free] += ahead * motion.a
        self.model.prescribe(motion.time + ahead, q, u)
        return self._renew(motion.time + ahead, q, u, inputs, rate_step), True

    def _renew(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, rate_step: float
    ) -> Factors:
        self.counters.factorisations += 1
        try:
            factors = self._system.factor(time, q, u, inputs, rate_step, corotated=True)
        except np.linalg.LinAlgError as error:
            raise StepFailure(str(error)) from error
        self._factors, self._rate, self._measured = factors, FRESH_RATE, False
        self._updates.clear()
        return factors

    def _stages(
        self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float, *, exactly: bool
    ) -> Step:
        allowed = min(self.iteration_share * tolerance, ONSET_SHARE * self._contact_width)
        stages = None if exactly else self._compiled_stages(motion, inputs, h, allowed)
        if stages is None:
            stages = self._iterated_stages(motion, inputs, h, allowed, exactly=exactly)
        accelerations, rates = stages.accelerations, stages.rates
        self._stage_factors, self._stage_accelerations = stages.factors, accelerations
        self._factors = None if exactly else stages.factors[-1]
        points = [
            (motion.time + c * h, a) for c, a in zip(self.tableau.c[1:], accelerations[1:], strict=True)
        ]
        self._trails = (stages.trail, stages.trail.extended(points))
        if stages.rate is not None:
            self._rate, self._measured = stages.rate, True
        defect, rate_defect = np.empty((2, len(self._reach)))
        error, rate_error = embedded_error(
            h, self.tableau.error_weights, rates, accelerations, self._reach, RATE_SHARE, defect, rate_defect
        )
        self.counters.steps += 1
        # The trail knows the motion that it leads to by its array.
        right = Motion(motion.time + h, stages.q, stages.u, points[-1][1])
        if error > tolerance and not exactly:
            filtered = self._filtered(right, inputs, defect, rate_defect, stages.factors[-1])
            error = min(error, self.largest_displacement(filtered))
        return Step(motion, right, error, self._drift(right, rate_defect), rate_error)

    def _iterated_stages(
        self, motion: Motion, inputs: HeldCommands, h: float, allowed: float, *, exactly: bool
    ) -> Stages:
        tableau, free = self.tableau, self.model.free
        n_stages, rate_step = len(tableau.c), tableau.diagonal * h
        rates, accelerations = np.empty((n_stages, len(free))), np.empty((n_stages, len(free)))
        q0, rates[0], accelerations[0] = motion.q[free], motion.u[free], motion.a
        trail = self._trail_to(motion)
        bend, offsets = trail.guesses(motion.time + h * tableau.c)
        q, u = motion.q.copy(), motion.u.copy()
        worst: float | None = None
        stage_factors: list[Factors] = []
        factors, fresh = (None, True) if exactly else self._present(motion, inputs, h)
        renewals = MOST_FACTORISATIONS - fresh
        for i in range(1, n_stages):
            time = motion.time + tableau.c[i] * h
            stage = Stage(
                time,
                rate_step,
                q0 + h * (tableau.a[i, :i] @ rates[:i]),
                rates[0] + h * (tableau.a[i, :i] @ accelerations[:i]),
                allowed,
            )
            guess = accelerations[i - 1] + offsets.get(i, 0.0)
            guess += bend[i] * (accelerations[i - 1] - accelerations[max(i - 2, 0)])
            self.model.prescribe(time, q, u)
            while True:
                place(free, stage.q_known, stage.u_known, guess, rate_step, q, u)
                rate: float | None
                if factors is None:
                    a, rate, used = self._solve_exactly(stage, guess, q, u, inputs)
                    break
                try:
                    a, rate, factors = self._solve(stage, guess, q, u, inputs, factors)
                    used = factors
                    break
                except StepFailure:
                    if not renewals:
                        raise
                renewals -= 1
                place(free, stage.q_known, stage.u_known, guess, rate_step, q, u)
                factors = self._renew(time, q, u, inputs, rate_step)
            if rate is not None:
                worst = rate if worst is None else max(worst, rate)
            rates[i], accelerations[i] = u[free], a
            stage_factors.append(used)
        return Stages(trail, accelerations, rates, q, u, stage_factors, worst)

    def _compiled_stages(
        self, motion: Motion, inputs: HeldCommands, h: float, allowed: float
    ) -> Stages | None:
        """Return the stages as `_iterated_stages` does, by one compiled function; None if it does not serve."""
        kernel = self._compiled
        steady = None if kernel is None else kernel.force.steady(inputs)
        if kernel is None or steady is None:
            return None
        # Kernels are loaded for the scenes that use them.
        from ldcs_ros.integrators.implicit.dirk_kernel import (
            BORDER_WANTED,
            DONE,
            NOT_FINITE,
            START,
            StageNumbers,
            solve_stages,
        )

        tableau, free = self.tableau, self.model.free
        n_stages, n_free, rate_step = len(tableau.c), len(free), tableau.diagonal * h
        times = motion.time + h * tableau.c
        rates, accelerations = np.empty((n_stages, n_free)), np.empty((n_stages, n_free))
        rates[0], accelerations[0] = motion.u[free], motion.a
        trail = self._trail_to(motion)
        bend, offsets = trail.guesses(times)
        offset = np.zeros((n_stages, n_free if offsets else 0))
        for i, value in offsets.items():
            offset[i] = value
        q, u = kernel.places(motion, times)
        drive = kernel.drives(times, inputs)
        factors, fresh = self._present(motion, inputs, h)
        renewals = MOST_FACTORISATIONS - fresh
        updates = self._updates
        known, change = np.empty((2, n_free)), np.empty(n_free)
        turns = np.empty((n_stages, 2, kernel.n_columns, 3, 3))
        bases: list[Factors] = []
        progress = START
        while True:
            numbers = StageNumbers(
                h,
                rate_step,
                allowed,
                self._expected_rate(factors, rate_step),
                self._system.rescaling(factors, rate_step),
                self._system.time_ahead(rate_step),
                self._turning_move,
                self.patience,
            )
            progress = solve_stages(
                progress._replace(updates=updates.count),
                numbers,
                kernel.sheet,
                kernel.tables(factors),
                tableau.a,
                drive,
                steady,
                bend,
                offset,
                updates.before,
                updates.after,
                updates.squares,
                q,
                u,
                rates,
                accelerations,
                known,
                change,
                turns,
            )
            self.counters.evaluations += progress.solves
            self.counters.solves += progress.solves
            updates.count = progress.updates
            bases += [factors] * (progress.stage - 1 - len(bases))
            if progress.status == DONE:
                break
            stage = progress.stage
            where = times[stage], q[stage], u[stage], inputs
            if progress.status == BORDER_WANTED:
                factors = self._system.renew_border(factors, *where, turns[stage])
            elif progress.status == NOT_FINITE:
                return None  # where springs lose their direction the effects themselves know more
            elif renewals:
                renewals -= 1
                factors = self._renew(*where, rate_step)
            else:
                raise StepFailure(
                    f"the iteration of a stage at t = {times[stage]:.9g} s does not converge (rate {progress.rate:.2g})"
                )
        turned = [
            base.turned(turns[i + 1], self._system.rescaling(base, rate_step)) for i, base in enumerate(bases)
        ]
        worst = progress.most if progress.most >= 0.0 else None
        return Stages(trail, accelerations, rates, q[-1].copy(), u[-1].copy(), turned, worst)

    def _drift(self, right: Motion, rate_defect: np.ndarray) -> float:
        """Return the speed that a loose sheet gets from what a step got wrong of its momenta [m/s]; 0 for a held one.

        Dampers between nodes forget all errors but that one: nothing takes it away again.
        """
        if not self.model.is_unconstrained:
            return 0.0
        momenta = self._outlook.momenta
        return momenta.speed(right.q, momenta.of_rates(right.q, rate_defect))

    def _filtered(
        self,
        right: Motion,
        inputs: HeldCommands,
        defect: np.ndarray,
        rate_defect: np.ndarray,
        factors: Factors,
    ) -> np.ndarray:
        """Return the positions of (1 - h g J)^-1 of an error estimate: without what damping takes away at once.

        After a jump the explicit first stage has put stiff parts into the estimate that the solution does not
        have (Shampine's filter; Hairer and Wanner, section IV.8). With C from a difference of forces,
        W x_q = (M - h g C) e_q + h g M e_u.
        """
        model, step = self.model, factors.rate_step
        scale = 1.0 / max(float(np.max(np.abs(defect))), 1e-300)
        pushed = right.u.copy()
        pushed[model.free] += scale * defect
        damping = model.force(right.time, right.q, pushed, inputs) - model.momentum(right.q, right.a)
        known = model.momentum(right.q, defect + step * rate_defect) - step / scale * damping
        self.counters.evaluations += 1
        self.counters.solves += 1
        return factors.solve(known)

    def _solve(
        self,
        stage: Stage,
        a: np.ndarray,
        q: np.ndarray,
        u: np.ndarray,
        inputs: HeldCommands,
        factors: Factors,
    ) -> tuple[np.ndarray, float | None, Factors]:
        """Iterate from a guess that is placed in q and u; return acceleration, worst rate if one was seen, factors."""
        free, model = self.model.free, self.model
        before, rate = np.inf, self._expected_rate(factors, stage.rate_step)
        worst, change, moved = 0.0, None, np.inf
        for iteration in range(self.patience):
            if moved > self._turning_move:
                factors = self._system.turn(factors, stage.time, q, u, inputs, stage.rate_step)
            residual = model.force(stage.time, q, u, inputs) - model.momentum(q, a)
            change = self._updates.step(factors.solve(residual), change)
            self.counters.evaluations += 1
            self.counters.solves += 1
            moved = stage.rate_step**2 * largest(change, self._reach)
            if not moved < np.inf:
                raise StepFailure(
                    f"the iteration of a stage at t = {stage.time:.9g} s left the finite numbers"
                )
            a = a + change
            place(free, stage.q_known, stage.u_known, a, stage.rate_step, q, u)
            if iteration > 0:
                rate = moved / before if before > 0.0 else 0.0
                worst = max(worst, rate)
                if rate > WILD_RATE or (iteration > 4 and rate > 0.95):
                    break
            if moved == 0.0 or (rate < 1.0 and moved * rate / (1.0 - rate) <= stage.allowed):
                return a, worst if iteration > 0 else None, factors
            before = moved
        raise StepFailure(
            f"the iteration of a stage at t = {stage.time:.9g} s does not converge (rate {rate:.2g})"
        )

    def _expected_rate(self, factors: Factors, rate_step: float) -> float:
        # Until two iterations have measured it: the last rate, and what the step's change since factoring does.
        mismatch = abs(1.0 - (rate_step / factors.rate_step) ** 2)
        known = max(RATE_SAFETY * self._rate, FRESH_RATE) if self._measured else UNKNOWN_RATE
        return min(max(known, mismatch), 0.9)

    def _solve_exactly(
        self, stage: Stage, a: np.ndarray, q: np.ndarray, u: np.ndarray, inputs: HeldCommands
    ) -> tuple[np.ndarray, float, Factors]:
        """Iterate by Newton's method with a new matrix each time, as `_solve`; for forces whose slope jumps."""
        free, model = self.model.free, self.model
        moved = np.inf
        for _ in range(MOST_NEWTON):
            residual = model.force(stage.time, q, u, inputs) - model.momentum(q, a)
            try:
                where = stage.time, q, u, inputs, stage.rate_step
                factors = self._system.turn(self._system.factor(*where, corotated=True), *where)
            except np.linalg.LinAlgError as error:
                raise StepFailure(str(error)) from error
            change = factors.solve(residual)
            self.counters.evaluations += 1
            self.counters.factorisations += 1
            self.counters.solves += 1
            before, moved = moved, stage.rate_step**2 * largest(change, self._reach)
            if not moved < np.inf:
                break
            a = a + change
            place(free, stage.q_known, stage.u_known, a, stage.rate_step, q, u)
            if moved <= stage.allowed and moved < before:
                return a, FRESH_RATE, factors
        raise StepFailure(f"Newton's iteration of a stage at t = {stage.time:.9g} s does not converge")
