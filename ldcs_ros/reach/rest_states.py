"""Rest states under commands that change a little from one to the next, with their sensitivities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ldcs_ros.integrators.implicit.system import LinearSystem
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.simulation.command_directions import CommandDirection, OperatingPoint, force_slope
from ldcs_ros.simulation.equilibrium import LARGEST_STEP, equilibrium
from ldcs_ros.simulation.linear_model import rest_factors, stiffness_and_damping
from ldcs_ros.simulation.stability import Stability, stability


class RestStates:
    """The equilibrium of a model under commands, followed from one to the next.

    The static solver goes on from a prediction by the sensitivities, at first as Newton's method.

    Args:
        at: The state near the first equilibrium.
        commands: The commands that change; values count from 0.

    Attributes:
        values: Values of the commands, shape (n_commands,).
        q: Coordinates of the equilibrium [m, rad].
        moves: Their derivatives by the commands, shape (n_coordinates, n_commands).
    """

    def __init__(self, at: OperatingPoint, commands: Sequence[CommandDirection]) -> None:
        self._model, self._time = at.model, at.time
        self._commands = tuple(commands)
        self._base = at.held
        self.values = np.array([command.present(self._base) for command in commands])
        self.q = at.q.copy()
        self._still = np.zeros_like(self.q)
        self._system = LinearSystem(at.model)
        self.q = self._rest(self.q, self._base)
        self._find_moves()

    def held(self, values: np.ndarray) -> HeldCommands:
        """Return the commands with given values, shape (n_commands,)."""
        held = self._base
        for command, value in zip(self._commands, values, strict=True):
            held = command.apply(held, value - command.present(held))
        return held

    def stability(self) -> Stability:
        """Return the stability of the present rest state."""
        return stability(self._model, self.q, self._time, self.held(self.values))

    def go_to(self, values: np.ndarray) -> None:
        """Move to the rest state under other values of the commands, shape (n_commands,).

        Raises:
            DivergenceError: There is none near; nothing changed.
        """
        held = self.held(values)
        q = self._rest(self.q + self.moves @ (values - self.values), held)
        self.q, self.values = q, np.array(values)
        self._find_moves()

    def _rest(self, q: np.ndarray, held: HeldCommands) -> np.ndarray:
        return equilibrium(self._model, q, self._time, held, first_step=LARGEST_STEP, system=self._system)

    def _find_moves(self) -> None:
        held = self.held(self.values)
        by_q, _ = stiffness_and_damping(self._model, self._time, self.q, self._still, held)
        slopes = [
            force_slope(self._model, self._time, self.q, self._still, held, command)
            for command in self._commands
        ]
        self.moves = np.zeros((len(self.q), len(slopes)))
        self.moves[self._model.free] = -rest_factors(by_q).solve(np.array(slopes).T)
