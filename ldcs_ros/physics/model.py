"""The model: a lattice and the effects that its scene names, summed into forces, Jacobians and energies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

from ldcs_ros.physics.effects.base import NO_VALUES, Assembly, Effect, Term, coordinates
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.lattice import LAYERS, Lattice
from ldcs_ros.physics.points import Point

if TYPE_CHECKING:
    # A scene imports only the effects that it names.
    from ldcs_ros.physics.effects.arms import ArmsTerm
    from ldcs_ros.physics.effects.gravity import Gravity
    from ldcs_ros.physics.effects.wrench import WrenchTerm
    from ldcs_ros.physics.material import Material


@dataclass(frozen=True)
class Motion:
    """The system at an instant, in flat coordinates.

    Attributes:
        time: Simulation time [s].
        q: Coordinates [m, rad], shape (n_coordinates,).
        u: Their rates, same shape.
        a: Accelerations of the free coordinates, shape (n_free,).
        lasting: After a jump, those that last for longer than microseconds; None where all do.
    """

    time: float
    q: np.ndarray
    u: np.ndarray
    a: np.ndarray
    lasting: np.ndarray | None = None


class Model:
    """M(q) q'' = f(t, q, q', inputs) for the free coordinates; the prescribed ones are known functions of time.

    The mass matrix is diagonal for nodes and one small block for each arm. A coordinate, a call and an import
    exist only for the effects that the scene names. Coordinates q [m, rad] and rates u have shape (n_coordinates,).

    Args:
        lattice: The lattice.
        points: Named points, for effects that refer to them.
        effects: The effects, in the scene's order.
        material: Material of the springs, if they are not given by their stiffness.
        like: A model whose terms serve this one, too, where nothing that they are made from differs.
    """

    def __init__(
        self,
        lattice: Lattice,
        points: dict[str, Point],
        effects: Sequence[Effect],
        material: Material | None = None,
        *,
        like: Model | None = None,
    ) -> None:
        self.lattice, self.points, self.effects = lattice, points, tuple(effects)
        assembly = Assembly(lattice, points, lattice.node_mass.copy(), material=material)
        for effect in self.effects:
            if effect.name == "gravity":
                assembly.gravity = assembly.gravity + np.array(cast("Gravity", effect).acceleration)
        # Weight needs the payloads' masses, so gravity is bound last.
        order = sorted(range(len(self.effects)), key=lambda index: self.effects[index].name == "gravity")
        terms: dict[int, Term] = {}
        for index in order:
            try:
                shared = None if like is None else like.shared_term(self.effects, index, assembly)
                terms[index] = shared or self.effects[index].bind(assembly)
            except ValueError as error:
                raise ValueError(f"{error} @ effects[{index}]") from error
            assembly.node_mass = assembly.node_mass + terms[index].added_mass()
        self.terms = tuple(terms[index] for index in range(len(self.effects)))
        self._assembly = assembly
        self.corotational = any(term.corotational for term in self.terms if term.name == "springs")
        self.relaxation_time = max((term.relaxation_time for term in self.terms), default=0.0)
        by_name = {term.name: term for term in self.terms}
        # Terms that have a force at all; an effect `wrench` has none while no wrench is commanded.
        acting = [term for term in self.terms if type(term).add_force is not Term.add_force]
        self._acting = tuple(acting)
        self._acting_unpushed = tuple(term for term in acting if term.name != "wrench")
        self.arms = cast("ArmsTerm | None", by_name.get("arms"))
        self.wrench = cast("WrenchTerm | None", by_name.get("wrench"))
        self.node_mass = assembly.node_mass
        self.n_angles = 0 if self.arms is None else self.arms.n_arms * self.arms.n_links
        self.n_coordinates = 3 * lattice.n_nodes + self.n_angles
        self._cut_out = coordinates(lattice.missing).ravel()
        self._find_free()

    def shared_term(self, effects: Sequence[Effect], index: int, assembly: Assembly) -> Term | None:
        """Return the term of an effect of another model if that is the same one, else None."""
        own = self._assembly
        if len(effects) != len(self.effects) or effects[index] != self.effects[index]:
            return None
        same_sheet = assembly.lattice is own.lattice and assembly.points is own.points
        same_gravity = np.array_equal(assembly.gravity, own.gravity)
        # Weight depends on the masses of the others.
        same_mass = effects[index].name != "gravity" or np.array_equal(assembly.node_mass, own.node_mass)
        if same_sheet and same_gravity and same_mass and assembly.material == own.material:
            return self.terms[index]
        return None

    def _find_free(self) -> None:
        is_free = np.ones(self.n_coordinates, dtype=bool)
        is_free[self._cut_out] = False
        for term in self.terms:
            is_free[term.constrained_dofs()] = False
        self.free = np.flatnonzero(is_free)
        self.n_free_nodes = int(np.searchsorted(self.free, 3 * self.lattice.n_nodes))
        self.n_free_angles = len(self.free) - self.n_free_nodes
        self.mass = np.repeat(self.node_mass, 3)[self.free[: self.n_free_nodes]]
        # Nodes of holes are left out of the free ones, but hold nothing.
        is_whole = self.n_free_nodes + len(self._cut_out) == 3 * self.lattice.n_nodes
        self.is_unconstrained = is_whole and self.arms is None
        self.prescribing = tuple(term for term in self.terms if term.constrained_dofs().size)
        self.breakpoints = tuple(sorted({time for term in self.terms for time in term.breakpoints}))

    def coordinate_name(self, coordinate: int) -> str:
        """Return the owner of a coordinate, for messages: 'node_top_8_4' or 'left link 2'."""
        n = 3 * self.lattice.n_nodes
        if coordinate >= n:
            assert self.arms is not None
            arm, link = divmod(coordinate - n, self.arms.n_links)
            return f"{self.arms.names[arm]} link {link + 1}"
        layer, i, j = np.unravel_index(coordinate // 3, (2, *self.lattice.nodes))
        return f"node_{LAYERS[layer]}_{i}_{j}"

    def reference_state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return q of the flat, unloaded sheet with straight arms, and u of zeros, shape (n_coordinates,) each."""
        q = np.zeros(self.n_coordinates)
        q[: 3 * self.lattice.n_nodes] = self.lattice.reference_position.ravel()
        u = np.zeros(self.n_coordinates)
        self.prescribe(0.0, q, u)
        return q, u

    def coordinates_of(
        self,
        position: np.ndarray,
        velocity: np.ndarray | None = None,
        link_angle: np.ndarray | None = None,
        link_rate: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return coordinates and rates of a given shape; nodes in holes keep their reference position.

        Args:
            position: Node positions in ldcs_base [m], shape (n_nodes, 3).
            velocity: Node velocities in ldcs_base [m/s], same shape; None for a sheet at rest.
            link_angle: Link angles [rad], shape (n_arms, n_links); None for straight arms.
            link_rate: Their rates [rad/s], same shape; None for arms at rest.

        Raises:
            ValueError: A shape is wrong or a number is not finite.
        """
        q, u = self.reference_state()
        n, nodes = 3 * self.lattice.n_nodes, (self.lattice.n_nodes, 3)
        links = (0, 0) if self.arms is None else (self.arms.n_arms, self.arms.n_links)
        for name, value, target, shape in (
            ("position", position, q[:n], nodes),
            ("velocity", velocity, u[:n], nodes),
            ("link_angle", link_angle, q[n:], links),
            ("link_rate", link_rate, u[n:], links),
        ):
            if value is None:
                continue
            array = np.array(value, dtype=float)
            if array.shape == nodes:
                array[self.lattice.missing] = target.reshape(-1, 3)[self.lattice.missing]
            if array.shape != shape or not np.isfinite(array).all():
                got = f"shape {array.shape}" if array.shape != shape else "a number that is not finite"
                raise ValueError(f"{name}: got {got}, expected finite numbers of shape {shape}")
            target[:] = array.ravel()
        return q, u

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        """Write the prescribed coordinates and rates at a time [s] into q and u, shape (n_coordinates,).

        Nodes in holes stay where they are.
        """
        for term in self.prescribing:
            term.prescribe(time, q, u)

    def force(self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands) -> np.ndarray:
        """Return the force on the free coordinates [N, N m], shape (n_free,)."""
        total = np.zeros(self.n_coordinates)
        for term in self._acting if inputs.wrenches else self._acting_unpushed:
            term.add_force(time, q, u, inputs, total)
        return total[self.free]

    def inertia(self, q: np.ndarray) -> np.ndarray | None:
        """Return the mass matrix of the free angles [kg m^2], shape (n_arms, n, n), or None without any."""
        return self.arms.inertia(q) if self.arms is not None and self.n_free_angles else None

    def momentum(self, q: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return M(q) a for free coordinates a, shape (n_free,)."""
        result = np.empty(len(self.free))
        result[: self.n_free_nodes] = self.mass * a[: self.n_free_nodes]
        blocks = self.inertia(q)
        if blocks is not None:
            angles = a[self.n_free_nodes :].reshape(len(blocks), -1, 1)
            result[self.n_free_nodes :] = (blocks @ angles).ravel()
        return result

    def accelerate(self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands) -> np.ndarray:
        """Return the accelerations of the free coordinates, M^-1 f, shape (n_free,)."""
        return self.inverse_mass_times(q, self.force(time, q, u, inputs))

    def inverse_mass_times(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Replace a force on the free coordinates by M(q)^-1 times it, shape (n_free,), and return it."""
        force[: self.n_free_nodes] /= self.mass
        blocks = self.inertia(q)
        if blocks is not None:
            angles = force[self.n_free_nodes :].reshape(len(blocks), -1, 1)
            force[self.n_free_nodes :] = np.linalg.solve(blocks, angles).ravel()
        return force

    def force_jump(
        self, time: float, q: np.ndarray, u: np.ndarray, before: HeldCommands, after: HeldCommands
    ) -> np.ndarray:
        """Return the jump of the force on all coordinates where commands change [N, N m], shape (n_coordinates,)."""
        jump = np.zeros(self.n_coordinates)
        for term in self.terms:
            if term.commanded:
                term.add_command_jump(time, q, u, before, after, jump)
        return jump

    def command_jump(
        self, time: float, q: np.ndarray, u: np.ndarray, before: HeldCommands, after: HeldCommands
    ) -> np.ndarray:
        """Return the jump of the accelerations where commands change, M^-1 times that of the force, shape (n_free,)."""
        jump = self.force_jump(time, q, u, before, after)
        if not jump.any():
            return np.zeros(len(self.free))
        return self.inverse_mass_times(q, jump[self.free])

    def damping_rate(self, motion: Motion, inputs: HeldCommands) -> float:
        """Return the rate at which a motion's amplitude decays, dissipated power / (4 kinetic energy) [1/s].

        Half the rate at which an oscillation loses its energy, which is twice its kinetic energy on average.
        Infinite at rest: there is no motion yet that could remember an error.
        """
        q, u = motion.q, motion.u
        still = u.copy()
        still[self.free] = 0.0
        rate = u[self.free]
        power = -rate @ (self.momentum(q, motion.a) - self.force(motion.time, q, still, inputs))
        energy = rate @ self.momentum(q, rate)
        return float(0.5 * power / energy) if energy > 0.0 else math.inf

    @cached_property
    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of every Jacobian entry in free coordinates, shape (n,) each; -1 where one is prescribed."""
        place = np.full(self.n_coordinates, -1)
        place[self.free] = np.arange(len(self.free))
        pairs = [term.jacobian_pattern() for term in self.terms]
        rows = np.concatenate([pair[0] for pair in pairs])
        columns = np.concatenate([pair[1] for pair in pairs])
        return place[rows], place[columns]

    def jacobian(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        inputs: HeldCommands,
        *,
        positive_definite: bool,
        corotated: bool = False,
        without: Term | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the values of d(force)/dq and d(force)/du at `jacobian_pattern`.

        Args:
            time: Simulation time [s].
            q: Coordinates [m, rad], shape (n_coordinates,).
            u: Their rates, same shape.
            inputs: Commands held at that time.
            positive_definite: Of the stable part only.
            corotated: Without the unsymmetric part of a rotating sheet; `LinearSystem.turn` restores it.
            without: A term whose values are left out.
        """
        values = [
            (term.corotated_jacobian if corotated and term.corotational else term.jacobian)(
                time, q, u, inputs, positive_definite
            )
            for term in self.terms
            if term is not without
        ]
        if not values:
            return NO_VALUES, NO_VALUES
        return np.concatenate([value[0] for value in values]), np.concatenate([value[1] for value in values])

    def potential_energy(self, time: float, q: np.ndarray) -> float:
        """Return the elastic and gravitational energy [J] at q, shape (n_coordinates,)."""
        return sum(term.energy(time, q) for term in self.terms)

    def kinetic_energy(self, q: np.ndarray, u: np.ndarray) -> float:
        """Return the kinetic energy of all nodes and links [J] at q and u, shape (n_coordinates,)."""
        n = 3 * self.lattice.n_nodes
        total = 0.5 * float(np.repeat(self.node_mass, 3) @ u[:n] ** 2)
        if self.arms is not None:
            rate = u[n:].reshape(self.arms.n_arms, -1)
            total += 0.5 * float(np.einsum("ai,aij,aj", rate, self.arms.inertia(q), rate))
        return total
