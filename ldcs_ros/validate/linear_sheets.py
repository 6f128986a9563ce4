"""Small displacements of a scene's sheet under held coordinates and forces: strips and plates with any supports."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse.linalg import spsolve

from ldcs_ros.scene.load import load_scene
from ldcs_ros.simulation.linear_model import stiffness_and_damping
from ldcs_ros.validate import problems as p

Content = Mapping[str, object]


def sheet_content(
    size: tuple[float, float],
    nodes: tuple[int, int],
    point: dict[str, float],
    *effects: Content,
    **lattice: object,
) -> Content:
    """Return a scene of a sheet of the material, with a point P1.

    Args:
        size: Length and width [m].
        nodes: Nodes along them.
        point: Place of P1 [m].
        *effects: Effects beside the springs.
        **lattice: Further keys of the lattice.
    """
    return {
        "lattice": {"size": [*size, p.THICKNESS], "nodes": list(nodes), **lattice},
        "material": {"youngs_modulus": p.YOUNGS_MODULUS, "poisson": p.POISSON, "density": p.DENSITY},
        "points": {"P1": point},
        "effects": [{"type": "springs"}, *effects],
    }


class LinearSheet:
    """The sheet of a scene without arms at rest, with its stiffness around the flat shape.

    Attributes:
        lattice: Its lattice.
        place: Node positions in ldcs_base [m], shape (n_nodes, 3).
        node_mass: Mass of each node [kg], shape (n_nodes,); 0 where a hole is.
    """

    def __init__(self, content: Content) -> None:
        simulation = load_scene(dict(content)).build()
        model = simulation.model
        self.lattice, self.node_mass = model.lattice, model.node_mass
        self.place = model.lattice.reference_position
        self._free = model.free
        self._flat = np.zeros(3 * model.lattice.n_nodes)
        q, u = model.reference_state()
        by_position, _ = stiffness_and_damping(model, 0.0, q, u, simulation.inputs.held())
        self._stiffness = (-by_position).tocsc()

    def displacement(self, held: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the displacement of the nodes [m], shape (n_nodes, 3).

        Args:
            held: Coordinates that do not move, beside those that the scene holds.
            force: Force on each node [N], shape (n_nodes, 3).
        """
        moving = np.flatnonzero(~np.isin(self._free, held))
        moved = self._flat.copy()
        chosen = self._free[moving]
        moved[chosen] = spsolve(self._stiffness[moving][:, moving], force.ravel()[chosen])
        return moved.reshape(-1, 3)

    def energy(self, displacement: np.ndarray) -> float:
        """Return the elastic energy of given displacements [J]; they have shape (n_nodes, 3) [m]."""
        moved = displacement.ravel()[self._free]
        return float(0.5 * moved @ (self._stiffness @ moved))

    def nodes(self, x: float | None = None, y: float | None = None) -> np.ndarray:
        """Return the nodes on lines of the flat sheet [m], of both layers, that no hole cuts out, shape (n,)."""
        near = np.ones(len(self.place), dtype=bool)
        for axis, value in enumerate((x, y)):
            if value is not None:
                near &= np.abs(self.place[:, axis] - value) < 1e-6
        near[self.lattice.missing] = False
        return np.flatnonzero(near)

    def pull(self, x: float, stress: float) -> np.ndarray:
        """Return the nodes' forces of a stress along x [Pa] on the whole edge at x, shape (n_nodes, 3)."""
        force, edge = np.zeros_like(self.place), self.nodes(x)
        height = self.lattice.spacing[1] * np.where(
            np.abs(self.place[edge, 1]) > 0.5 * self._width - 1e-9, 0.5, 1.0
        )
        force[edge, 0] = stress * 0.5 * self.lattice.size[2] * height
        return force

    @property
    def _width(self) -> float:
        return self.lattice.size[1]


def stretched(sheet: LinearSheet) -> np.ndarray:
    """Return the displacement [m], shape (n_nodes, 3), of a sheet pulled to a mean strain of 1 without its holes.

    The ends move freely across; only rigid motion is held.
    """
    length = sheet.lattice.size[0]
    force = sheet.pull(length, p.YOUNGS_MODULUS) - sheet.pull(0.0, p.YOUNGS_MODULUS)
    middle, far = sheet.nodes(0.0, 0.0)[0], sheet.nodes(length, 0.0)[0]
    corner = sheet.nodes(0.0, 0.5 * sheet.lattice.size[1])[0]
    held = [3 * middle, 3 * middle + 1, 3 * middle + 2, 3 * far + 1, 3 * far + 2, 3 * corner + 2]
    return sheet.displacement(np.array(held), force)


def stress_concentration(sheet: LinearSheet) -> float:
    """Return the strain at the side of the hole over the mean strain: that of the springs along it beside its node."""
    moved, middle = stretched(sheet), 0.5 * p.LENGTH
    dx = sheet.lattice.spacing[0]
    before, after = (moved[sheet.nodes(middle + s * dx, p.HOLE_RADIUS), 0].mean() for s in (-1.0, 1.0))
    return float((after - before) / (2.0 * dx))


def strain_beside_hole(sheet: LinearSheet) -> float:
    """Return the mean strain along the pull over the hole's diameter, on the line that touches its side."""
    moved, middle = stretched(sheet), 0.5 * p.LENGTH
    before, after = (
        moved[sheet.nodes(middle + s * p.HOLE_RADIUS, p.HOLE_RADIUS), 0].mean() for s in (-1.0, 1.0)
    )
    return float((after - before) / (2.0 * p.HOLE_RADIUS))


def hole_elongation(sheet: LinearSheet) -> float:
    """Return the elongation of the hole along the pull over its diameter, a mean strain."""
    moved, middle = stretched(sheet), 0.5 * p.LENGTH
    before, after = (moved[sheet.nodes(middle + s * p.HOLE_RADIUS, 0.0), 0].mean() for s in (-1.0, 1.0))
    return float((after - before) / (2.0 * p.HOLE_RADIUS))


def extension(sheet: LinearSheet) -> float:
    """Return the mean extension of a stretched sheet over its length, a mean strain."""
    moved, length = stretched(sheet), sheet.lattice.size[0]
    weight = np.where(np.abs(sheet.place[:, 1]) > 0.5 * sheet.lattice.size[1] - 1e-9, 0.5, 1.0)
    first, last = (sheet.nodes(x) for x in (0.0, length))
    ends = [np.average(moved[nodes, 0], weights=weight[nodes]) for nodes in (first, last)]
    return float((ends[1] - ends[0]) / length)


def sag(sheet: LinearSheet) -> float:
    """Return the displacement of the tip under the sheet's own weight [m], for an acceleration of 1 m/s^2 along -z."""
    force = np.zeros_like(sheet.place)
    force[:, 2] = -sheet.node_mass
    moved = sheet.displacement(np.zeros(0), force)
    return float(moved[sheet.nodes(sheet.lattice.size[0], 0.0), 2].mean())


def simply_supported(sheet: LinearSheet) -> float:
    """Return the deflection [m] of a plate on hinged edges under 1 N in its middle."""
    length, width = sheet.lattice.size[:2]
    edges = [
        sheet.nodes(0.0),
        sheet.nodes(length),
        sheet.nodes(None, 0.5 * width),
        sheet.nodes(None, -0.5 * width),
    ]
    middle = sheet.nodes(0.5 * length, 0.0)
    first, second = sheet.nodes(0.0, 0.0)[0], sheet.nodes(length, 0.0)[0]
    held = np.concatenate([3 * np.concatenate(edges) + 2, [3 * first, 3 * first + 1, 3 * second + 1]])
    force = np.zeros_like(sheet.place)
    force[middle, 2] = 1.0 / len(middle)
    return float(sheet.displacement(np.unique(held), force)[middle, 2].mean())


def shear_modulus(sheet: LinearSheet) -> float:
    """Return the in-plane shear modulus [Pa]: the energy of a uniform shear."""
    moved = np.zeros_like(sheet.place)
    moved[:, 0] = sheet.place[:, 1]
    return 2.0 * sheet.energy(moved) / float(np.prod(sheet.lattice.size))


def bending_over_stretching(sheet: LinearSheet) -> float:
    """Return the bending stiffness of a strip over E t^3 / 12 with the E of its own extension.

    A moment at both ends bends it, without any support across.
    """
    length, width, thickness = sheet.lattice.size
    modulus = p.YOUNGS_MODULUS / extension(sheet)
    force = sheet.pull(length, 1.0) - sheet.pull(0.0, 1.0)
    force[:, 0] *= np.sign(sheet.place[:, 2])
    moment = float(np.sum(force[sheet.nodes(length), 0] * sheet.place[sheet.nodes(length), 2]))
    middle, far, corner = (
        sheet.nodes(0.0, 0.0)[0],
        sheet.nodes(length, 0.0)[0],
        sheet.nodes(0.0, 0.5 * width)[0],
    )
    held = [3 * middle, 3 * middle + 1, 3 * middle + 2, 3 * far + 1, 3 * far + 2, 3 * corner + 2]
    moved = sheet.displacement(np.array(held), force)
    turn = []
    for x in (0.0, length):
        bottom, top = sheet.nodes(x, 0.0)  # in the order of the layers
        turn.append((moved[top, 0] - moved[bottom, 0]) / thickness)
    curvature = (turn[1] - turn[0]) / length
    return abs(moment / curvature) / (modulus * width * thickness**3 / 12.0)
