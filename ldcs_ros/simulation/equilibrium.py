"""The static solver: the coordinates at which all forces balance, without the motion to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.integrators.implicit.system import LinearSystem
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model
from ldcs_ros.simulation.stability import Stability, stability

MOST_ITERATIONS = 2000
FIRST_STEP, LARGEST_STEP = 0.02, 1e4  # s of pseudo-time
BALANCED = 1e-12  # m: a Newton step below it is rounding
# Displacement out of an unstable equilibrium, as a fraction of the spacing, and how many are looked at.
NUDGE = 0.05
MOST_EQUILIBRIA = 9
# Equilibria whose coordinates differ by less are one [m, rad].
SAME_PLACE = 1e-7


def equilibrium(
    model: Model,
    q: np.ndarray,
    time: float,
    inputs: HeldCommands,
    *,
    first_step: float = FIRST_STEP,
    system: LinearSystem | None = None,
) -> np.ndarray:
    """Return the coordinates [m, rad], shape (n_coordinates,), at which the forces of constant inputs balance.

    Pseudo-transient continuation (Kelley and Keyes 1998): dq = h^2 (M - h C - h^2 K)^-1 f, and h grows as the
    steps shrink. Far from the equilibrium it creeps like the damped sheet, and near it it is Newton's method. A
    step moves no node, and no end of a link against its joint, by more than half a spacing.

    Args:
        model: The model.
        q: Coordinates of the start [m, rad].
        time: Time of the prescribed coordinates [s].
        inputs: Commands, held.
        first_step: First h [s]; `LARGEST_STEP` begins as Newton's method, from a start near the equilibrium.
        system: The model's linear system, where the caller keeps one.

    Raises:
        DivergenceError: No balance was found; nothing holds the sheet, for example.
    """
    system = system or LinearSystem(model)
    q, u = q.copy(), np.zeros_like(q)
    model.prescribe(time, q, u)
    u[:] = 0.0
    reach, lever = 0.5 * min(model.lattice.spacing), _lever(model)
    h, before = first_step, np.inf
    for _ in range(MOST_ITERATIONS):
        force = model.force(time, q, u, inputs)
        try:
            move = h * h * system.factor(time, q, u, inputs, h).solve(force)
        except np.linalg.LinAlgError as error:
            raise DivergenceError(f"no rest state: {error}; check the scene's stiffness and loads") from error
        largest = float(np.max(np.abs(move) * lever))
        if not np.isfinite(largest) or largest > reach:
            h = max(1e-6, h * (0.5 if not np.isfinite(largest) else max(0.1, 0.7 * np.sqrt(reach / largest))))
            if not np.isfinite(largest):
                continue
            move *= reach / largest
        else:
            h = min(LARGEST_STEP, h * (2.0 if largest < before else 1.1))
        q[model.free] += move
        if largest < BALANCED and h > 10.0:
            return q
        before = largest
    raise DivergenceError(
        f"no rest state was found in {MOST_ITERATIONS} iterations, the last one still moved a node by {before:.2g} m; "
        f"is there an effect that holds the sheet (clamp, floor, driven_edges)? Simulate it in time instead"
    )


def _lever(model: Model) -> np.ndarray:
    """Return the length by which each free coordinate's change moves a place, shape (n_free,): 1, or a link [m]."""
    lever = np.ones(model.n_coordinates)
    if model.arms is not None:
        model.arms.angles(lever)[:] = model.arms.link_length
    return lever[model.free]


@dataclass(frozen=True)
class Equilibrium:
    """Coordinates at which all forces balance.

    Attributes:
        coordinates: Nodes [m], then link angles [rad], shape (n_coordinates,).
        position: Node positions in ldcs_base [m], shape (n_nodes, 3).
        stability: Lowest eigenvalue and its direction.
    """

    coordinates: np.ndarray
    position: np.ndarray
    stability: Stability


def find_equilibria(
    model: Model, q: np.ndarray, time: float, inputs: HeldCommands, *, follow: bool, both_ways: bool
) -> list[Equilibrium]:
    """Return the equilibrium nearest to a start and those that unstable ones lead to, in the order found.

    Args:
        model: The model.
        q: Coordinates of the start [m, rad], shape (n_coordinates,).
        time: Time of the prescribed coordinates [s].
        inputs: Commands, held.
        follow: Leave unstable equilibria along their direction; with one way only, the last one is stable.
        both_ways: Follow each direction to both sides.

    Raises:
        DivergenceError: The first one was not found, or no stable one with `follow`.
    """
    found: list[Equilibrium] = []
    starts = [q]
    nudge = NUDGE * min(model.lattice.spacing)
    while starts and len(found) < MOST_EQUILIBRIA:
        try:
            coordinates = equilibrium(model, starts.pop(0), time, inputs)
        except DivergenceError:
            if not found or not both_ways:
                raise
            continue
        if any(np.max(np.abs(coordinates - other.coordinates)) < SAME_PLACE for other in found):
            continue
        n = 3 * model.lattice.n_nodes
        judged = stability(model, coordinates, time, inputs)
        found.append(Equilibrium(coordinates, coordinates[:n].reshape(-1, 3).copy(), judged))
        if follow and not judged.is_stable:
            starts += [
                coordinates + side * nudge * judged.coordinates for side in (1.0, -1.0)[: 1 + both_ways]
            ]
    if follow and not any(one.stability.is_stable for one in found):
        raise DivergenceError(f"no stable rest state: {found[-1].stability.describe(model)}")
    return found
