"""Stability of an equilibrium: the lowest eigenvalue of stiffness against mass, and the motion that belongs to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model
from ldcs_ros.simulation.linear_model import largest_eigenvalue, natural_modes, stiffness_and_damping

# Below this fraction of the stiffest direction's eigenvalue a negative one is rounding.
ROUNDING = 1e-10


@dataclass(frozen=True)
class Stability:
    """The slowest small motion around an equilibrium, x'' = -eigenvalue x.

    Attributes:
        eigenvalue: Lowest eigenvalue [1/s^2]: negative where the sheet leaves the equilibrium.
        direction: Displacement of the nodes in that motion, the largest 1, shape (n_nodes, 3).
        coordinates: The same in all coordinates, shape (n_coordinates,).
        is_stable: The eigenvalue is not negative beyond rounding.
    """

    eigenvalue: float
    direction: np.ndarray
    coordinates: np.ndarray
    is_stable: bool

    def describe(self, model: Model) -> str:
        """Return one sentence on the equilibrium: stable, or the node that leaves it first and its direction."""
        if self.is_stable:
            return f"the equilibrium is stable: lowest eigenvalue {self.eigenvalue:.3g} 1/s^2"
        node = int(np.argmax(np.linalg.norm(self.direction, axis=1)))
        way = ", ".join(f"{part:.2g}" for part in self.direction[node])
        return (
            f"the equilibrium is unstable: lowest eigenvalue {self.eigenvalue:.3g} 1/s^2, "
            f"{model.coordinate_name(3 * node)} leaves along ({way}); "
            "settle(follow=True) goes on to a stable one"
        )


def stability(model: Model, q: np.ndarray, time: float, inputs: HeldCommands) -> Stability:
    """Return the stability of an equilibrium under constant inputs.

    The stiffness -d(force)/dq is taken symmetric; wrenches that turn with the sheet may make it slightly unsymmetric.

    Args:
        model: The model.
        q: Coordinates of the equilibrium [m, rad], shape (n_coordinates,).
        time: Time of the prescribed coordinates [s].
        inputs: Commands, held.
    """
    by_position, _ = stiffness_and_damping(model, time, q, np.zeros_like(q), inputs)
    values, vectors = natural_modes(model, q, by_position, 1)
    value, stiffest = float(values[0]), largest_eigenvalue(model, q, by_position)
    coordinates = np.zeros(model.n_coordinates)
    coordinates[model.free] = vectors[:, 0]
    n_nodes = 3 * model.lattice.n_nodes
    direction = coordinates[:n_nodes].reshape(-1, 3)
    largest = direction.flat[int(np.argmax(np.abs(direction)))]
    coordinates = coordinates / (largest if largest != 0.0 else 1.0)
    return Stability(
        value, coordinates[:n_nodes].reshape(-1, 3).copy(), coordinates, value >= -ROUNDING * stiffest
    )
