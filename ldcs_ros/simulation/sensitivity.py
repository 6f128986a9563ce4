"""Sensitivities: how the rest state of a simulation moves with commands and numbers of its scene.

At rest f(q, p) = 0, so dq/dp = -(df/dq)^-1 df/dp (implicit function theorem) with the Jacobian that the solvers use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.simulation.command_directions import (
    AXES,
    KINDS,
    OperatingPoint,
    command_directions,
    force_slope,
)
from ldcs_ros.simulation.equilibrium import equilibrium
from ldcs_ros.simulation.linear_model import rest_factors, stiffness_and_damping
from ldcs_ros.simulation.scene_number import SceneNumber
from ldcs_ros.simulation.stability import stability

RELATIVE_STEP = 1e-3
"""Step of the differences by numbers of the scene; of fourth order, so that their error is near 1e-12."""


@dataclass(frozen=True)
class StaticSensitivity:
    """Derivatives of places at rest.

    Attributes:
        of: Name of each place.
        to: Name of each number; a force or torque of a wrench has one for each axis.
        units: SI unit of each number, '' where the scene does not say.
        values: Derivatives, shape (3 n_of, n_to), rows x, y, z of each place in ldcs_base [m per unit].
        lowest_eigenvalue: Of M^-1 times the stiffness, the square of the lowest angular frequency [1/s^2].
        warning: Why the values do not hold, in words; '' at a stable equilibrium.
    """

    of: tuple[str, ...]
    to: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    lowest_eigenvalue: float
    warning: str

    @property
    def rows(self) -> tuple[str, ...]:
        """Name of each row: P1.x, P1.y, P1.z."""
        return tuple(f"{name}.{axis}" for name in self.of for axis in AXES)


def sensitivity(at: OperatingPoint, of: Sequence[str], to: Sequence[str]) -> StaticSensitivity:
    """Return how places move at rest with commands and numbers of the scene.

    Args:
        at: The state; the equilibrium near it counts.
        of: Names of places: points, or `node_<layer>_<i>_<j>`.
        to: `pressure.<arm>`, `torque.<arm>`, `torque.<joint>`, `wrench.<frame>.force` or `.torque` (or one axis of
            them, `.force.z`), or the path of a number of the scene.

    Raises:
        ValueError: There is no such place or number.
        DivergenceError: No equilibrium was found.
    """
    model, time, held = at.model, at.time, at.held
    places = [point_at(model.lattice, name, model.points) for name in of]
    columns: list[tuple[str, str, np.ndarray, np.ndarray]] = []
    q = equilibrium(model, at.q, time, held)
    u = np.zeros_like(q)
    by_q, _ = stiffness_and_damping(model, time, q, u, held)
    factors = rest_factors(by_q)
    for name in to:
        if name.partition(".")[0] in KINDS:
            for one in command_directions(at, name):
                slope = force_slope(model, time, q, u, held, one)
                columns.append((one.name, one.unit, slope, np.zeros(3 * len(places))))
        else:
            number = SceneNumber(at.scene, model, name)
            columns.append((name, number.unit, *_by_number(at, number, of, q, held)))
    values = np.empty((3 * len(places), len(columns)))
    for column, (_, _, slope, explicit) in enumerate(columns):
        moved = np.zeros_like(q)
        moved[model.free] = -factors.solve(slope)
        values[:, column] = positions(places, moved) + explicit
    state = stability(model, q, time, held)
    warning = (
        "" if state.is_stable else f"{state.describe(model)}; the values are those of the unstable branch"
    )
    return StaticSensitivity(
        tuple(of),
        tuple(c[0] for c in columns),
        tuple(c[1] for c in columns),
        values,
        state.eigenvalue,
        warning,
    )


def _by_number(
    at: OperatingPoint, number: SceneNumber, of: Sequence[str], q: np.ndarray, held: HeldCommands
) -> tuple[np.ndarray, np.ndarray]:
    """Return d(force)/d(number), shape (n_free,), and the change of the places themselves [m per unit]."""
    step = number.step(RELATIVE_STEP)

    def look(by: float) -> tuple[np.ndarray, np.ndarray]:
        other, model = number.changed(by)
        there, u = q.copy(), np.zeros_like(q)
        model.prescribe(at.time, there, u)
        places = [point_at(other.lattice, name, other.points) for name in of]
        return model.force(at.time, there, 0.0 * u, held), positions(places, there)

    ahead, before, further, behind = (look(by * step) for by in (1.0, -1.0, 2.0, -2.0))
    force, place = (
        (8.0 * (ahead[k] - before[k]) - (further[k] - behind[k])) / (12.0 * step) for k in range(2)
    )
    return force, place


def positions(places: Sequence[Point], flat: np.ndarray) -> np.ndarray:
    """Return the positions of places [m], one after the other, shape (3 n,), from the coordinates."""
    # NaN in holes never counts: no stencil names such a node.
    last = max(int(point.nodes.max()) for point in places) + 1
    nodes = flat[: 3 * last].reshape(-1, 3)
    return np.concatenate([point.position(nodes) for point in places])


def position_slopes(places: Sequence[Point], moves: np.ndarray) -> np.ndarray:
    """Return how places move with coordinates that move, shape (3 n, k).

    Args:
        places: The places.
        moves: Derivatives of all coordinates by k numbers, shape (n_coordinates, k).
    """
    return np.stack([positions(places, column) for column in moves.T], axis=1)
