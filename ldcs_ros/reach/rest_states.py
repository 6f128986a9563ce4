"""Rest states under commands that change a little from one to the next, with their sensitivities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import linalg as sparse_linalg

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.simulation.command_directions import CommandDirection, OperatingPoint, force_slope
from ldcs_ros.simulation.equilibrium import equilibrium
from ldcs_ros.simulation.linear_model import stiffness_and_damping
from ldcs_ros.simulation.stability import Stability, stability

# A chord step below it is rounding [m, rad].
BALANCED = 1e-11
MOST_CHORDS = 25
# A chord step that shrinks by less asks for new factors.
SLOWEST_RATE = 0.5
MOST_FACTORS = 12
# A step beyond it leaves the branch [m, rad].
FARTHEST = 0.5


class RestStates:
    """The equilibrium of a model under commands, followed from one to the next.

    A prediction by the sensitivities and chord steps with kept factors find a near equilibrium in milliseconds; where
    they fail, the static solver takes over.

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
        self._factors = self._factors_at(self.q, self._base)
        self.q = self._newton(self.q, self._base)
        self._factor()

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
        """Move to the rest state under other values of the commands.

        Raises:
            DivergenceError: There is none near; nothing changed.
        """
        held = self.held(values)
        q = self._newton(self.q + self.moves @ (values - self.values), held)
        self.q, self.values = q, np.array(values)
        self._factor()

    def _newton(self, q: np.ndarray, held: HeldCommands) -> np.ndarray:
        free, factors = self._model.free, self._factors
        start = q.copy()
        for _ in range(MOST_FACTORS):
            before = np.inf
            for _ in range(MOST_CHORDS):
                move = -factors.solve(self._model.force(self._time, q, self._still, held))
                largest = float(np.abs(move).max())
                if not np.isfinite(largest) or largest > SLOWEST_RATE * before:
                    break
                q[free] += move
                if largest < BALANCED:
                    return q
                before = largest
            if not np.isfinite(largest) or largest > FARTHEST:
                break
            factors = self._factors_at(q, held)
        return equilibrium(self._model, start, self._time, held)

    def _factors_at(self, q: np.ndarray, held: HeldCommands) -> sparse_linalg.SuperLU:
        by_q, _ = stiffness_and_damping(self._model, self._time, q, self._still, held)
        return sparse_linalg.splu(by_q)

    def _factor(self) -> None:
        held = self.held(self.values)
        self._factors = self._factors_at(self.q, held)
        slopes = [
            force_slope(self._model, self._time, self.q, self._still, held, command)
            for command in self._commands
        ]
        self.moves = np.zeros((len(self.q), len(slopes)))
        self.moves[self._model.free] = -self._factors.solve(np.array(slopes).T)
