"""`Schedule`: the events that a simulation knows beforehand: commands, their course, changes of the valves."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ldcs_ros.errors import CommandError, SceneError
from ldcs_ros.physics.inputs import HeldCommands, ScheduledCommand
from ldcs_ros.physics.model import Model, Motion
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.inputs import Inputs

if TYPE_CHECKING:
    # Loaded where enough commands are known to make a course.
    from ldcs_ros.physics.drive_curve import DriveCurve
    from ldcs_ros.simulation.known_course import KnownCourse

# A course of fewer commands is not worth its preparation.
FEWEST_COMMANDS = 10


class Schedule:
    """The commands of a scene, given to the inputs at their times, and the valves that follow commands after a delay.

    Where commands of the arms follow a smooth course, a drive curve acts instead of the held commands, and the
    schedule then has no event before that stretch of the course ends.

    Args:
        commands: The scene's commands, their times rising.
        inputs: The inputs that take them.

    Attributes:
        position: Index of the next command.
        announced: Commands that come from outside, their times rising.
        course: The known course; None if there is none, or before `prepare`.
        is_prepared: The course is that of the present commands.
    """

    def __init__(self, commands: Sequence[ScheduledCommand], inputs: Inputs) -> None:
        self._commands, self._inputs = commands, inputs
        self._wrench_times = [command.time for command in commands if command.wrench is not None]
        self.position = 0
        self.announced: tuple[ScheduledCommand, ...] = ()
        self.course: KnownCourse | None = None
        self.is_prepared = False

    def prepare(self, model: Model, motion: Motion, accuracy: float | None) -> None:
        """Find the course of the commands after a motion at an accuracy [m]; None for commands that are held."""
        self.course, self.is_prepared = None, True
        coming = self._commands[self.position :]
        if accuracy is not None and len(coming) + len(self.announced) >= FEWEST_COMMANDS:
            from ldcs_ros.simulation.known_course import known_course

            self.course = known_course(model, motion, self._inputs, coming, self.announced, accuracy)

    def forget_course(self) -> None:
        """Leave the course; `prepare` may find another one."""
        self.course, self.is_prepared = None, False

    def curve(self, time: float, held: HeldCommands) -> DriveCurve | None:
        """Return the drive curve that acts from a time on [s]; None for held commands.

        A command that is not that of the course ends it.
        """
        course = self.course
        if course is None:
            return None
        k = course.interval(time)
        if not course.agrees(k, held):
            self.course = None
            return None
        return course.curve if course.is_smooth[k] else None

    def interval_length(self, time: float) -> float:
        """Return the length of the interval of the course before a time [s]; infinity without one."""
        k = -1 if self.course is None else self.course.interval(time)
        return math.inf if self.course is None or k < 1 else self.course.knots[k] - self.course.knots[k - 1]

    def difference(self, curve: DriveCurve | None) -> tuple[float, float]:
        """Return what a curve makes of a node's position [m] and velocity [m/s] in the present stretch, estimated."""
        if curve is None or self.course is None:
            return 0.0, 0.0
        k = self.course.interval(self._inputs.time)
        return float(self.course.difference[k]), float(self.course.speed[k])

    def next_event(self, curve: DriveCurve | None = None) -> float:
        """Return the time of the next event [s], infinity without one; a curve passes all but wrenches."""
        if curve is not None and self.course is not None:
            time = self._inputs.time
            k = bisect_right(self._wrench_times, time + TIME_TOLERANCE)
            wrench = self._wrench_times[k] if k < len(self._wrench_times) else math.inf
            return min(float(self.course.ends[self.course.interval(time)]), wrench)
        command = self._commands[self.position].time if self.position < len(self._commands) else math.inf
        return min(command, self._inputs.next_valve_change())

    @property
    def is_announced(self) -> bool:
        """Whether there is a course whose commands have to come from outside."""
        return self.course is not None and self.course.is_announced

    def next_announced(self, time: float) -> float:
        """Return the next time [s] at which an announced command has to have come; infinity without one."""
        course = self.course
        return course.next_knot(time) if course is not None and course.is_announced else math.inf

    def run_events(self, time: float) -> None:
        """Change the valves and give the commands due at a time [s], each at its own; raises as `run_commands`."""
        while True:
            valve = self._inputs.next_valve_change()
            command = self._commands[self.position].time if self.position < len(self._commands) else math.inf
            if min(valve, command) > time + TIME_TOLERANCE:
                return
            if valve <= command + TIME_TOLERANCE:
                self._inputs.apply_valve_change()
            else:
                self._give_next(time)

    def run_commands(self, time: float) -> None:
        """Give the commands that are due at a time [s].

        Raises:
            SceneError: The inputs refuse one; the message names its place in the scene.
        """
        while (
            self.position < len(self._commands)
            and self._commands[self.position].time <= time + TIME_TOLERANCE
        ):
            self._give_next(time)

    def _give_next(self, time: float) -> None:
        index, self.position = self.position, self.position + 1
        command = self._commands[index]
        # A command that is passed inside a stretch acts at its own time.
        due = command.time if command.time < time - TIME_TOLERANCE else None
        try:
            self._inputs.apply_scheduled(command, due)
        except CommandError as error:
            raise SceneError(f"{error} @ inputs[{index}]") from error
