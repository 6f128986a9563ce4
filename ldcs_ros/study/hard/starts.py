"""Shapes to start from: what a sheet looks like after an accident."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ldcs_ros.physics.lattice import Lattice


def inverted(lattice: Lattice) -> np.ndarray:
    """Top and bottom exchanged; shape (n_nodes, 3) [m], as all starts."""
    return lattice.rest_position * [1.0, 1.0, -1.0]


def turned_over(lattice: Lattice) -> np.ndarray:
    """Turned by half a turn about the x axis: no mirror image, left and right exchanged too."""
    return lattice.rest_position * [1.0, -1.0, -1.0]


def crumpled(lattice: Lattice) -> np.ndarray:
    """Every coordinate off by up to half a spacing at random."""
    random = np.random.default_rng(4)
    reach = 0.5 * np.array([*lattice.spacing, min(lattice.spacing)])
    return lattice.rest_position + random.uniform(-1.0, 1.0, (lattice.n_nodes, 3)) * reach


def ruffled(lattice: Lattice) -> np.ndarray:
    """Every coordinate off by up to a tenth of its spacing at random."""
    random = np.random.default_rng(5)
    reach = 0.1 * np.array([*lattice.spacing, lattice.size[2]])
    return lattice.rest_position + random.uniform(-1.0, 1.0, (lattice.n_nodes, 3)) * reach


def two_coincident(lattice: Lattice) -> np.ndarray:
    """Two neighbours of the top layer at the very same place."""
    position = lattice.rest_position.copy()
    nx, ny = lattice.nodes
    position[lattice.node("top", nx // 2, ny // 2)] = position[lattice.node("top", nx // 2 - 1, ny // 2)]
    return position


def in_plane(lattice: Lattice) -> np.ndarray:
    """All nodes in the plane z = 0, each on its partner of the other layer."""
    return lattice.rest_position * [1.0, 1.0, 0.0]


def on_line(lattice: Lattice) -> np.ndarray:
    """All nodes on the x axis, each on many others."""
    return lattice.rest_position * [1.0, 0.0, 0.0]


def in_one_point(lattice: Lattice) -> np.ndarray:
    """All nodes in one point."""
    return np.tile([0.5 * lattice.size[0], 0.0, 0.0], (lattice.n_nodes, 1))


def rolled_up(lattice: Lattice) -> np.ndarray:
    """Rolled once and a half around the y axis, at the sheet's own length."""
    x, y, z = lattice.rest_position.T
    kappa = 3.0 * np.pi / lattice.size[0]
    return np.stack(
        [(1 / kappa - z) * np.sin(kappa * x), y, 1 / kappa - (1 / kappa - z) * np.cos(kappa * x)], 1
    )


STARTS: dict[str, Callable[[Lattice], np.ndarray]] = {
    start.__name__: start
    for start in (
        inverted,
        turned_over,
        crumpled,
        ruffled,
        two_coincident,
        in_plane,
        on_line,
        in_one_point,
        rolled_up,
    )
}
