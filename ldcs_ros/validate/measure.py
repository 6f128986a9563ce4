"""The measured quantities of an equilibrium: displacement of the points, radius of the actuated edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.scene import Scene, load_scene
from ldcs_ros.simulation.simulation import Simulation

MM = 1e3

RADIUS_METHOD = (
    "least-squares circle in the XZ plane through the mid-line of an actuated edge: the means of bottom and top "
    "node of each lattice column, the clamped one included, left and right edge averaged"
)


@dataclass(frozen=True)
class Rest:
    """A scene at its equilibrium.

    Attributes:
        displacement: From the flat sheet, in ldcs_base [mm], shape (3,), by point.
        radius: Of the actuated edges [m], by `RADIUS_METHOD`; negative if they bend down.
        roundness: Root mean square distance of the edges' mid-lines from their circles [m].
        position: Node positions [m], shape (n_nodes, 3).
        simulation: The simulation at its equilibrium.
    """

    displacement: dict[str, np.ndarray]
    radius: float
    roundness: float
    position: np.ndarray
    simulation: Simulation


def at_rest(content: dict[str, Any] | Scene) -> Rest:
    """Return a scene's equilibrium.

    Raises:
        DivergenceError: It has none that the static solver finds.
        SceneError: It is not valid.
    """
    scene = content if isinstance(content, Scene) else load_scene(content)
    simulation = scene.build()
    simulation.settle()
    position = simulation.state.position
    radius, roundness = edge_radius(simulation.lattice, position)
    return Rest(
        displacement=displacement(simulation),
        radius=radius,
        roundness=roundness,
        position=position,
        simulation=simulation,
    )


def displacement(simulation: Simulation) -> dict[str, np.ndarray]:
    """Return the displacement of each named point from the flat sheet [mm], shape (3,), by name."""
    now, flat = simulation.state.position, simulation.lattice.reference_position
    return {
        name: MM * (point.position(now) - point.position(flat)) for name, point in simulation.points.items()
    }


def edge_radius(lattice: Lattice, position: np.ndarray) -> tuple[float, float]:
    """Return the radius of the actuated edges [m] by `RADIUS_METHOD`, and their distance from the circles [m].

    Args:
        lattice: The lattice.
        position: Node positions in ldcs_base [m], shape (n_nodes, 3).
    """
    edges = [position[lattice.index[:, :, row]].mean(axis=0)[:, [0, 2]] for row in (0, -1)]
    circles = [circle(edge) for edge in edges]
    return float(np.mean([radius for radius, _ in circles])), float(
        np.sqrt(np.mean([rms**2 for _, rms in circles]))
    )


def circle(points: np.ndarray) -> tuple[float, float]:
    """Return radius [m], negative if the centre is below, and rms distance [m] of the circle through points (x, z).

    Kasa's algebraic fit, |p|^2 = a x + b z + c in the least-squares sense, points of shape (n, 2); a straight
    line gives an infinite radius.
    """
    x, z = points.T
    (a, b, c), _, rank, _ = np.linalg.lstsq(
        np.stack([x, z, np.ones_like(x)], axis=1), x**2 + z**2, rcond=1e-9
    )
    if rank < 3:
        return float("inf"), 0.0
    radius = float(np.sqrt(c + 0.25 * (a * a + b * b)))
    distance = np.hypot(x - 0.5 * a, z - 0.5 * b) - radius
    return (radius if b >= 0.0 else -radius), float(np.sqrt(np.mean(distance**2)))
