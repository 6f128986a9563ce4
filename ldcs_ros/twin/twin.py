"""Twin: a simulation with its sensors, commands and watchdog, and its messages in the order of time."""

from __future__ import annotations

import math
import time as wall
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import nanoseconds
from ldcs_ros.messages.diagnostics import Status, diagnostic_array
from ldcs_ros.messages.frames import Frames
from ldcs_ros.messages.solver_status import SolverReport
from ldcs_ros.messages.topics import TOPICS, Topic
from ldcs_ros.sensors import Ticks
from ldcs_ros.twin.commands import Commands, Refusal
from ldcs_ros.twin.outputs import Outputs
from ldcs_ros.twin.sensing import Sensing
from ldcs_ros.twin.status import twin_statuses
from ldcs_ros.twin.vent import RAMP_TIME, VentRamp
from ldcs_ros.twin.watchdog import Watchdog
from ldcs_ros.twin.wrench_course import WrenchCourses

Sink = Callable[[str, str, bytes, int], None]
ARM_COMMANDS = ("pressure_command", "torque_command", "arm_command")
SOLVER_STATUS_RATE = 10.0
"""Messages of `solver_status` a second [Hz], or the publish rate where that is smaller."""


class Twin:
    """Advances a simulation and emits what a rig would send, each message when its time has come.

    Nothing depends on who calls it: the node, the command line and a replay that advance and command it alike
    get the same bytes. Each tick of a sensor and each report is an event at an exact multiple of its period.

    Args:
        scene: What is simulated.
        sinks: Callables `sink(topic, message_type, cdr, time_ns)`; each gets every message, also the commands
            that were applied. Names are relative, times are of the simulation.
        seed: Seed of the sensors' noise; None for the scene's own.
        accuracy: Position error asked of the solver [m]; None for the scene's.
        tracker_rate: Rate of the tracker [Hz]; None for the scene's.
        publish_rate: Reports of the state a second [Hz].
        wanted: Tells by name whether a topic that is built on demand is wanted now; None for never.
        watchdog: Watches the commands; None for one that is off.
        diagnostics: Emit /diagnostics once a second of simulation time; the node has more to say and does it.
        ambient_pressure: Absolute pressure of the surrounding air [Pa].
        publish_clock: Emit /clock with each report.
        publish_tf: Emit /tf with each report, /tf_static at the start.
        frame_prefix: What stands before the name of each frame.
        detail: Emit `lattice_state` and `solver_status` and let bags hold them; else they come while wanted.

    Attributes:
        simulation: The simulation.
        time: Time up to which everything has been emitted [s].
        settled: It began in the rest state.
        topics: Every topic that may be emitted or received, by relative name.
        sensing: The sensors.
        commands: Counters of accepted and refused commands.
        watchdog: The watchdog; its owner calls `check_watchdog`.
        overruns: Deadlines missed in real time, as its owner counts them; reported in `solver_status`.
        solver_report: Measures the pace for `solver_status`; its owner restarts it after a pause.
        sinks: The sinks; a caller may add and remove some between two advances.
    """

    def __init__(
        self,
        scene: Any,
        *,
        sinks: Iterable[Sink] = (),
        seed: int | None = None,
        accuracy: float | None = None,
        tracker_rate: float | None = None,
        publish_rate: float = 50.0,
        wanted: Callable[[str], bool] | None = None,
        watchdog: Watchdog | None = None,
        diagnostics: bool = True,
        ambient_pressure: float = 101325.0,
        publish_clock: bool = False,
        publish_tf: bool = False,
        frame_prefix: str = "",
        detail: bool = False,
    ) -> None:
        self.scene = scene
        self.seed = seed
        self.accuracy = accuracy
        self.publish_rate = publish_rate
        self.ambient_pressure = ambient_pressure
        self.publish_clock = publish_clock
        self.publish_tf = publish_tf
        self.detail = detail
        self.frames = Frames(frame_prefix)
        self._wanted = wanted or (lambda name: False)
        self.overruns = 0
        self.solver_report = SolverReport()
        self.settled = False
        self.sinks = list(sinks)
        self.simulation = (scene if accuracy is None else scene.with_accuracy(accuracy)).build()
        self.watchdog = watchdog or Watchdog(wall.monotonic)
        self.commands = Commands(self.simulation, self.frames)
        self._courses = WrenchCourses()
        self.sensing = Sensing(scene.sensors, self.simulation, seed=seed, tracker_rate=tracker_rate)
        self._outputs = Outputs(
            self.simulation,
            self.emit,
            wanted=self._wanted,
            tracker=self.sensing.tracker,
            pressure_sensor=self.sensing.pressure,
            ambient_pressure=ambient_pressure,
            publish_clock=publish_clock,
            publish_tf=publish_tf,
            frames=self.frames,
            detail=detail,
        )
        self._diagnostics = diagnostics
        self._ramp: VentRamp | None = None
        self._first_report = True
        self.topics: dict[str, Topic] = dict(self._outputs.topics)
        self.topics["/diagnostics"] = TOPICS["/diagnostics"]
        self.topics |= {name: topic for name, topic in TOPICS.items() if topic.direction == "in"}
        self._start()

    @property
    def next_time(self) -> float:
        """When the next event is due [s]."""
        return min(self._next_tick, self.sensing.next_delivery, self._courses.next_time)

    def advance_to_next(self) -> None:
        """Go on to the next event and emit all that belongs to it.

        Raises:
            DivergenceError: The simulation cannot go on; nothing was emitted, the state before is whole.
        """
        time = min(self._next_tick, self.sensing.next_delivery)
        if self._courses.next_time < time:
            self._go_to(self._courses.next_time)
            self._follow_courses()
            return
        if self._next_tick <= time:
            self._move(time)
        self.time = time
        # Measurements first: one that is delivered without delay belongs to this very event.
        self.sensing.report(time, self._outputs)
        if self._reports.time <= time:
            self._reports.advance()
            if self._first_report:
                self._first_report = False
                self._outputs.report_static(time)
            self._outputs.report_state()
            self._report_solver()
            self._continue_vent()
        if self._diagnostics and self._health.time <= time:
            self._health.advance()
            self.emit_diagnostics("ldcs_sim", self.statuses())

    def advance_to(self, seconds: float) -> None:
        """Emit everything up to a time [s] and bring the simulation there.

        Raises:
            DivergenceError: The simulation cannot go on; what came before has been emitted.
        """
        while self.next_time <= seconds:
            self.advance_to_next()
        # Behind the last event time rests on whole nanoseconds, so that a command's log time is exactly when
        # it acted.
        rest = nanoseconds(seconds) / 1e9
        if rest < self.next_time:
            self._go_to(rest)

    def advance_to_report(self) -> None:
        """Go on to the next report of the state, exactly one publish period after the last."""
        self.advance_to(self._reports.time)

    def receive(self, topic: str, cdr: bytes) -> str | None:
        """Apply a command at the present time; return None, or why it was refused whole.

        Raises:
            DivergenceError: The simulation cannot come to the present time; the command counts as refused.
        """
        try:
            self._move(self.time)
        except DivergenceError as error:
            self.commands.refuse(Refusal("failed", str(error)), topic)
            raise
        try:
            if topic in ARM_COMMANDS and self.watchdog.tripped:
                raise self._vented(topic)
            message = self.commands.receive(topic, cdr)
        except Refusal as refusal:
            return str(refusal)
        if topic in ARM_COMMANDS:
            self._ramp = None
            self.watchdog.feed()
        else:
            frame = self.frames.local(message.header.frame_id)
            self._courses.drop(frame)
            self.watchdog.feed_wrench(frame)
        if topic == "arm_command":
            self._emit_arm_command()
        else:
            self.emit(TOPICS[topic], cdr, nanoseconds(self.time))
        return None

    def apply_wrench(
        self, *, point: str, frame_id: str, force: Any, torque: Any, duration: float, ramp: float
    ) -> str:
        """Let a wrench act from the present on for a while, instead of the one that its frame has.

        It is emitted as the `external_wrench` commands that it amounts to, so that a bag replays it; no timeout
        ends it. The arguments are those of `Commands.wrench_course`.

        Returns:
            What was applied, in words.

        Raises:
            Refusal: Refused whole and counted; nothing changed.
        """
        self._move(self.time)
        course = self.commands.wrench_course(
            point=point,
            frame_id=frame_id,
            force=force,
            torque=torque,
            duration=duration,
            ramp=ramp,
            start=self.time,
        )
        self.watchdog.release_wrench(course.frame)
        self._courses.put(course)
        self._follow_courses()
        until = f"to t = {self.time + duration:.9g} s" if duration > 0.0 else "until it is replaced"
        return f"{course.frame}: {math.hypot(*force):.6g} N, {math.hypot(*torque):.6g} N m, {until}"

    def check_watchdog(self) -> bool:
        """Act on silence: vent the arms, clear wrenches; return True when the watchdog tripped just now."""
        for frame in self.watchdog.stale_wrenches():
            self._clear_wrench(frame)
        tripped = self.watchdog.check()
        if tripped:
            self.vent()
        return tripped

    def vent(self, duration: float = RAMP_TIME) -> None:
        """Ramp what the arms are commanded to zero over a duration [s] of simulation time; 0 for at once."""
        inputs = self.simulation.inputs
        value = inputs.pressure if inputs.pressure is not None else inputs.torque
        if value is None or not np.any(value):
            return
        self._move(self.time)
        self._ramp = VentRamp(self.time, np.array(value, dtype=float), duration)
        self._continue_vent()

    def rearm(self) -> bool:
        """Accept commands for the arms again; return whether the watchdog had tripped."""
        self.commands.start_over()
        return self.watchdog.rearm()

    def settle(self) -> None:
        """Begin anew in the rest state, at the time at which schedule and rises are over.

        Raises:
            DivergenceError: There is no rest state; nothing changed.
        """
        self.simulation.settle()
        self.settled = True
        self._start()

    def reset(self) -> None:
        """Back to the scene's start: state, inputs, sensors and their noise; counters stay."""
        self.simulation.reset()
        self.settled = False
        self.watchdog.forget()
        self.commands.start_over()
        self._start()

    def statuses(self) -> list[Status]:
        """Return the health of solver, commands and watchdog."""
        return twin_statuses(self.simulation.statistics.as_dict(), self.commands, self.watchdog)

    def emit_diagnostics(self, owner: str, statuses: Iterable[Status]) -> None:
        """Emit /diagnostics with these entries, stamped with the present time."""
        now = nanoseconds(self.time)
        self.emit(TOPICS["/diagnostics"], diagnostic_array(now, owner, statuses), now)

    def emit(self, topic: Topic, cdr: bytes, time_ns: int) -> None:
        """Hand a message to all sinks."""
        for sink in self.sinks:
            sink(topic.name, topic.type, cdr, time_ns)

    @property
    def _next_tick(self) -> float:
        health = self._health.time if self._diagnostics else math.inf
        return min(self._reports.time, health, self.sensing.next_tick)

    def _start(self) -> None:
        start = self.time = self.simulation.time
        self._reports = Ticks.starting_at(self.publish_rate, start)
        self._health = Ticks.starting_at(1.0, start)
        self._reports_a_status = max(1, round(self.publish_rate / SOLVER_STATUS_RATE))
        self._ramp = None
        self._courses.clear()
        self.solver_report.restart()
        self._first_report = True
        self.sensing.start(start)

    def _move(self, time: float) -> None:
        if time > self.simulation.time:
            self.simulation.advance_to(time)

    def _go_to(self, time: float) -> None:
        # Two times that a bag cannot tell apart are one: a replay acts at the first of them.
        if nanoseconds(time) > nanoseconds(self.time):
            self._move(time)
            self.time = time

    def _follow_courses(self) -> None:
        for course, share in self._courses.take(self.time):
            self._hold_wrench(course.frame, *course.at(share))

    def _report_solver(self) -> None:
        if (self._reports.index - 1) % self._reports_a_status:
            return
        if not (self.detail or self._wanted("solver_status")):
            return
        now = nanoseconds(self.time)
        counts = {"overruns": self.overruns, "refused": sum(self.commands.refused.values())}
        message = self.solver_report.build(now, self.simulation, **counts)
        self.emit(self.topics["solver_status"], message, now)

    def _continue_vent(self) -> None:
        if self._ramp is None:
            return
        value, inputs = self._ramp.at(self.time), self.simulation.inputs
        if inputs.pressure is not None:
            inputs.set_pressure(value)
        else:
            inputs.set_torque(value)
        self._emit_arm_command()
        if self._ramp.is_over(self.time):
            self._ramp = None

    def _emit_arm_command(self) -> None:
        # What the arms are commanded, in standard types, so that any bag can be replayed without ours.
        inputs, now = self.simulation.inputs, nanoseconds(self.time)
        if inputs.pressure is not None:
            self.emit(TOPICS["pressure_command"], messages.pressure_command(inputs.pressure), now)
        else:
            torque = messages.torque_command(now, self.simulation.joint_names, inputs.torque)
            self.emit(TOPICS["torque_command"], torque, now)

    def _clear_wrench(self, frame: str) -> None:
        self._move(self.time)
        self._hold_wrench(frame, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def _hold_wrench(self, frame: str, force: Any, torque: Any) -> None:
        self.commands.hold_wrench(frame, force, torque)
        now = nanoseconds(self.time)
        message = messages.wrench_command(now, self.frames.named(frame), force, torque)
        self.emit(TOPICS["external_wrench"], message, now)

    def _vented(self, topic: str) -> Refusal:
        refusal = Refusal("vented", "the watchdog vented the arms; call rearm, then send commands in time")
        self.commands.refuse(refusal, topic)
        return refusal
