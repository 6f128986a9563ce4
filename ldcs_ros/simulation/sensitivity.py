"""Sensitivities: how the rest state of a simulation moves with commands and numbers of its scene.

At rest f(q, p) = 0, so dq/dp = -(df/dq)^-1 df/dp (implicit function theorem) with the Jacobian that the solvers use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass

import numpy as np
from scipy.sparse import linalg as sparse_linalg

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.schema.paths import get_value
from ldcs_ros.simulation.command_directions import (
    AXES,
    KINDS,
    OperatingPoint,
    command_directions,
    force_slope,
)
from ldcs_ros.simulation.equilibrium import equilibrium
from ldcs_ros.simulation.linear_model import stiffness_and_damping
from ldcs_ros.simulation.problem import Problem
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
    factors = sparse_linalg.splu(by_q)
    for name in to:
        if name.partition(".")[0] in KINDS:
            for one in command_directions(at, name):
                slope = force_slope(model, time, q, u, held, one)
                columns.append((one.name, one.unit, slope, np.zeros(3 * len(places))))
        else:
            unit = _unit(at.scene, name)
            columns.append((name, unit, *_by_number(at, name, of, q, held)))
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
    at: OperatingPoint, path: str, of: Sequence[str], q: np.ndarray, held: HeldCommands
) -> tuple[np.ndarray, np.ndarray]:
    """Return d(force)/d(number), shape (n_free,), and the change of the places themselves [m per unit]."""
    scene = at.scene
    value = get_value(scene.content, path)
    if value is None:
        value = _default(scene, path)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"got {path!r}, expected a command, or the path of a number of the scene")
    step = RELATIVE_STEP * (abs(value) if value else 1.0)

    def look(number: float) -> tuple[np.ndarray, np.ndarray]:
        other = scene.edited({path: number})
        model = Model(other.lattice, other.points, other.effects, other.material)
        if not np.array_equal(model.free, at.model.free):
            raise ValueError(f"{path} changes the lattice, expected a number that keeps its nodes and arms")
        there, u = q.copy(), np.zeros_like(q)
        model.prescribe(at.time, there, u)
        places = [point_at(other.lattice, name, other.points) for name in of]
        return model.force(at.time, there, 0.0 * u, held), positions(places, there)

    try:
        ahead, before = look(value + step), look(value - step)
        further, behind = look(value + 2.0 * step), look(value - 2.0 * step)
    except Exception as error:
        raise ValueError(f"{path} cannot be changed by {2.0 * step:g}: {error}") from error
    force, place = (
        (8.0 * (ahead[k] - before[k]) - (further[k] - behind[k])) / (12.0 * step) for k in range(2)
    )
    return force, place


def _default(scene: Problem, path: str) -> object:
    effect, key = _effect_and_key(scene, path)
    return getattr(effect, key, None)


def _unit(scene: Problem, path: str) -> str:
    effect, key = _effect_and_key(scene, path)
    declared = {field.name: field for field in fields(effect)} if is_dataclass(effect) else {}
    return str(declared[key].metadata.get("unit", "")) if key in declared else ""


def _effect_and_key(scene: Problem, path: str) -> tuple[object, str]:
    # The last key of an effect, also where an arm of a list has it.
    words = path.split(".")
    effect = scene.effect(words[1]) if len(words) > 2 and words[0] == "effects" else None
    return effect, words[-1]


def positions(places: Sequence[Point], flat: np.ndarray) -> np.ndarray:
    """Return the positions of places [m], one after the other, shape (3 n,), from the coordinates."""
    # NaN in holes never counts: no stencil names such a node.
    last = max(int(point.nodes.max()) for point in places) + 1
    nodes = flat[: 3 * last].reshape(-1, 3)
    return np.concatenate([point.position(nodes) for point in places])
