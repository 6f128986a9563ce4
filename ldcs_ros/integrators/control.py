"""Step control: adaptive steps within an asked accuracy, or fixed steps; neither lets a failed step out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.integrators.base import ErrorState, Integrator, Step, StepFailure
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion

SMALLEST_STEP = 1e-9  # s; below it a simulation does not end
LARGEST_STEP = 1.0  # s
SAFETY = 0.9
MOST_GROWTH = 4.0
# Steps that differ by less than this share are the same.
SAME_STEP = 1e-3
# A step may be as much longer than the controller's safety makes it, if it ends at a stop.
STRETCH = 0.87
# A step that would grow by less stays as it is, so that factors are kept.
LEAST_GROWTH = 1.2
# After a step that did not converge, longer ones are tried again little by little.
CEILING_SHARE = 0.7
CEILING_GROWTH = 1.3
# After a corner in drives the smooth step before says little about the one after it.
CORNER_SHARE = 0.25
# All errors that the motion remembers may add up to this fraction of what is asked by the methods' own estimates,
# which are low by a factor of up to ESTIMATE_FACTOR (measured on all shipped scenes from 1e-3 to 1e-7 m).
LOCAL_SHARE = 0.2
ESTIMATE_FACTOR = 10.0
# The outlook of a transported error may reach this fraction of the asked accuracy; one step may use this fraction of
# what is left. With less than LEAST_ROOM left steps shorten no further: what makes errors grow then is the motion.
BUDGET = 0.8
STEP_FRACTION = 0.5
LEAST_ROOM = 0.1
# A shorter step must reduce what it adds to the outlook by this factor; else the error grows by itself.
LEAST_GAIN = 2.0
# A transported error is at least 0.3 of the real one in 99 % of the runs of `ldcs study --accuracy`.
TRANSPORT_FACTOR = 2.5
# Commands at a rate keep steps so short that errors are small beside the asked accuracy, and a transport would double
# the cost: below this share of it they are added up instead, when a command is due within this time [s].
MINOR_SHARE = 2e-3
COMMAND_INTERVAL = 0.02
# Inside a step the quintic is off by about this share of its last coefficient, twice over (measured on `arc` and
# `single_spring`); such an error does not add up.
BEND_SHARE = 1.0 / 8.0
# A loose sheet goes on with wrong momenta, where nothing puts them right, for at least and at most this long [s].
COASTING = 2.0, 20.0
# A motion without damping is taken to be followed for this long [s].
HORIZON = 10.0
# Steps of a fixed length have no accuracy to iterate to: their stages are solved to this [m].
FIXED_STEP_TOLERANCE = 1e-8
# A fixed step that fails is taken in parts, down to this share of it.
LEAST_PART = 2.0**-10


@dataclass(frozen=True)
class Pace:
    """What the controller remembers between steps.

    Attributes:
        h: Step that it wants to take next [s].
        ceiling: Largest step to try, since a longer one did not converge lately [s].
        error: What is remembered of the errors of steps without transport, by the method's own estimates [m].
        inside: Estimated error of the curve inside the last step, if that was one of them [m].
        speed: Estimated error of the velocities of that step [m/s].
        opening: Step to take right after a command: what the last such step recommends [s].
        errors: The transported error, and before it that at the start of the last step if it was transported over it;
            empty if the method has none.
    """

    h: float
    ceiling: float = math.inf
    error: float = 0.0
    inside: float = 0.0
    speed: float = 0.0
    opening: float = math.inf
    errors: tuple[ErrorState, ...] = ()

    @property
    def estimate(self) -> float:
        """Estimated error of the worst node's position now [m]."""
        transported = TRANSPORT_FACTOR * self.errors[-1].distance if self.errors else 0.0
        return transported + ESTIMATE_FACTOR * self.error + self.inside

    @property
    def velocity_estimate(self) -> float:
        """Estimated error of the worst node's velocity now [m/s]."""
        transported = TRANSPORT_FACTOR * self.errors[-1].speed if self.errors else 0.0
        return transported + ESTIMATE_FACTOR * self.speed

    def left_at(self, step: Step, time: float) -> Pace:
        """Return the pace for a motion that leaves the last step at a time [s] inside it."""
        h = step.right.time - step.left.time
        if len(self.errors) < 2 or not step.left.time <= time < step.right.time:
            return self
        inner = self.errors[0].toward(self.errors[-1], h, (time - step.left.time) / h)
        return replace(self, errors=(inner, inner))


class AdaptiveSteps:
    """Keeps the estimated error of all steps together below the asked accuracy.

    A damped motion forgets its errors at the rate at which it loses energy, lambda = dissipated power / (2 kinetic
    energy): some 100 1/s for the driven sheet, 4 1/s for a swinging one, 0 in free flight. The errors made during
    1 / lambda add up, so a step of length h may make the share min(1, lambda h) of them. The step size follows
    the error, h' = 0.9 h (tolerance / error)^(1/p) (Hairer and Wanner, Solving ODEs II, section IV.8), with a
    dead zone.

    lambda is a mean over all motion, and the methods' estimates miss what stiff or hardly damped modes do. So the
    transported error has the last word: tolerances shrink with what it leaves of its budget, and a step that would
    use too much of the rest is taken again, shorter.
    """

    def __init__(self, integrator: Integrator, accuracy: float) -> None:
        self.integrator, self.accuracy = integrator, accuracy
        self._power = 1.0 / integrator.error_order
        self._has_contact = min(term.contact_width for term in integrator.model.terms) < math.inf

    def first(self, motion: Motion) -> Pace:
        """Return the pace at a start: the step in which the acceleration moves something noticeably."""
        push = float(np.max(np.abs(motion.a), initial=0.0))
        h = min(0.01, math.sqrt(LOCAL_SHARE * self.accuracy / push)) if push > 0.0 else 0.01
        none = self.integrator.initial_error()
        return Pace(h, errors=() if none is None else (none,))

    def answers_jumps(self, pace: Pace) -> bool:
        """Return whether the next step finds the jumps of commands by itself."""
        return False

    def corner(self, pace: Pace) -> Pace:
        """Return the pace after a command or drive changed abruptly."""
        return replace(pace, h=CORNER_SHARE * pace.h, ceiling=math.inf)

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
        """Take one step that does not pass the time `stop` [s]; return it and the pace for the next.

        Args:
            motion: Where it starts.
            inputs: What is commanded.
            pace: What the control remembers.
            stop: Time not to be passed [s].
            opening: It follows a command: it begins as the last step after a command has shown to be right.
            until: Time that is asked for [s]; steps follow the motion, not this time.
            expected: Time of the next command, if commands go on as before [s].

        Raises:
            DivergenceError: No step above the smallest one can be taken.
        """
        stop = min(stop, expected)
        self.integrator.counters.evaluations += 1  # by the damping rate
        decay_rate = max(self.integrator.damping_rate(motion, inputs), 1.0 / HORIZON)
        h, rejected, ceiling = min(pace.h, pace.opening) if opening else pace.h, False, pace.ceiling
        room, added_before = self._room(pace.errors), math.inf
        while True:
            h, clipped = _fit(motion.time, h, stop, 1.0 if rejected else STRETCH)
            tolerance = room * LOCAL_SHARE * self.accuracy * min(1.0, decay_rate * h)
            try:
                step = _finite_step(self.integrator, motion, inputs, h, tolerance)
            except StepFailure as failure:
                self.integrator.counters.rejected_steps += 1
                if h * failure.remedy < SMALLEST_STEP:
                    raise self._stop(motion, str(failure)) from failure
                ceiling = CEILING_SHARE * h
                h, rejected = h * failure.remedy, True
                continue
            inside = BEND_SHARE * self.integrator.largest_displacement(step.bend(self.integrator.model))
            ratio = max(step.error / tolerance, inside / self.accuracy, 1e-6)
            if ratio <= 1.0:
                step, errors = self._transported(step, inputs, pace.errors[-1:], stop)
                coasted = self._coasted(step, is_transported=len(errors) > 1)
                ratio = max(ratio, coasted / (room * LOCAL_SHARE * self.accuracy))
                added = errors[1].outlook - errors[0].outlook if len(errors) > 1 else 0.0
                allowed = room * STEP_FRACTION * BUDGET * self.accuracy
                is_hopeless = room <= LEAST_ROOM or LEAST_GAIN * added > added_before
                is_small = added <= allowed or is_hopeless or h < 10.0 * SMALLEST_STEP
                if is_small and ratio <= 1.0:
                    break
                ratio, added_before = max(ratio, added / allowed), added
            self.integrator.counters.rejected_steps += 1
            self.integrator.counters.steps -= 1
            h, rejected = h * max(0.1, SAFETY * ratio**-self._power), True
            if h < SMALLEST_STEP:
                raise self._stop(motion, f"the estimated error stays {ratio:.2g} times what a step may make")
        grown = h * min(MOST_GROWTH, SAFETY * ratio**-self._power)
        if rejected:
            grown = min(grown, h)
        elif h <= grown < LEAST_GROWTH * h:
            grown = h
        if clipped and not rejected:
            # A clipped step tells about its own length only; the pace before it stands if it was longer.
            grown = max(grown, pace.h)
        error = pace.error * math.exp(-decay_rate * h)
        first = grown if opening else pace.opening
        step = _landed(step, stop) if clipped else step
        if len(errors) > 1:
            inside = speed = 0.0
        else:
            speed = step.rate_error
            error += step.error + COASTING[0] * step.drift
        h = min(grown, ceiling, LARGEST_STEP)
        return step, Pace(h, ceiling * CEILING_GROWTH, error, inside, speed, first, errors)

    def _room(self, errors: tuple[ErrorState, ...]) -> float:
        """Return the fraction of the budget that the outlook of a transported error leaves, at least LEAST_ROOM."""
        used = errors[-1].outlook / (BUDGET * self.accuracy) if errors else 0.0
        return max(1.0 - used, LEAST_ROOM)

    def _coasted(self, step: Step, *, is_transported: bool) -> float:
        """Return the distance [m] that a step adds to where a loose sheet coasts with errors of its momenta.

        Impacts are short: their errors are no rate per second, and count as they are. Those of smooth steps add up
        over the time that the sheet coasts, which is taken to be as long again as the run has lasted. A transported
        error holds their common part: what is left adds up as the root of the number of steps.
        """
        if self._has_contact:
            return COASTING[0] * step.drift
        h, (least, most) = step.right.time - step.left.time, COASTING
        if is_transported:
            return least * math.sqrt(max(least / h, 1.0)) * step.drift
        time = min(max(step.right.time, least), most)
        return time * max(time / h, 1.0) * step.drift

    def _transported(
        self, step: Step, inputs: HeldCommands, errors: tuple[ErrorState, ...], stop: float
    ) -> tuple[Step, tuple[ErrorState, ...]]:
        """Return a step with the error before and after it; without the latter if it is minor or there is none."""
        is_minor = stop - step.left.time < COMMAND_INTERVAL and step.error < MINOR_SHARE * self.accuracy
        if not errors or is_minor:
            return step, errors
        step, after = self.integrator.transport_error(step, inputs, errors[0])
        return step, (*errors, after)

    def _stop(self, motion: Motion, reason: str) -> DivergenceError:
        return DivergenceError(
            f"the simulation stopped at t = {motion.time:.9g} s: no step above {SMALLEST_STEP:g} s can be taken with "
            f"{self.integrator.name}: {reason}; {self.integrator.fastest(motion)} accelerates most; check the "
            f"stiffness, masses and loads there, or ask for less accuracy than {self.accuracy:g} m"
        )


class FixedSteps:
    """Steps of one length; the last before a stop is shortened to it."""

    def __init__(self, integrator: Integrator, h: float) -> None:
        self.integrator, self.h = integrator, h
        integrator.fixed_step = True

    def first(self, motion: Motion) -> Pace:
        """Return the pace at a start."""
        return Pace(self.h)

    def answers_jumps(self, pace: Pace) -> bool:
        """Return whether the next step finds the jumps of commands by itself."""
        return False

    def corner(self, pace: Pace) -> Pace:
        """Return the pace after a command or drive changed abruptly: the same."""
        return pace

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
        """Take one step that does not pass `stop`; raises DivergenceError if it cannot be taken.

        A step whose iteration does not converge is counted as rejected and taken in parts: still an answer. The
        pace then asks for what is left of it.
        """
        stop = min(stop, expected)
        clipped = motion.time + pace.h * (1 + 1e-6) >= stop
        whole = stop - motion.time if clipped else pace.h
        h = whole
        while True:
            try:
                step = _finite_step(self.integrator, motion, inputs, h, FIXED_STEP_TOLERANCE)
                break
            except StepFailure as failure:
                self.integrator.counters.rejected_steps += 1
                h *= 0.5
                if h < self.h * LEAST_PART or not self.integrator.implicit:
                    raise DivergenceError(
                        f"the simulation stopped at t = {motion.time:.9g} s: the fixed step dt = {self.h:g} s of "
                        f"{self.integrator.name} failed: {failure}; {self.integrator.fastest(motion)} accelerates "
                        f"most; reduce dt or use 'integrator: auto'"
                    ) from failure
        if h < whole:
            return step, Pace(whole - h)
        return _landed(step, stop if clipped else self._tick(step.right.time)), Pace(self.h)

    def _tick(self, time: float) -> float:
        # Times on the grid of whole steps are exact multiples: a thousand additions do not drift.
        tick = round(time / self.h) * self.h
        return tick if abs(time - tick) <= 1e-6 * self.h else time


def _finite_step(
    integrator: Integrator, motion: Motion, inputs: HeldCommands, h: float, tolerance: float
) -> Step:
    # Whatever a method does inside, nothing that is not finite gets past here.
    try:
        step = integrator.step(motion, inputs, h, tolerance)
    except np.linalg.LinAlgError as error:
        raise StepFailure(str(error)) from error
    right = step.right
    if not all(np.isfinite(values).all() for values in (right.q, right.u, right.a, step.error + step.drift)):
        integrator.counters.steps -= 1
        raise StepFailure("the step left the finite numbers")
    return step


def _fit(time: float, h: float, stop: float, stretch: float) -> tuple[float, bool]:
    # Land on a stop exactly; one step a little too long is better than two, and two equal ones are better than a whole
    # one and a sliver.
    left = stop - time
    if h >= left * stretch * (1.0 - SAME_STEP):
        return left, True
    return (0.5 * left, False) if 2.0 * h > left else (h, False)


def _landed(step: Step, time: float) -> Step:
    # The step aimed at this time; rounding in time + h must not leave it a hair off.
    return replace(step, right=replace(step.right, time=time))
