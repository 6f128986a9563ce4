"""`Simulation`: a model, its integrator and its inputs, advanced in time; the only object that changes."""

from __future__ import annotations

import math
import time as wall_clock
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.errors import SceneError, SolverError
from ldcs_ros.integrators import DEFAULT_INTEGRATOR, integrator_class
from ldcs_ros.integrators.base import Counters, Step
from ldcs_ros.integrators.command_steps import CommandSteps
from ldcs_ros.integrators.control import AdaptiveSteps, FixedSteps, Pace
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.physics.model import Model, Motion
from ldcs_ros.physics.state import State
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.checkpoint import Checkpoint
from ldcs_ros.simulation.follower import StepFollower
from ldcs_ros.simulation.inputs import Inputs
from ldcs_ros.simulation.problem import Problem
from ldcs_ros.simulation.readable import ReadableSimulation
from ldcs_ros.simulation.schedule import Schedule
from ldcs_ros.simulation.statistics import Statistics
from ldcs_ros.simulation.threads import one_thread

if TYPE_CHECKING:
    # Loaded when they are asked for.
    from ldcs_ros.simulation.equilibrium import Equilibrium
    from ldcs_ros.simulation.run_commands import CommandProfile
    from ldcs_ros.simulation.run_gradient import RunGradient
    from ldcs_ros.simulation.run_sensitivity import RunSensitivity
    from ldcs_ros.simulation.stability import Stability
    from ldcs_ros.tables.run import Run

# A step is taken again if its follower asks for one shorter by this factor.
RETAKEN = 0.8


class Simulation(ReadableSimulation):
    """The twin of one scene.

    Integration steps follow the motion, not the caller: `advance_to` integrates past the asked time if that
    is cheaper and evaluates the step inside, so how often one looks does not change the answer. A command
    acts at the time that was last advanced to.

    Args:
        scene: The problem to simulate.

    Raises:
        SceneError: The scene's effects do not fit together.
    """

    def __init__(self, scene: Problem) -> None:
        self.scene = scene
        try:
            self.model = Model(scene.lattice, scene.points, scene.effects, scene.material)
        except ValueError as error:
            raise SceneError(str(error)) from error
        if not self.model.free.size:
            raise SceneError("every coordinate is prescribed, nothing can move; free some nodes @ effects")
        self.inputs = Inputs(self.model, self._now)
        solver = scene.solver
        method = integrator_class(DEFAULT_INTEGRATOR if solver.integrator == "auto" else solver.integrator)
        self.integrator = method(self.model)
        self.accuracy = solver.accuracy
        self._control: AdaptiveSteps | FixedSteps
        if solver.accuracy is not None:
            if solver.integrator == "auto":
                self._control = CommandSteps(self.integrator, solver.accuracy, one_thread)
            else:
                self._control = AdaptiveSteps(self.integrator, solver.accuracy)
        elif solver.dt is not None:
            self._control = FixedSteps(self.integrator, solver.dt)
        self._initial_state = self.integrator.memory
        self._follower: StepFollower | None = None
        self._pace: Pace
        self._taken: tuple[tuple[float, int], Step, State] | None = None
        self.statistics = Statistics()
        self._schedule = Schedule(scene.inputs, self.inputs)
        # A command that will be refused in ten minutes is refused now.
        self.time = 0.0
        self._schedule.run_commands(math.inf)
        self.reset()

    def reset(self, state: State | None = None) -> None:
        """Go back to the scene's start, or to a state that this simulation had, and go on from it to the bit.

        The statistics go back too, but for the wall time.

        Raises:
            ValueError: The state is that of another scene or method; nothing changed.
        """
        if state is not None:
            self._restore(state)
            return
        self.time = 0.0
        self._schedule.position = 0
        self.inputs.clear()
        self.integrator.recall(self._initial_state)
        self.integrator.counters = Counters()
        self.statistics = Statistics()
        q, u = self.model.reference_state()
        self._begin(q, u)
        self._schedule.run_commands(0.0)
        limit = self.integrator.stability_limit(self._step.right, self.inputs.held())
        dt = self.scene.solver.dt
        if dt is not None and dt > limit:
            raise SolverError(
                f"dt = {dt:g} s is above the stability limit {limit:.3g} s of {self.integrator.name} for this scene; "
                f"reduce dt or use an implicit integrator @ solver.dt"
            )

    def start_from(
        self,
        position: np.ndarray,
        velocity: np.ndarray | None = None,
        *,
        link_angle: np.ndarray | None = None,
        link_rate: np.ndarray | None = None,
    ) -> None:
        """Put the sheet into a given shape at the present time and go on from there, commands kept.

        Prescribed coordinates (clamped nodes, driven edges) keep their values. A state that this simulation had
        goes to `reset` instead, which resumes it to the bit.

        Args:
            position: Node positions in ldcs_base [m], shape (n_nodes, 3).
            velocity: Node velocities in ldcs_base [m/s], same shape; None for a sheet at rest.
            link_angle: Link angles [rad], shape (n_arms, n_links); None for straight arms.
            link_rate: Their rates [rad/s], same shape; None for arms at rest.

        Raises:
            ValueError: A shape is wrong or a number is not finite; nothing changed.
        """
        q, u = self.model.coordinates_of(position, velocity, link_angle, link_rate)
        self.model.prescribe(self.time, q, u)
        self.integrator.recall(self._initial_state)
        self._begin(q, u)

    def advance_to(self, time: float) -> None:
        """Advance to a simulation time [s]; commands and valves act at their own times on the way.

        Raises:
            ValueError: The time is not finite, or before the present.
            DivergenceError: A step could not be taken; the state stays at the last good one.
        """
        if not math.isfinite(time) or time < self.time:
            raise ValueError(f"cannot advance to {time!r} s, expected a time of at least {self.time:.9g} s")
        started = wall_clock.perf_counter()
        try:
            if self.follows_commands:
                # The formula for commands uses no BLAS, and the switch costs as much as one of its steps.
                self._advance(time)
            else:
                with one_thread():
                    self._advance(time)
        finally:
            self._count(wall_clock.perf_counter() - started)

    def run(self, duration: float, *, every: float = 0.01) -> Run:
        """Advance by a duration [s] and return what happened, at the present time and `every` so often [s] after it.

        Raises:
            ValueError: A time is not finite or not above zero.
            DivergenceError: As `advance_to`.
        """
        from ldcs_ros.simulation.run import RunCollector, sample_times

        collected = RunCollector(
            self.lattice, self.points, self.arm_names, self.joint_names, self.joint_index
        )
        for time in sample_times(self.time, duration, every):
            self.advance_to(time)
            collected.add(self.state, self.inputs.pressure)
        return collected.run(self.scene.name)

    @property
    def state(self) -> State:
        """The state at the present time: built once, and again only after an advance or a command."""
        key = (self.time, self.inputs.version)
        if self._taken is None or self._taken[0] != key or self._taken[1] is not self._step:
            self._taken = (key, self._step, self.build_state())
        return self._taken[2]

    def build_state(self) -> State:
        """Return the state at the present time, computed again at each call."""
        motion = self.motion()
        n = 3 * self.lattice.n_nodes
        arms = (len(self.arm_names), -1) if self.model.n_angles else (0, 0)
        # A command at this very time acts with the next advance.
        waiting = self._input_version != self.inputs.version
        checkpoint = Checkpoint(
            self._origin(),
            self._step,
            self._pace,
            self._held,
            waiting,
            self._schedule.position,
            self._schedule.course,
            self._schedule.is_prepared,
            self._last_command_time,
            self._next_command_time,
            self.inputs.get_state(),
            self.integrator.memory,
            replace(self.integrator.counters),
            self.statistics.error_estimate,
            self.statistics.velocity_estimate,
        )
        return State(
            time=self.time,
            position=self._of_nodes(motion.q[:n]),
            velocity=self._of_nodes(motion.u[:n]),
            link_angle=_read_only(motion.q[n:].reshape(arms)),
            link_rate=_read_only(motion.u[n:].reshape(arms)),
            pressure=_read_only(self.inputs.chamber_pressure(self.time)),
            memory=checkpoint,
        )

    def _of_nodes(self, flat: np.ndarray) -> np.ndarray:
        values = flat.reshape(-1, 3)
        missing = self.lattice.missing
        if missing.size:
            values = values.copy()
            values[missing] = np.nan
        return _read_only(values)

    @property
    def last_step(self) -> Step:
        """The integration step under way: where it began, where it ends, and the curve between (`Step.at`)."""
        return self._step

    @property
    def follows_commands(self) -> bool:
        """Whether the two-step formula for commands at a rate takes the steps at present."""
        return self._control.answers_jumps(self._pace)

    def settle(self, *, follow: bool = False, until: float = math.inf) -> Stability:
        """Move to an equilibrium: schedule and smooth rises done, chambers filled, all forces in balance.

        An unstable equilibrium is a balance, too; the result says so, and a warning names the way out of it.

        Args:
            follow: Leave an unstable equilibrium along its direction until a stable one is found.
            until: Commands of the schedule after this time [s] are still to come.

        Returns:
            The lowest eigenvalue at the equilibrium, and its direction.

        Raises:
            DivergenceError: No equilibrium was found (nothing holds a free sheet, for example), or with `follow`
                no stable one; nothing changed.
        """
        found = self._find_equilibria(follow=follow, both_ways=False, until=until)[-1]
        self._begin(found.coordinates, np.zeros_like(found.coordinates))
        if not found.stability.is_stable:
            warnings.warn(f"settle: {found.stability.describe(self.model)}", stacklevel=2)
        return found.stability

    def equilibria(self) -> list[Equilibrium]:
        """Return the equilibrium that `settle` finds and, if it is unstable, those on both sides of it.

        The simulation itself stays as it is.

        Raises:
            DivergenceError: No equilibrium was found.
        """
        before = self.state
        try:
            return self._find_equilibria(follow=True, both_ways=True)
        finally:
            self.reset(before)

    def _find_equilibria(
        self, *, follow: bool, both_ways: bool, until: float = math.inf
    ) -> list[Equilibrium]:
        from ldcs_ros.simulation.equilibrium import find_equilibria

        before = self.state
        done = [command.time for command in self.scene.inputs if command.time <= until]
        time = max([self.time, *done, *self.model.breakpoints])
        if until < math.inf:
            time = max(time, until)
        try:
            self.time = time
            self._schedule.run_commands(time)
            self.inputs.settle()
            q, _ = self.model.reference_state()
            q[self.model.free] = self._step.at(before.time, self.model).q[self.model.free]
            with one_thread():
                return find_equilibria(
                    self.model, q, time, self.inputs.held(), follow=follow, both_ways=both_ways
                )
        except Exception:
            self.reset(before)
            raise

    def run_sensitivity(
        self,
        time: Sequence[float],
        of: Sequence[str],
        to: Sequence[str | CommandProfile],
        *,
        settled: bool = False,
        with_error: bool = True,
    ) -> RunSensitivity:
        """Return how places move along a run with commands, numbers of the scene and the start [m per SI unit].

        The run begins at the present state and follows the scene's schedule; the simulation stays as it is. Steps are
        frozen: the derivatives are those of the computed motion, by the linearised equations of its steps.

        Args:
            time: Times at which the derivatives are wanted [s], rising, the present time or later.
            of: Points or `node_<layer>_<i>_<j>`.
            to: Commands as of `sensitivity`, higher for the whole run; with `@0.8` the scheduled command of 0.8 s,
                until the next one of its kind; or a profile. Paths of the scene, also `inputs[1].pressure`.
                `start.position.mode_1`, `start.velocity.node_top_8_4.z`: coordinates and rates at the start, of a
                natural mode or a node.
            settled: The run begins at a rest state, which moves with the numbers. Otherwise the present state is kept,
                unless it is the scene's own start.
            with_error: State an error of each derivative, by a second run at ten times the accuracy.

        Raises:
            ValueError: There is no such place, number or time.
            DivergenceError: A step could not be taken.
        """
        from ldcs_ros.simulation.run_sensitivity import run_sensitivity

        with one_thread():
            return run_sensitivity(self, self._branch, time, of, to, settled=settled, with_error=with_error)

    def run_gradient(self, time: Sequence[float], of: Sequence[str], weights: np.ndarray) -> RunGradient:
        """Return the gradient of a weighted sum of positions by all commands of the schedule, at the cost of few runs.

        The run begins at the present state; the simulation stays as it is. Steps are frozen, as in `run_sensitivity`.

        Args:
            time: Times of the positions [s], rising, the present time or later.
            of: Points or `node_<layer>_<i>_<j>`.
            weights: Weight of x, y, z of each place at each time, shape (n_times, 3 n_of).

        Raises:
            ValueError: There is no such place or time.
            DivergenceError: A step could not be taken.
        """
        from ldcs_ros.simulation.run_gradient import run_gradient
        from ldcs_ros.simulation.run_sensitivity import USUAL_ACCURACY

        with one_thread():
            return run_gradient(self._branch(self.accuracy or USUAL_ACCURACY), time, of, weights)

    def _branch(self, accuracy: float) -> Simulation:
        """Return a simulation that goes on from the present state by the usual one-step method at an accuracy [m]."""
        method = {"integrator": DEFAULT_INTEGRATOR, "accuracy": accuracy}
        other, motion = Simulation(self.scene.edited({"solver": method})), self.motion()
        other.time, other._schedule.position = self.time, self._schedule.position
        other.inputs.set_state(self.inputs.get_state())
        other._begin(motion.q, motion.u)
        return other

    def announce(self, commands: Sequence[ScheduledCommand]) -> None:
        """Tell which commands of the arms will come from outside, so that a smooth course of them costs fewer steps.

        They are still to be given at their times. The first that does not come, or another one, ends the course.

        Args:
            commands: Torque or pressure commands, their times rising [s]; those of before are replaced.
        """
        self._schedule.announced = tuple(commands)
        self._schedule.forget_course()

    def follow(self, follower: StepFollower) -> None:
        """Have every step from now on followed; the follower's own errors take the place of a transported one."""
        self._follower = follower
        if isinstance(self._control, CommandSteps):
            # A follower sees every step, and commands as they are held.
            self._schedule.forget_course()
            self._control = AdaptiveSteps(self.integrator, self._control.accuracy)
        self._pace = replace(self._pace, errors=())

    # -- inside
    # ---------------------------------------------------------------------------------------------------

    def _now(self) -> float:
        # A bound method, not a lambda: a simulation can be pickled.
        return self.time

    def _begin(self, q: np.ndarray, u: np.ndarray) -> None:
        self._schedule.forget_course()
        self._held, self._input_version = self.inputs.held(), self.inputs.version
        motion = self.integrator.start(self.time, q, u, self._held)
        self._step = Step(motion, motion, 0.0)
        self._pace = self._control.first(motion)
        self._last_command_time, self._next_command_time = -math.inf, math.inf

    def _advance(self, time: float) -> None:
        schedule = self._schedule
        if not schedule.is_prepared:
            is_smoothed = isinstance(self._control, CommandSteps) and self.scene.solver.commands == "auto"
            schedule.prepare(self.model, self.motion(), self.accuracy if is_smoothed else None)
        # An announced command of the present may still come while time stands still.
        if time > self.time + TIME_TOLERANCE or not schedule.is_announced:
            self._take_commands()
        while True:
            event = schedule.next_event(self._held.curve)
            announced = schedule.next_announced(self.time)
            if announced < time - TIME_TOLERANCE:
                event = min(event, announced)
            stop = time if event > time - TIME_TOLERANCE else event
            self._integrate_to(stop)
            self.time = stop
            # A stretch of a curve passes commands without a stop; they are given here, each at its own time.
            schedule.run_events(stop)
            if event > time + TIME_TOLERANCE:
                break
            self._take_commands()

    def motion(self) -> Motion:
        """Return generalised coordinates, velocities and accelerations at the present time."""
        return self._step.at(self.time, self.model)

    def _integrate_to(self, stop: float) -> None:
        while (start := self._step.right).time < stop - TIME_TOLERANCE:
            curve = self._held.curve
            announced = math.inf if curve is not None else self._schedule.next_announced(self.time)
            barrier = math.inf
            for time in (self._schedule.next_event(curve), announced, *self.model.breakpoints):
                if start.time + TIME_TOLERANCE < time < barrier:
                    barrier = time
            expected = self._next_command_time
            self._take_step(
                *self._control.advance(
                    start,
                    self._held,
                    self._pace,
                    barrier,
                    opening=start.time == self._last_command_time,
                    until=stop,
                    expected=expected if expected > start.time + TIME_TOLERANCE else math.inf,
                )
            )

    def _take_step(self, step: Step, pace: Pace) -> None:
        if self._follower is not None:
            longest = self._follower.longest_step(step, self._held)
            if longest < RETAKEN * (step.right.time - step.left.time):
                self.integrator.counters.rejected_steps += 1
                self._pace = replace(self._pace, h=longest, opening=longest)
                return
            self._follower.take(step)
            pace = replace(pace, h=min(pace.h, longest))
        self._step = step
        self._pace = self._control.corner(pace) if step.right.time in self.model.breakpoints else pace
        spent, (position, velocity) = self.statistics, self._schedule.difference(self._held.curve)
        estimate, extent = pace.estimate + position, math.hypot(*self.lattice.size)
        if estimate >= extent > spent.error_estimate:
            warnings.warn(
                f"no digit of a position holds after t = {step.left.time:.6g} s: the motion amplifies errors, and the "
                f"estimated one, {estimate:.1e} m, exceeds the sheet; ask for more accuracy than {self.accuracy:g} m",
                stacklevel=2,
            )
        spent.error_estimate = max(spent.error_estimate, estimate)
        spent.velocity_estimate = max(spent.velocity_estimate, pace.velocity_estimate + velocity)

    def _take_commands(self) -> None:
        # A command acts now: the step beyond now is dropped, and the smooth part of the acceleration stays.
        before, schedule = self._held, self._schedule
        if self.inputs.version == self._input_version and schedule.course is None and before.curve is None:
            return
        held = self.inputs.held()
        curve = schedule.curve(self.time, held)
        is_same = held.torque is before.torque and held.chambers is before.chambers
        if curve is before.curve and (is_same or curve is not None) and held.wrenches is before.wrenches:
            # A command that waits in a valve changes nothing yet, nor does one that a curve replaces.
            self._input_version = self.inputs.version
            return
        if curve is not None:
            held = replace(held, curve=curve)
        motion = self.motion()
        if motion.time != self.time:
            motion = Motion(self.time, motion.q, motion.u, motion.a)
        if not self._control.answers_jumps(self._pace):
            with one_thread():
                jump = self.integrator.jump(motion, self._held, held)
                lasting = motion.a + self.integrator.smooth_jump(motion, jump)
            motion = Motion(motion.time, motion.q, motion.u, motion.a + jump, lasting)
        self._held, self._input_version = held, self.inputs.version
        self._pace = self._pace.left_at(self._step, self.time)
        if curve is not before.curve:
            # A curve and the commands before or after it differ by half a step of them.
            self._pace = replace(self._pace, h=min(self._pace.h, schedule.interval_length(self.time)))
        self._step = Step(motion, motion, 0.0)
        # Commands at a steady rate continue: a step past the next one would be dropped.
        last = self._last_command_time
        self._next_command_time, self._last_command_time = (
            (2.0 * self.time - last, self.time) if curve is None else (math.inf, -math.inf)
        )

    def _origin(self) -> tuple[object, ...]:
        scene = self.scene
        return (
            scene.lattice,
            scene.points,
            scene.effects,
            scene.material,
            scene.inputs,
            self.integrator.name,
        )

    def _restore(self, state: State) -> None:
        checkpoint = state.memory
        if not isinstance(checkpoint, Checkpoint):
            raise ValueError(
                "this state was not made by a simulation; reset() without it goes to the scene's start"
            )
        if checkpoint.origin != self._origin():
            nodes, own = len(state.position), self.lattice.n_nodes
            got = f"one of {nodes} nodes" if nodes != own else "one of another scene or integrator"
            raise ValueError(
                f"reset: got a state that this simulation did not have, {got}, expected one of its own scene "
                f"({own} nodes, {self.integrator.name}); use start_from for a shape alone"
            )
        self._step, self._pace, self._held = checkpoint.step, checkpoint.pace, checkpoint.held
        schedule = self._schedule
        schedule.position, schedule.course = checkpoint.next_command, checkpoint.course
        schedule.is_prepared = checkpoint.is_course_prepared
        self._last_command_time, self._next_command_time = (
            checkpoint.last_command_time,
            checkpoint.next_command_time,
        )
        self.time = state.time
        self.inputs.set_state(checkpoint.inputs)
        self._input_version = -1 if checkpoint.is_command_waiting else self.inputs.version
        self.integrator.recall(checkpoint.integrator)
        self.integrator.counters = replace(checkpoint.counters)
        self.statistics.error_estimate = checkpoint.error_estimate
        self.statistics.velocity_estimate = checkpoint.velocity_estimate
        self._count(0.0)

    def _count(self, wall_time: float) -> None:
        counters, spent = self.integrator.counters, self.statistics
        spent.steps, spent.rejected_steps = counters.steps, counters.rejected_steps
        spent.evaluations, spent.solves = counters.evaluations, counters.solves
        spent.factorisations = counters.factorisations
        spent.wall_time += wall_time


def _read_only(view: np.ndarray) -> np.ndarray:
    # A state is handed to several receivers.
    view.flags.writeable = False
    return view
