"""The drives of a scene's arms as actions between -1 and 1, and the rest states under them."""

from __future__ import annotations

import numpy as np

from ldcs_ros.errors import SceneError
from ldcs_ros.physics.points import Point
from ldcs_ros.reach.rest_states import RestStates
from ldcs_ros.simulation.command_directions import command_directions
from ldcs_ros.simulation.sensitivity import positions
from ldcs_ros.simulation.simulation import Simulation


class Drives:
    """The commands of a simulation's arms.

    Args:
        simulation: A simulation at rest; it is moved by `hold`.
        point: The point that counts.
        fraction: The highest command as a fraction of the arms' limit.

    Attributes:
        names: `pressure.ARM` or `torque.ARM` of each arm.
        highest: Highest command of each arm [Pa or N m], shape (n_arms,); the lowest is 0.

    Raises:
        SceneError: The scene has no arms.
    """

    def __init__(self, simulation: Simulation, point: Point, fraction: float) -> None:
        arms = simulation.model.arms
        if arms is None:
            raise SceneError(f"{simulation.scene.name} has no arms, so there is nothing to command")
        self._simulation, self._point = simulation, point
        self.by_pressure = simulation.inputs.pressure is not None
        limits = [one.pressure_limit if self.by_pressure else one.torque_limit for one in arms.each]
        self.highest = fraction * np.array(limits)
        kind = "pressure" if self.by_pressure else "torque"
        self.names = tuple(f"{kind}.{arm}" for arm in simulation.arm_names)

    @property
    def count(self) -> int:
        """Number of arms."""
        return len(self.names)

    def command_of(self, action: np.ndarray) -> np.ndarray:
        """Return the commands of an action, shape (n_arms,); what is beyond -1 ... 1 is cut."""
        command: np.ndarray = 0.5 * self.highest * (np.clip(action, -1.0, 1.0) + 1.0)
        return command

    def action_of(self, command: np.ndarray) -> np.ndarray:
        """Return the action of some commands, shape (n_arms,)."""
        action: np.ndarray = 2.0 * command / self.highest - 1.0
        return action

    def hold(self, action: np.ndarray) -> None:
        """Command the arms by an action, shape (n_arms,), each in [-1, 1]."""
        command = self.command_of(action)
        if self.by_pressure:
            self._simulation.inputs.set_pressure(command)
        else:
            self._simulation.inputs.set_torque(command)

    def present(self) -> np.ndarray:
        """Return chamber pressure or torque of each arm as an action, shape (n_arms,)."""
        state = self._simulation.state
        if self.by_pressure:
            return self.action_of(state.pressure)
        return self.action_of(self._simulation.joint_torque[:, 0])

    def rest_positions(self, actions: np.ndarray) -> np.ndarray:
        """Return where the point rests under actions of shape (n, n_arms) [m], shape (n, 3).

        Raises:
            DivergenceError: There is no rest state.
        """
        at = self._simulation.operating_point()
        directions = [next(command_directions(at, name)) for name in self.names]
        states = RestStates(at, directions)
        found = []
        for action in actions:
            states.go_to(self.command_of(action))
            found.append(positions([self._point], states.q))
        return np.array(found)
