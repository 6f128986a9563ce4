"""Stability of an equilibrium: the lowest eigenvalue of stiffness against mass, and the motion that belongs to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model
from ldcs_ros.simulation.linear_model import mass_matrix, stiffness_and_damping

# Up to this number of free coordinates all eigenvalues cost less than a search for one.
DENSE_SIZE = 700
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
        q: Coordinates of the equilibrium [m, rad].
        time: Time of the prescribed coordinates [s].
        inputs: Commands, held.
    """
    n = len(model.free)
    by_position, _ = stiffness_and_damping(model, time, q, np.zeros_like(q), inputs)
    stiffness, mass = -0.5 * (by_position + by_position.T), mass_matrix(model, q)
    stiffest = float(np.max(np.abs(stiffness.diagonal()) / mass.diagonal(), initial=0.0))
    if n <= DENSE_SIZE:
        values, vectors = eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, 0])
    else:
        # A shift a little below zero finds the slowest motions; the lowest of them is the one that leaves.
        values, vectors = eigsh(stiffness, 6, mass, sigma=-1e-6 * stiffest, which="LM", v0=np.ones(n))
    lowest = int(np.argmin(values))
    coordinates = np.zeros(model.n_coordinates)
    coordinates[model.free] = vectors[:, lowest]
    n_nodes = 3 * model.lattice.n_nodes
    direction = coordinates[:n_nodes].reshape(-1, 3)
    largest = direction.flat[int(np.argmax(np.abs(direction)))]
    coordinates = coordinates / (largest if largest != 0.0 else 1.0)
    value = float(values[lowest])
    return Stability(
        value, coordinates[:n_nodes].reshape(-1, 3).copy(), coordinates, value >= -ROUNDING * stiffest
    )
