"""The contract of an effect, as a numbered list.

1. An effect is a frozen dataclass of SI parameters, declared with `quantity`, `choice`, `choices` or `location`:
   schema, bounds, documentation and physics in one file.
2. `bind(assembly)` returns its term: the same physics with the lattice's indices worked out once.
3. A term adds to a flat force vector and never overwrites it: terms are summed, never switched.
4. If the force has a potential, `energy` returns it and the force is minus its gradient.
5. `jacobian_pattern()` names the places (row, column) that its Jacobian can fill; `jacobian` returns the exact values
   of d(force)/dq and d(force)/du there. With `positive_definite` it may drop the terms that make -d(force)/dq
   indefinite. A term is `corotational` if its forces rotate with the sheet; its `corotated_jacobian` is symmetric.
6. `constrained_dofs()` names coordinates that the effect prescribes; `prescribe` writes them and their rates.
7. `added_mass` returns the masses that it adds to the nodes [kg].
8. `breakpoints` are the times at which its own dependence on time is not smooth.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point, point_at

if TYPE_CHECKING:
    # A scene without a material loads none.
    from ldcs_ros.physics.material import Material

EMPTY_PATTERN = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
NO_VALUES = np.zeros(0)
NO_COORDINATES = np.zeros(0, dtype=np.int64)


@dataclass
class Assembly:
    """The surroundings that effects are bound to: the lattice, its points, and the parts of other effects.

    Attributes:
        lattice: The lattice.
        points: Named points of the scene.
        node_mass: Mass of each node with the masses that effects add [kg], shape (n_nodes,).
        gravity: Acceleration of gravity in ldcs_base [m/s^2], zero if the scene names none.
        material: Material of the springs; None if they have a stiffness of their own.
        n_angles: Number of arm coordinates after the nodes' coordinates.
    """

    lattice: Lattice
    points: dict[str, Point]
    node_mass: np.ndarray
    gravity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    material: Material | None = None
    n_angles: int = 0

    def point(self, place: object) -> Point:
        """Return the point for a name or [layer, i, j]; ValueError if there is none."""
        return point_at(self.lattice, place, self.points)


def coordinates(nodes: np.ndarray) -> np.ndarray:
    """Return the places of the nodes' coordinates in the flat vector, shape (n, 3)."""
    return 3 * np.asarray(nodes)[:, None] + np.arange(3)


class Effect:
    """Base of all effects; see the contract at the top of this file."""

    name: ClassVar[str]

    def bind(self, assembly: Assembly) -> Term:
        """Return this effect's term for an assembly."""
        raise NotImplementedError


class Term:
    """An effect bound to an assembly; the defaults are an effect that does nothing.

    Coordinates q [m, rad], rates u [m/s, rad/s] and forces [N, N m] have shape (n_coordinates,): x, y, z of each node
    in ldcs_base, then the arms' angles. Times are in seconds.
    """

    name: str = ""
    breakpoints: tuple[float, ...] = ()
    has_energy: bool = True
    # Displacement over which its Jacobian changes altogether, as where contact sets in [m].
    contact_width: float = float("inf")
    # Its force depends on commands.
    commanded: bool = False
    # Its forces rotate with the sheet.
    corotational: bool = False
    # Its dampers' coefficient over its stiffness, where it has just one [s].
    relaxation_time: float = 0.0

    def added_mass(self) -> np.ndarray | float:
        """Return the masses that the effect adds to the nodes [kg], shape (n_nodes,) or 0."""
        return 0.0

    def constrained_dofs(self) -> np.ndarray:
        """Return the coordinates that the effect prescribes, shape (n,)."""
        return NO_COORDINATES

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        """Write the prescribed coordinates and rates at a time [s] into q and u, shape (n_coordinates,)."""

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        """Add the effect's force [N, N m] to `force`; q, u and force have shape (n_coordinates,)."""

    def add_command_jump(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        before: HeldCommands,
        after: HeldCommands,
        force: np.ndarray,
    ) -> None:
        """Add the jump of the effect's force at a change of commands; for effects that are `commanded`.

        Shapes are those of `add_force`.
        """
        jump = np.zeros_like(force)
        self.add_force(time, q, u, before, jump)
        force -= jump
        self.add_force(time, q, u, after, force)

    def energy(self, time: float, q: np.ndarray) -> float:
        """Return the potential energy [J] at q, shape (n_coordinates,).

        Its gradient is minus the part of the force that depends on q alone.
        """
        return 0.0

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns that the Jacobian can fill, shape (n,) each; a place may occur twice."""
        return EMPTY_PATTERN

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the values of d(force)/dq and d(force)/du at `jacobian_pattern()`, shape (n,) each."""
        return NO_VALUES, NO_VALUES

    def corotated_jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return a symmetric Jacobian, for factors that rotate with the sheet; here that at zero velocity.

        Shapes are those of `jacobian`.
        """
        return self.jacobian(time, q, np.zeros_like(u), inputs, positive_definite)
