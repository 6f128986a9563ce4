"""The contract of an integrator, as a numbered list.

1. An integrator is made for one model: `Method(model)`; it keeps nothing of the motion but what makes the next
   step cheaper (factors), and that is part of `memory`, so a run can go on to the bit.
2. `step(motion, inputs, h, tolerance)` is pure: it returns a new `Step`, or raises `StepFailure` and the motion
   stays whole.
3. `motion.a` are the accelerations at the motion; `start` makes them, and after a change of inputs the run adds
   the jump (`smooth_jump` says how much of it lasts).
4. A `Step` carries its error estimate [m], the largest over all nodes, and can be evaluated anywhere inside (`at`),
   as accurately as at its end, so that sensors and commands do not shorten steps.
5. `order` is the order of the error in h, `error_order` that of the estimate of one step's error; a test measures
   the order of every entry of `INTEGRATORS`.
6. A method with an `initial_error` moves the error of the whole run over each step that is kept (`transport_error`).
7. `stability_limit(motion)` is the largest stable step [s], infinite for an L-stable method; a fixed step above it
   is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model, Motion


class StepFailure(Exception):
    """A step could not be taken at this size; `remedy` is a factor by which to shorten it."""

    def __init__(self, reason: str, remedy: float = 0.5) -> None:
        super().__init__(reason)
        self.remedy = remedy


@dataclass
class Counters:
    """What a run has cost so far."""

    steps: int = 0
    rejected_steps: int = 0
    evaluations: int = 0
    factorisations: int = 0
    solves: int = 0


@compiled
def _bend(free, h, q0, u0, a0, q1, u1, a1, result):  # type: ignore[no-untyped-def]
    # The coefficient of s^5 as in `Step._quintic`, in one pass: every step asks for it.
    for i in range(free.size):
        k = free[i]
        r0, r1, b0, b1 = h * u0[k], h * u1[k], h * h * a0[i], h * h * a1[i]
        gap = q1[k] - q0[k] - r0 - 0.5 * b0
        result[i] = 6.0 * gap - 3.0 * (r1 - r0 - b0) + 0.5 * (b1 - b0)


@dataclass(frozen=True)
class ErrorState:
    """The estimated difference of the true motion from the computed one.

    Attributes:
        q: Of the free coordinates [m, rad], shape (n_free,).
        u: Of their rates, same shape.
        distance: Of the worst node, at this time or inside the step that led here [m].
        outlook: Distance that it will reach at the worst node as its velocities act [m].
        speed: Of the worst node, at this time or inside the step that led here [m/s].
    """

    q: np.ndarray
    u: np.ndarray
    distance: float = 0.0
    outlook: float = 0.0
    speed: float = 0.0

    def toward(self, end: ErrorState, h: float, s: float) -> ErrorState:
        """Return the error at the fraction s of the step of length h [s] that leads to `end`."""
        q = (1.0 - s) ** 2 * ((1.0 + 2.0 * s) * self.q + s * h * self.u)
        q += s**2 * ((3.0 - 2.0 * s) * end.q - (1.0 - s) * h * end.u)
        return ErrorState(q, (1.0 - s) * self.u + s * end.u, end.distance, end.outlook, end.speed)


@dataclass(frozen=True)
class Step:
    """One accepted step and its continuous extension.

    Attributes:
        left: Motion at its start.
        right: Motion at its end.
        error: Estimated error that this step made in the position of the worst node [m].
        drift: Speed that a loose sheet has from what the step got wrong of its momenta [m/s].
        rate_error: Estimated error that this step made in the velocity of the worst node [m/s].
    """

    left: Motion
    right: Motion
    error: float
    drift: float = 0.0
    rate_error: float = 0.0

    def at(self, time: float, model: Model) -> Motion:
        """Return the motion inside the step: the quintic through position, rate and acceleration at both ends."""
        if time >= self.right.time:
            return self.right
        if time <= self.left.time:
            return self.left
        h = self.right.time - self.left.time
        s = (time - self.left.time) / h
        q0, u0, a0, c3, c4, c5 = self._quintic(model)
        q, u = self.left.q.copy(), self.left.u.copy()
        q[model.free] = q0 + s * (u0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
        u[model.free] = (u0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h
        a = (a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h)
        model.prescribe(time, q, u)
        return Motion(time, q, u, a)

    def bend(self, model: Model) -> np.ndarray:
        """Return the quintic's last coefficient [m], shape (n_free,): how much of it a coarser curve would miss."""
        start, end = self.left, self.right
        first = start.a if start.lasting is None else start.lasting
        result = np.empty(len(model.free))
        _bend(model.free, end.time - start.time, start.q, start.u, first, end.q, end.u, end.a, result)
        return result

    def _quintic(self, model: Model) -> tuple[np.ndarray, ...]:
        # q(s) = q0 + u0 s + a0 s^2 / 2 + c3 s^3 + c4 s^4 + c5 s^5 for s from 0 to 1.
        h = self.right.time - self.left.time
        q0, q1 = self.left.q[model.free], self.right.q[model.free]
        u0, u1 = h * self.left.u[model.free], h * self.right.u[model.free]
        start = self.left.a if self.left.lasting is None else self.left.lasting
        a0, a1 = h * h * start, h * h * self.right.a
        gap, rate, acceleration = q1 - q0 - u0 - 0.5 * a0, u1 - u0 - a0, a1 - a0
        c3 = 10.0 * gap - 4.0 * rate + 0.5 * acceleration
        c4 = -15.0 * gap + 7.0 * rate - acceleration
        return q0, u0, a0, c3, c4, 6.0 * gap - 3.0 * rate + 0.5 * acceleration


@dataclass
class Integrator:
    """Base of all methods.

    Attributes:
        model: What is integrated.
        counters: What it has cost.
        fixed_step: A step is one step of the method; otherwise an explicit method may divide it into stable parts.
    """

    model: Model
    counters: Counters = field(default_factory=Counters)
    fixed_step: bool = False
    name: ClassVar[str] = ""
    order: ClassVar[int] = 0
    error_order: ClassVar[int] = 0
    # An implicit step that fails has an iteration that does not converge: halves of it are an answer. An explicit
    # one has met its stability limit: to divide it would hide that.
    implicit: ClassVar[bool] = True

    def __post_init__(self) -> None:
        self._reach = np.ones(len(self.model.free))
        self._reach[self.model.n_free_nodes :] = self.model.lattice.size[0]
        # Iterations that an implicit step may take; more than this, and a shorter step is cheaper.
        self.patience = 10

    def start(self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands) -> Motion:
        """Return the motion at all coordinates q and rates u, shape (n_coordinates,), with its accelerations."""
        self.counters.evaluations += 1
        return Motion(time, q, u, self.model.accelerate(time, q, u, inputs))

    def step(self, motion: Motion, inputs: HeldCommands, h: float, tolerance: float) -> Step:
        """Return the step of length h [s] from a motion.

        Args:
            motion: Where it starts.
            inputs: What is commanded during it.
            h: Its length [s].
            tolerance: Error in a node's position that it may make [m]; iterations stop well below it.

        Raises:
            StepFailure: It cannot be taken at this size.
        """
        raise NotImplementedError

    def damping_rate(self, motion: Motion, inputs: HeldCommands) -> float:
        """Return the rate at which a motion's amplitude decays [1/s]; see `Model.damping_rate`."""
        return self.model.damping_rate(motion, inputs)

    def initial_error(self) -> ErrorState | None:
        """Return the error of a given start, none, or None if the method transports no errors."""
        return None

    def transport_error(self, step: Step, inputs: HeldCommands, error: ErrorState) -> tuple[Step, ErrorState]:
        """Return the step that was taken last, corrected by what it shows, and the error at its end from that before.

        The correction is far below the step's tolerance: the momenta of a sheet that nothing holds.
        """
        raise NotImplementedError

    def jump(self, motion: Motion, before: HeldCommands, after: HeldCommands) -> np.ndarray:
        """Return the jump in acceleration [m/s^2] at a motion where commands change, shape (n_free,)."""
        return self.model.command_jump(motion.time, motion.q, motion.u, before, after)

    def smooth_jump(self, motion: Motion, jump: np.ndarray) -> np.ndarray:
        """Return the part of a jump in acceleration that lasts through the next step, shape (n_free,); here all."""
        return jump

    def largest_displacement(self, q: np.ndarray) -> float:
        """Return the largest displacement [m] in q, shape (n_free,); an angle counts as its arm's tip."""
        return float(np.max(np.abs(q) * self._reach, initial=0.0))

    def fastest(self, motion: Motion) -> str:
        """Return the name of the node or link that accelerates most, or whose acceleration is not finite."""
        push = np.nan_to_num(np.abs(motion.a) * self._reach, nan=np.inf, posinf=np.inf)
        return self.model.coordinate_name(int(self.model.free[np.argmax(push)]))

    def stability_limit(self, motion: Motion, inputs: HeldCommands) -> float:
        """Return the largest stable step [s] near a motion."""
        return float("inf")

    @property
    def memory(self) -> Any:
        """What the next step depends on beside the motion; hand it to `recall` to go on to the bit."""
        return None

    def recall(self, memory: Any) -> None:
        """Take back a `memory`."""
