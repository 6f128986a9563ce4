"""The workspace of a point: where it rests under commands all over their bounds."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.physics.points import point_at
from ldcs_ros.reach.reach import Variable, commands_of
from ldcs_ros.reach.rest_states import RestStates
from ldcs_ros.simulation.sensitivity import positions
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread

MOST_LEVELS = 15
"""Values of each command at most; fewer where there are many commands."""
MOST_STATES = 600
MOST_VARIABLES = 9


@dataclass(frozen=True)
class Workspace:
    """Rest positions of a point under a grid of commands.

    Attributes:
        place: The point.
        variables: The commands that vary.
        levels: Number of values of each command, evenly spaced from bound to bound.
        position: Positions in ldcs_base [m], shape (levels, ..., levels, 3), an axis for each variable; NaN where no
            rest state was found.
    """

    place: str
    variables: tuple[Variable, ...]
    levels: int
    position: np.ndarray

    @property
    def failed(self) -> int:
        """Number of commands without a rest state."""
        return int(np.isnan(self.position[..., 0]).sum())

    @property
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest coordinates [m], shape (3,) each."""
        flat = self.position.reshape(-1, 3)
        return np.nanmin(flat, axis=0), np.nanmax(flat, axis=0)


def workspace(simulation: Simulation, place: str, variables: Sequence[Variable]) -> Workspace:
    """Return where a point rests under a grid of commands, on the branch of the present rest state.

    Args:
        simulation: The simulation; it stays as it is.
        place: A point of the scene, or `node_<layer>_<i>_<j>`.
        variables: What varies, and within which bounds: 1 to 9 commands.

    Raises:
        ValueError: A name or a number of variables is not sound.
        DivergenceError: There is no rest state under any of the commands.
    """
    at = simulation.operating_point()
    point = point_at(at.model.lattice, place, at.model.points)
    commands = commands_of(at, variables)
    count = len(commands)
    if count > MOST_VARIABLES:
        raise ValueError(f"got {count} variables, expected 1 ... {MOST_VARIABLES}")
    levels = max(2, min(MOST_LEVELS, int(MOST_STATES ** (1.0 / count) + 1e-9)))
    position = np.full((*[levels] * count, 3), np.nan)
    low = np.array([variable.low for variable in variables])
    step = (np.array([variable.high for variable in variables]) - low) / (levels - 1)
    with one_thread():
        states = RestStates(at, commands)
        for index in _there_and_back(levels, count):
            try:
                states.go_to(low + np.array(index) * step)
            except DivergenceError:
                continue
            position[index] = positions([point], states.q)
    found = Workspace(place, tuple(variables), levels, position)
    if found.failed == levels**count:
        raise DivergenceError("the scene comes to rest under none of the commands; narrow their bounds")
    return found


def _there_and_back(levels: int, count: int) -> Iterator[tuple[int, ...]]:
    """Yield all places of a grid such that neighbours follow each other: every second line runs backwards."""
    for index in itertools.product(range(levels), repeat=count):
        turned = list(index)
        for axis in range(1, count):
            # The parity of the lines before: the sum of the places that were really visited.
            if sum(turned[:axis]) % 2:
                turned[axis] = levels - 1 - index[axis]
        yield tuple(turned)
