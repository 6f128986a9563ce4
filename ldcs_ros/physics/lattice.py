"""The two-layer lattice of point masses: nodes, springs, rest shape and masses; it never changes during a run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ldcs_ros.physics.shapes import PlaneShape, SheetRegion

LAYERS = ("bottom", "top")
EDGES = ("x_min", "x_max", "y_min", "y_max")
# Places nearer to a line of nodes, in cells, or to an outline, in lengths of the sheet, are on it: rounding only.
ROUNDING = 1e-9
# Samples along each side of a cell from which the area that a hole leaves of it is taken.
SAMPLES = 8


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
        mass: Mass of the whole sheet before holes are cut and regions are applied [kg].
        mass_by_area: Distribute the mass by the area of each node and its thickness; otherwise equally, as the
            paper does.
        holes: Shapes whose inside is cut out; nodes on their outline stay if they have a whole cell.
        regions: Parts with factors on stiffness, damping, mass and thickness.
    """

    size: tuple[float, float, float]
    nodes: tuple[int, int]
    mass: float
    mass_by_area: bool = False
    holes: tuple[PlaneShape, ...] = ()
    regions: tuple[SheetRegion, ...] = ()

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
        place = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        if any(region.thickness != 1.0 for region in self.regions):
            place[:, 2] *= self._node_factor("thickness")
        return place

    @cached_property
    def node_mass(self) -> np.ndarray:
        """Mass of each node [kg], shape (n_nodes,)."""
        if self.mass_by_area:
            mass = self.mass * self.node_area / self.node_area.sum()
            mass *= self._node_factor("whole", "thickness", "mass")
        else:
            mass = np.full(self.n_nodes, self.mass / self.n_nodes)
            if self.regions:
                mass *= self._node_factor("mass")
        mass[self.missing] = 0.0
        return mass

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
        springs = springs[np.lexsort((springs[:, 1], springs[:, 0]))]
        if self.missing.size:
            springs = springs[~np.isin(springs, self.missing).any(axis=1)]
        return springs

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

    # -- places in metres, holes and regions

    def covers(self, x: float, y: float) -> bool:
        """Return whether a place of the flat sheet [m] is on it; its outline is."""
        length, width = self.size[:2]
        slack = ROUNDING * max(length, width)
        return -slack <= x <= length + slack and abs(y) <= 0.5 * width + slack

    def outside(self, x: float, y: float) -> str:
        """Return what is wrong with a place [m] that the sheet does not cover."""
        length, width = self.size[:2]
        return (
            f"got x = {x:g}, y = {y:g} m, expected a place on the sheet, x in 0 ... {length:g}, "
            f"y in {-0.5 * width:g} ... {0.5 * width:g} m"
        )

    def bilinear(self, layer: int, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the cell around a place of the flat sheet and their weights, shape (4,) each.

        The order is (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1); on a line of nodes two weights are 0.

        Args:
            layer: 0 for the bottom layer, 1 for the top one.
            x: Coordinate along the sheet [m].
            y: Coordinate across it [m].

        Raises:
            ValueError: The place is outside of the sheet or in a hole.
        """
        if not self.covers(x, y):
            raise ValueError(self.outside(x, y))
        (i, i_next, fx), (j, j_next, fy) = (
            _cell(x / self.size[0], self.nodes[0]),
            _cell(y / self.size[1] + 0.5, self.nodes[1]),
        )
        corners = self.index[layer][[i, i_next, i, i_next], [j, j, j_next, j_next]]
        weights = np.array([(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy])
        if self.missing.size and np.isin(corners[weights > 0.0], self.missing).any():
            raise ValueError(f"got x = {x:g}, y = {y:g} m, expected a place outside of the holes")
        return corners, weights

    @cached_property
    def missing(self) -> np.ndarray:
        """Nodes of both layers inside of holes, and those that no whole cell is left of, sorted, shape (n_missing,).

        Raises:
            ValueError: The holes leave nothing, or cut the sheet into pieces.
        """
        kept = self._whole_cells
        if kept is None:
            return np.zeros(0, dtype=np.int64)
        near = np.pad(kept, 1)
        corner = near[1:, 1:] | near[1:, :-1] | near[:-1, 1:] | near[:-1, :-1]
        _check_in_one_piece(corner)
        return np.flatnonzero(np.tile(~corner.ravel(), 2))

    @cached_property
    def column_neighbours(self) -> np.ndarray:
        """Columns ahead and before along x, then along y, of each column, shape (nx ny, 4).

        Where the sheet ends, at an edge or at a hole, a column is its own neighbour.
        """
        column = np.arange(self.nodes[0] * self.nodes[1])
        i, j = np.divmod(column, self.nodes[1])
        last_i, last_j = self.nodes[0] - 1, self.nodes[1] - 1
        places = (
            (np.minimum(i + 1, last_i), j),
            (np.maximum(i - 1, 0), j),
            (i, np.minimum(j + 1, last_j)),
            (i, np.maximum(j - 1, 0)),
        )
        neighbours = np.stack([self.index[0][place] for place in places], axis=1)
        return np.where(np.isin(neighbours, self.missing), column[:, None], neighbours)

    @cached_property
    def _whole_cells(self) -> np.ndarray | None:
        # Cells without a corner inside of a hole, shape (nx - 1, ny - 1); None where there are no holes.
        if not self.holes:
            return None
        nx, ny = self.nodes
        x, y = np.meshgrid(
            np.linspace(0.0, self.size[0], nx), np.linspace(-0.5, 0.5, ny) * self.size[1], indexing="ij"
        )
        place, slack = np.stack([x.ravel(), y.ravel()], axis=1), ROUNDING * max(self.size)
        inside = np.any([hole.distance(place) < -slack for hole in self.holes], axis=0).reshape(nx, ny)
        cut: np.ndarray = inside[1:, 1:] | inside[1:, :-1] | inside[:-1, 1:] | inside[:-1, :-1]
        return ~cut

    @cached_property
    def _fraction_outside_holes(self) -> np.ndarray:
        (nx, ny), (dx, dy) = self.nodes, self.spacing
        if not self.holes:
            return np.ones((nx - 1, ny - 1))
        inside_cell = (np.arange(SAMPLES) + 0.5) / SAMPLES
        x = (np.arange(nx - 1)[:, None] + inside_cell).ravel() * dx
        y = (np.arange(ny - 1)[:, None] + inside_cell).ravel() * dy - 0.5 * self.size[1]
        place = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        outside = np.all([hole.distance(place) > 0.0 for hole in self.holes], axis=0)
        return np.asarray(outside.reshape(nx - 1, SAMPLES, ny - 1, SAMPLES).mean(axis=(1, 3)))

    def spring_factor(self, quantity: str) -> np.ndarray:
        """Return the factor of each spring by the cells that it belongs to, shape (n_springs,).

        Args:
            quantity: A factor of the regions: stiffness or damping.
        """
        return self.mean_of_cells(self.cell_factor(quantity))

    def mean_of_cells(self, cells: np.ndarray) -> np.ndarray:
        """Return the mean of cell values, shape (nx - 1, ny - 1), over the cells of each spring, shape (n_springs,)."""
        place = np.stack(np.unravel_index(self.springs, (2, *self.nodes)), axis=-1)[..., 1:]
        # A spring belongs to the cells that have both of its ends: one, two along a line of nodes, or four.
        first, last = place.max(axis=1) - 1, place.min(axis=1)
        return _mean_of_cells(cells, first, last)

    def _node_factor(self, *quantities: str) -> np.ndarray:
        cells = np.prod([self.cell_factor(quantity) for quantity in quantities], axis=0)
        node = np.stack(np.meshgrid(*map(np.arange, self.nodes), indexing="ij"), axis=-1).reshape(-1, 2)
        return np.tile(_mean_of_cells(cells, node - 1, node), 2)

    def cell_factor(self, quantity: str) -> np.ndarray:
        """Return the factor of each cell, shape (nx - 1, ny - 1).

        Args:
            quantity: A factor of the regions; whole for the fraction of the cell's area outside of the holes.
        """
        if quantity == "whole":
            return self._fraction_outside_holes
        # Factors of overlapping regions multiply.
        (length, width), (nx, ny) = self.size[:2], self.nodes
        x, y = np.meshgrid(
            (np.arange(nx - 1) + 0.5) * length / (nx - 1),
            (np.arange(ny - 1) + 0.5) * width / (ny - 1) - 0.5 * width,
            indexing="ij",
        )
        centre = np.stack([x.ravel(), y.ravel()], axis=1)
        factor = np.ones(len(centre))
        for region in self.regions:
            factor[region.shape.distance(centre) <= 0.0] *= getattr(region, quantity)
        return factor.reshape(nx - 1, ny - 1)


def _cell(fraction: float, n: int) -> tuple[int, int, float]:
    """Return the lines of n nodes before and after a fraction of a side, and the fraction of their distance."""
    cell = min(max(fraction * (n - 1), 0.0), n - 1.0)
    if abs(cell - round(cell)) < ROUNDING * n:
        cell = float(round(cell))
    before = math.floor(cell)
    return before, min(before + 1, n - 1), cell - before


def _mean_of_cells(cells: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    # First and last are the same cell or neighbours in each direction, shape (n, 2); those outside do not count.
    (i, j), (k, m) = np.maximum(first, 0).T, np.minimum(last, np.array(cells.shape) - 1).T
    return np.asarray(0.25 * ((cells[i, j] + cells[i, m]) + (cells[k, j] + cells[k, m])))


def _check_in_one_piece(kept: np.ndarray) -> None:
    # A spring joins neighbours, also along a diagonal.
    from scipy.ndimage import label

    pieces = label(kept, structure=np.ones((3, 3)))[1]
    if pieces != 1:
        raise ValueError(f"holes: got a sheet in {pieces} pieces, expected one")
