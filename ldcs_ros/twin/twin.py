"""Twin: a simulation with its sensors, commands and watchdog, and its messages in the order of time."""

from __future__ import annotations

import math
import time as wall
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.integrators import DEFAULT_INTEGRATOR
from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import nanoseconds
from ldcs_ros.messages.diagnostics import SolverReport, Status, diagnostic_array
from ldcs_ros.messages.frames import Frames
from ldcs_ros.messages.topics import TOPICS, Topic
from ldcs_ros.physics.state import State
from ldcs_ros.scene.scene import Scene
from ldcs_ros.twin.commands import Commands, Refusal
from ldcs_ros.twin.events import ClockSource, EventSource, PeriodicSource
from ldcs_ros.twin.reports import Reports
from ldcs_ros.twin.sensor_suite import SensorSuite, pressure_parameters, tracker_parameters
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.status import twin_statuses
from ldcs_ros.twin.watchdog import RAMP_TIME, VentRamp, Watchdog
from ldcs_ros.twin.wrench_profile import WrenchSchedule

Sink = Callable[[str, str, bytes, int], None]
ARM_COMMANDS = ("pressure_command", "torque_command", "arm_command")
SOLVER_STATUS_RATE = 10.0
"""Messages of `solver_status` per second [Hz], or the publish rate where that is smaller."""
DIAGNOSTICS_RATE = 1.0
"""Messages of /diagnostics per second of simulation time [Hz]."""


class Twin:
    """A simulation that emits the messages of a rig, each when its time has come.

    Nothing depends on the caller: the node, the command line and a replay that advance and command a twin alike
    get the same bytes. Each tick of a sensor and each report is an event at an exact multiple of its period.
    The state is taken once per event and handed to the sources that are due.

    Args:
        scene: The scene that is simulated.
        settings: The settings of the run.
        sinks: Callables `sink(topic, message_type, cdr, time_ns)`; each gets every message, also the commands
            that were applied. Names are relative, times are of the simulation.
        has_subscribers: Returns by name whether a topic that is built on demand has subscribers now; None for
            never.
        watchdog: The watchdog of the commands; None for one that is off.
        diagnostics: Emit /diagnostics; the node adds entries and emits it itself.

    Attributes:
        scene: The scene.
        settings: The settings, `settled` as the present run began.
        tracker_rate: Rate of the tracker [Hz]; None without one.
        simulation: The simulation.
        time: Time up to which everything has been emitted [s].
        topics: Every topic that may be emitted or received, by relative name.
        commands: Counters of accepted and refused commands.
        watchdog: The watchdog; its owner calls `check_watchdog`.
        overruns: Deadlines missed in real time, as its owner counts them; reported in `solver_status`.
        solver_report: Meter of the pace for `solver_status`; its owner restarts it after a pause.
        sinks: The sinks; a caller may add and remove some between two advances.
    """

    def __init__(
        self,
        scene: Scene,
        settings: RunSettings | None = None,
        *,
        sinks: Iterable[Sink] = (),
        has_subscribers: Callable[[str], bool] | None = None,
        watchdog: Watchdog | None = None,
        diagnostics: bool = True,
    ) -> None:
        self.scene = scene
        asked_settings = settings or RunSettings()
        self.settings = replace(asked_settings, verify=asked_settings.verify or scene.solver.verify)
        self.sinks = list(sinks)
        self.overruns = 0
        self.solver_report = SolverReport()
        self.watchdog = watchdog or Watchdog(wall.monotonic)
        accuracy = self.settings.accuracy
        asked = scene if accuracy is None else scene.with_accuracy(accuracy)
        if not self.settings.command_steps and asked.solver.integrator == "auto":
            asked = asked.edited({"solver.integrator": DEFAULT_INTEGRATOR})
        if self.settings.known_commands == "held" and asked.solver.integrator == "auto":
            asked = asked.edited({"solver.commands": "held"})
        self.simulation = asked.build(verify=True) if self.settings.verify else asked.build()
        self.frames = Frames(self.settings.frame_prefix)
        self.commands = Commands(self.simulation, self.frames)
        self._has_subscribers = has_subscribers or (lambda name: False)
        self._wrenches = WrenchSchedule()
        self._ramp: VentRamp | None = None
        self._first_report = True
        tracker = tracker_parameters(scene, self.settings)
        pressure = pressure_parameters(scene, self.simulation)
        self.tracker_rate = None if tracker is None else tracker.rate
        self._reports = Reports(
            self.simulation,
            self.emit,
            self.settings,
            has_subscribers=self._has_subscribers,
            tracker=tracker,
            pressure=pressure,
            frames=self.frames,
        )
        sensors = SensorSuite(
            self.simulation, self._reports, tracker=tracker, pressure=pressure, seed=self.settings.seed
        )
        self._report = PeriodicSource(self.settings.publish_rate, self._report_state)
        # In this order at one time: a measurement that is delivered without delay belongs to that very report.
        self._sources: list[EventSource] = [sensors, self._report]
        # Before all stamps of a time comes that time, and before the poses their frames.
        if self.settings.publish_tf:
            self._sources.insert(0, PeriodicSource(self.settings.publish_rate, self._report_transforms))
        if self.settings.publish_clock:
            rates = [
                self.settings.publish_rate,
                *(one.rate for one in (tracker, pressure) if one is not None),
            ]
            self._sources.insert(0, ClockSource(max(rates), self._reports.report_clock))
        if diagnostics:
            self._sources.append(PeriodicSource(DIAGNOSTICS_RATE, self._report_health))
        self.topics: dict[str, Topic] = dict(self._reports.topics)
        self.topics["/diagnostics"] = TOPICS["/diagnostics"]
        self.topics |= {name: topic for name, topic in TOPICS.items() if topic.direction == "in"}
        if self.settings.settled:
            self.settle()
        else:
            self._start()

    @property
    def next_time(self) -> float:
        """Time of the next event [s]."""
        return min(self._next_report, self._wrenches.next_time)

    def advance_to_next(self) -> None:
        """Go on to the next event and emit all that belongs to it.

        Raises:
            DivergenceError: The simulation cannot go on; nothing was emitted, the state before is whole.
        """
        time = self._next_report
        if self._wrenches.next_time < time:
            self._go_to(self._wrenches.next_time)
            self._apply_wrenches()
            return
        due = [source for source in self._sources if source.next_time <= time]
        if any(source.needs_state(time) for source in due):
            self._move(time)
        self.time = time
        state = self.simulation.state
        for source in due:
            source.report(time, state)

    def advance_to(self, seconds: float) -> None:
        """Emit everything up to a time [s] and bring the simulation there.

        Raises:
            DivergenceError: The simulation cannot go on; earlier messages have been emitted.
        """
        while self.next_time <= seconds:
            self.advance_to_next()
        # After the last event, time rests on whole nanoseconds: a command's log time is exactly when it acted.
        rest = nanoseconds(seconds) / 1e9
        if rest < self.next_time:
            self._go_to(rest)

    def advance_to_report(self) -> None:
        """Go on to the next report of the state, exactly one publish period after the last."""
        self.advance_to(self._report.next_time)

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
            frame = self.commands.receive(topic, cdr)
        except Refusal as refusal:
            return str(refusal)
        if topic in ARM_COMMANDS:
            self._ramp = None
            self.watchdog.feed()
        else:
            self._wrenches.drop(frame)
            self.watchdog.feed_wrench(frame)
        if topic == "arm_command":
            self._emit_arm_command()
        else:
            self.emit(TOPICS[topic], cdr, nanoseconds(self.time))
        return None

    def apply_wrench(
        self,
        *,
        point: str,
        frame_id: str,
        force: Sequence[float],
        torque: Sequence[float],
        duration: float,
        ramp: float,
    ) -> str:
        """Let a wrench act from the present on for a while, instead of the one that its frame has.

        It is emitted as the `external_wrench` commands that it amounts to, so that a bag replays it; no timeout
        ends it. The arguments are those of `Commands.wrench_profile`.

        Returns:
            The applied wrench, in words.

        Raises:
            Refusal: Refused whole and counted; nothing changed.
        """
        self._move(self.time)
        profile = self.commands.wrench_profile(
            point=point,
            frame_id=frame_id,
            force=force,
            torque=torque,
            duration=duration,
            ramp=ramp,
            start=self.time,
        )
        self.watchdog.release_wrench(profile.frame)
        self._wrenches.put(profile)
        self._apply_wrenches()
        until = f"to t = {self.time + duration:.9g} s" if duration > 0.0 else "until it is replaced"
        return f"{profile.frame}: {math.hypot(*force):.6g} N, {math.hypot(*torque):.6g} N m, {until}"

    def check_watchdog(self) -> bool:
        """Act on silence: vent the arms, clear wrenches; return True when the watchdog tripped just now."""
        for frame in self.watchdog.stale_wrenches():
            self._clear_wrench(frame)
        tripped = self.watchdog.check()
        if tripped:
            self.vent()
        return tripped

    def vent(self, duration: float = RAMP_TIME) -> None:
        """Ramp the command of the arms to zero over a duration [s] of simulation time; 0 for at once."""
        inputs = self.simulation.inputs
        value = inputs.pressure if inputs.pressure is not None else inputs.torque
        if value is None or not np.any(value):
            return
        self._move(self.time)
        self._ramp = VentRamp(self.time, np.array(value, dtype=float), duration)
        self._continue_vent()

    def rearm(self) -> bool:
        """Accept commands for the arms again; return whether the watchdog had tripped."""
        self.commands.reset_sequence()
        return self.watchdog.rearm()

    def settle(self) -> None:
        """Restart at the equilibrium, at the time at which schedule and rises are over.

        Raises:
            DivergenceError: There is no equilibrium; nothing changed.
        """
        self.simulation.settle()
        self.settings = replace(self.settings, settled=True)
        self._start()

    def reset(self) -> None:
        """Restart at the scene's start: state, inputs, sensors and their noise; counters stay."""
        self.simulation.reset()
        self.settings = replace(self.settings, settled=False)
        self.watchdog.reset()
        self.commands.reset_sequence()
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
    def _next_report(self) -> float:
        return min(source.next_time for source in self._sources)

    def _start(self) -> None:
        self.time = self.simulation.time
        self._ramp = None
        self._wrenches.clear()
        self.solver_report.restart()
        self._first_report = True
        for source in self._sources:
            source.start(self.time)

    def _move(self, time: float) -> None:
        if time > self.simulation.time:
            self.simulation.advance_to(time)

    def _go_to(self, time: float) -> None:
        # Two times of one nanosecond are one in a bag: a replay acts at the first of them.
        if nanoseconds(time) > nanoseconds(self.time):
            self._move(time)
            self.time = time

    def _apply_wrenches(self) -> None:
        for profile, fraction in self._wrenches.take(self.time):
            self._hold_wrench(profile.frame, *profile.at(fraction))

    def _report_transforms(self, time: float, state: State) -> None:
        if self._first_report:
            self._first_report = False
            self._reports.report_static(time)
        self._reports.report_transforms(time, state)

    def _report_state(self, time: float, state: State) -> None:
        self._reports.report_state(time, state)
        self._report_solver(time)
        self._continue_vent()

    def _report_health(self, time: float, state: State) -> None:
        self.emit_diagnostics("ldcs_sim", self.statuses())

    def _report_solver(self, time: float) -> None:
        if self._report.count % max(1, round(self.settings.publish_rate / SOLVER_STATUS_RATE)):
            return
        if not (self.settings.full_precision or self._has_subscribers("solver_status")):
            return
        counts = {"overruns": self.overruns, "refused": sum(self.commands.refused.values())}
        message = self.solver_report.build(nanoseconds(time), self.simulation, **counts)
        self.emit(self.topics["solver_status"], message, nanoseconds(time))

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
        # The command of the arms in standard types, so that a bag can be replayed without ldcs_msgs.
        inputs, now = self.simulation.inputs, nanoseconds(self.time)
        if inputs.pressure is not None:
            self.emit(TOPICS["pressure_command"], messages.pressure_command(inputs.pressure), now)
        elif inputs.torque is not None:
            values = inputs.torque.ravel()[self.simulation.joint_index]
            torque = messages.torque_command(now, self.simulation.joint_names, values)
            self.emit(TOPICS["torque_command"], torque, now)

    def _clear_wrench(self, frame: str) -> None:
        self._move(self.time)
        self._hold_wrench(frame, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def _hold_wrench(self, frame: str, force: Sequence[float], torque: Sequence[float]) -> None:
        self.commands.hold_wrench(frame, force, torque)
        now = nanoseconds(self.time)
        message = messages.wrench_command(now, self.frames.named(frame), force, torque)
        self.emit(TOPICS["external_wrench"], message, now)

    def _vented(self, topic: str) -> Refusal:
        refusal = Refusal("vented", "the watchdog vented the arms; call rearm, then send commands in time")
        self.commands.refuse(refusal, topic)
        return refusal
