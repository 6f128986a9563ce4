"""The two-layer lattice of point masses: nodes, springs, rest shape and masses; it never changes during a run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

LAYERS = ("bottom", "top")
EDGES = ("x_min", "x_max", "y_min", "y_max")


@dataclass(frozen=True)
class Lattice:
    """Two layers of nx x ny nodes, joined by springs to every neighbour (paper, section II and Figure 2).

    A node has up to 8 neighbours in its layer and 9 in the other: the one straight across and its 8 neighbours.
    That is 17 springs in the interior, 11 on an edge, 7 at a corner, and 1169 in all at 9 x 9.
    Node order: layer (bottom, top), then i along x, then j along y.
    Frame `ldcs_base`: the origin is the middle of the edge x = 0 on the mid-plane.

    Attributes:
        size: Length along x, width along y, distance between the layers [m].
        nodes: Number of nodes along x and y.
        mass: Mass of the whole sheet [kg].
        mass_by_area: Distribute the mass by the area of each node; otherwise equally, as the paper does.
    """

    size: tuple[float, float, float]
    nodes: tuple[int, int]
    mass: float
    mass_by_area: bool = False

    @property
    def n_nodes(self) -> int:
        """Number of nodes in both layers."""
        return 2 * self.nodes[0] * self.nodes[1]

    @property
    def spacing(self) -> tuple[float, float]:
        """Distance of neighbours along x and along y [m]."""
        return self.size[0] / (self.nodes[0] - 1), self.size[1] / (self.nodes[1] - 1)

    def node(self, layer: str | int, i: int, j: int) -> int:
        """Return the index of a node; layer 'bottom' (0) or 'top' (1), i along x, j along y.

        Raises:
            ValueError: There is no such node.
        """
        level = LAYERS.index(layer) if isinstance(layer, str) else layer
        nx, ny = self.nodes
        if not (level in (0, 1) and 0 <= i < nx and 0 <= j < ny):
            raise ValueError(f"no node [{layer}, {i}, {j}] in a lattice of nodes: [{nx}, {ny}]")
        return (level * nx + i) * ny + j

    @cached_property
    def index(self) -> np.ndarray:
        """Node indices by place, shape (2, nx, ny)."""
        return np.arange(self.n_nodes).reshape(2, *self.nodes)

    @cached_property
    def reference_position(self) -> np.ndarray:
        """Positions of the flat, unloaded sheet in ldcs_base [m], shape (n_nodes, 3)."""
        (length, width, thickness), (nx, ny) = self.size, self.nodes
        z, x, y = np.meshgrid(
            np.array([-0.5, 0.5]) * thickness,
            np.linspace(0.0, length, nx),
            np.linspace(-0.5 * width, 0.5 * width, ny),
            indexing="ij",
        )
        return np.stack([x, y, z], axis=-1).reshape(-1, 3)

    @cached_property
    def node_mass(self) -> np.ndarray:
        """Mass of each node [kg], shape (n_nodes,)."""
        if self.mass_by_area:
            return self.mass * self.node_area / self.node_area.sum()
        return np.full(self.n_nodes, self.mass / self.n_nodes)

    @cached_property
    def node_area(self) -> np.ndarray:
        """Area of the sheet that belongs to each node [m^2], shape (n_nodes,); a layer sums to length x width."""
        dx, dy = self.spacing
        along_x, along_y = np.full(self.nodes[0], dx), np.full(self.nodes[1], dy)
        along_x[[0, -1]] *= 0.5
        along_y[[0, -1]] *= 0.5
        return np.tile(np.outer(along_x, along_y).ravel(), 2)

    @cached_property
    def springs(self) -> np.ndarray:
        """Node pairs (a, b) of all springs, shape (n_springs, 2), a < b, sorted."""
        nx, ny = self.nodes
        pairs = []
        for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
            start, stop = max(0, -dj), ny - max(0, dj)
            near = self.index[:, : nx - di, start:stop]
            far = self.index[:, di:, start + dj : stop + dj]
            pairs += [np.stack([near, far], axis=-1).reshape(-1, 2)]
            # The same offset and its opposite, from the bottom layer to the top one.
            pairs += [np.stack([near[0], far[1]], axis=-1).reshape(-1, 2)]
            pairs += [np.stack([far[0], near[1]], axis=-1).reshape(-1, 2)]
        pairs += [np.stack([self.index[0], self.index[1]], axis=-1).reshape(-1, 2)]
        springs = np.sort(np.concatenate(pairs), axis=1)
        return springs[np.lexsort((springs[:, 1], springs[:, 0]))]

    @cached_property
    def rest_vector(self) -> np.ndarray:
        """Vector from a to b of each spring at rest [m], shape (n_springs, 3)."""
        a, b = self.springs.T
        return self.reference_position[b] - self.reference_position[a]

    @cached_property
    def rest_length(self) -> np.ndarray:
        """Length of each spring at rest [m], shape (n_springs,)."""
        return np.linalg.norm(self.rest_vector, axis=1)

    def edge(self, name: str) -> np.ndarray:
        """Return the nodes of an edge in both layers, shape (2 * nodes along it,)."""
        picked = {
            "x_min": self.index[:, 0, :],
            "x_max": self.index[:, -1, :],
            "y_min": self.index[:, :, 0],
            "y_max": self.index[:, :, -1],
        }[name]
        return picked.ravel()
