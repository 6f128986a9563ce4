"""The starts by which a run is differentiated: coordinates and rates of nodes, natural modes, and profiles."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.physics.model import Model
from ldcs_ros.physics.points import point_at
from ldcs_ros.simulation.command_directions import AXES, OperatingPoint
from ldcs_ros.simulation.linear_model import natural_modes, stiffness_and_damping

_START = re.compile(r"^start\.(position|velocity)\.(?:mode_(\d+)|(\w+)\.([xyz]))$")


@dataclass(frozen=True)
class StartProfile:
    """A change of a run's start, by which the run is differentiated.

    Attributes:
        name: Its name.
        position: Change of the free coordinates per unit of the profile, shape (n_free,).
        velocity: Change of their rates, same shape.
    """

    name: str
    position: np.ndarray
    velocity: np.ndarray


class StartColumns:
    """Coordinates and rates at the start of a run.

    Args:
        at: The start.
        columns: `start.position.node_top_8_4.z`, `start.velocity.mode_2`: a coordinate or rate of a free node, or a
            natural mode around the start, whose largest displacement is 1 m; or a profile.

    Attributes:
        names: Name of each column.
        units: SI unit of each column.
        q: Tangent of the coordinates at the start, shape (n_free, k).
        u: Tangent of the rates.

    Raises:
        ValueError: There is no such node or mode, or it is held.
    """

    def __init__(self, at: OperatingPoint, columns: Sequence[str | StartProfile]) -> None:
        names = [one if isinstance(one, str) else one.name for one in columns]
        self.names, n = tuple(names), len(at.model.free)
        matches = [_START.match(one) if isinstance(one, str) else None for one in columns]
        modes = [0 if match is None else int(match[2] or 0) for match in matches]
        shapes = start_modes(at, max(modes)) if 0 < max(modes, default=0) <= n else np.zeros((n, 0))
        self.q, self.u = np.zeros((n, len(names))), np.zeros((n, len(names)))
        units = []
        for k, (one, name, match, mode) in enumerate(zip(columns, names, matches, modes, strict=True)):
            if isinstance(one, StartProfile):
                self.q[:, k], self.u[:, k] = one.position, one.velocity
                units.append("")
                continue
            if match is None or (match[2] is not None and not 1 <= mode <= n):
                raise ValueError(
                    f"got {name!r}, expected start.position or start.velocity of mode_1 to mode_{n} "
                    "or of node_<layer>_<i>_<j>.<axis>"
                )
            is_position = match[1] == "position"
            column = shapes[:, mode - 1] if mode else _of_node(at.model, name, match[3], match[4])
            (self.q if is_position else self.u)[:, k] = column
            units.append("m" if is_position else "m/s")
        self.units = tuple(units)


def start_modes(at: OperatingPoint, count: int) -> np.ndarray:
    """Return the lowest natural modes around a state, shape (n_free, count).

    The largest displacement of each is 1 m.
    """
    by_q, _ = stiffness_and_damping(at.model, at.time, at.q, 0.0 * at.u, at.now)
    shapes = natural_modes(at.model, at.q, by_q, count)[1]
    nodes = shapes[: at.model.n_free_nodes]
    largest = np.take_along_axis(nodes, np.abs(nodes).argmax(axis=0)[None], axis=0)
    return np.asarray(shapes / np.where(largest == 0.0, 1.0, largest))


def _of_node(model: Model, name: str, node: str, axis: str) -> np.ndarray:
    nodes = point_at(model.lattice, node, model.points).nodes
    coordinate = 3 * int(nodes[0]) + AXES.index(axis)
    column = (model.free == coordinate).astype(float)
    if len(nodes) > 1 or not column.any():
        raise ValueError(f"got {name!r}, expected a node that is free along {axis}")
    return column
