"""`Schedule`: the events that a simulation knows beforehand: scheduled commands of the scene, changes of the valves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ldcs_ros.errors import CommandError, SceneError
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.inputs import Inputs


class Schedule:
    """The commands of a scene, given to the inputs at their times, and the valves that follow commands after a delay.

    Args:
        commands: The scene's commands, their times rising.
        inputs: The inputs that take them.

    Attributes:
        position: Index of the next command.
    """

    def __init__(self, commands: Sequence[ScheduledCommand], inputs: Inputs) -> None:
        self._commands, self._inputs = commands, inputs
        self.position = 0

    def next_event(self) -> float:
        """Return the time of the next event [s], infinity without one."""
        command = self._commands[self.position].time if self.position < len(self._commands) else math.inf
        return min(command, self._inputs.next_valve_change())

    def run_events(self, time: float) -> None:
        """Change the valves and give the commands that are due at a time [s]; raises as `run_commands`."""
        while self._inputs.next_valve_change() <= time + TIME_TOLERANCE:
            self._inputs.apply_valve_change()
        self.run_commands(time)

    def run_commands(self, time: float) -> None:
        """Give the commands that are due at a time [s].

        Raises:
            SceneError: The inputs refuse one; the message names its place in the scene.
        """
        while (
            self.position < len(self._commands)
            and self._commands[self.position].time <= time + TIME_TOLERANCE
        ):
            index, self.position = self.position, self.position + 1
            try:
                self._inputs.apply_scheduled(self._commands[index])
            except CommandError as error:
                raise SceneError(f"{error} @ inputs[{index}]") from error
