"""The lattice's springs with collocated dampers: the three spring laws."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics import axial
from ldcs_ros.physics.effects.base import Assembly, Effect, Term
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.schema.fields import choice, quantity

LAWS = ("axial", "axiswise", "corotational")


@dataclass(frozen=True, kw_only=True)
class Springs(Effect):
    """Springs and dampers between each node and its up to 17 neighbours.

    axial: a spring resists change of its length, f = [k (L - L0) + c dL/dt] n along its own axis n.

    axiswise: the paper's equations (1)-(2) as printed, f = k (u_b - u_a) + c (du_b - du_a) per axis. This law
    resists rigid rotation and has no bending stiffness; it is kept for comparison with the paper.

    corotational: vector springs in each node's best-fit rotated frame; they add bending stiffness.

    Attributes:
        law: One of the three.
        stiffness: Stiffness k of each spring [N/m].
        damping: Coefficient c of each damper [N s/m].
    """

    name: ClassVar[str] = "springs"
    law: str = choice(
        "axial", LAWS, "spring law", source="only laws along a spring's own axis can give the paper's Table I"
    )
    stiffness: float = quantity(
        80.0, "N/m", "stiffness of each spring", low=0.0, high=1e9, source="paper, section III"
    )
    damping: float = quantity(
        5.0, "N s/m", "coefficient of each damper", low=0.0, high=1e9, source="paper, section III"
    )

    def bind(self, assembly: Assembly) -> Term:
        """Return the term of the chosen law.

        Raises:
            ValueError: A material with a law that its spring families were not derived for.
        """
        lattice, material = assembly.lattice, assembly.material
        if material is not None and self.law != "axial":
            raise ValueError(f"springs: a material goes with law: axial, got {self.law!r}; drop one of them")
        if self.law == "axial":
            if material is None:
                return self._relaxing(AxialTerm(lattice, *self._of_each(lattice)))
            damping = material.relaxation_time * material.stiffness(lattice, "damping")
            term = AxialTerm(lattice, material.stiffness(lattice), damping)
            term.relaxation_time = material.relaxation_time
            return term
        if self.law == "axiswise":
            return AxiswiseTerm(lattice, *self._of_each(lattice))
        from ldcs_ros.physics.corotational import CorotationalTerm

        return self._relaxing(CorotationalTerm(lattice, *self._of_each(lattice)))

    def _of_each(self, lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
        """Return stiffness [N/m] and damping [N s/m] of each spring, shape (n_springs,) each."""
        return (
            self.stiffness * lattice.spring_factor("stiffness"),
            self.damping * lattice.spring_factor("damping"),
        )

    def _relaxing(self, term: Term) -> Term:
        term.relaxation_time = self.damping / self.stiffness if self.stiffness > 0.0 else math.inf
        return term


class SpringTerm(Term):
    """The common part of the laws: the springs' indices and the places of their Jacobian blocks.

    A spring's Jacobian is one 3 x 3 block D = d f_a / d x_b, with f_b = -f_a and d f_a / d x_a = -D. The
    pattern has a diagonal block a node, then a block (a, b) and a block (b, a) a spring.
    """

    name = Springs.name

    def __init__(self, lattice: Lattice, stiffness: float | np.ndarray, damping: float | np.ndarray) -> None:
        self.lattice = lattice
        self.a = np.ascontiguousarray(lattice.springs[:, 0])
        self.b = np.ascontiguousarray(lattice.springs[:, 1])
        self.k = np.broadcast_to(stiffness, self.a.shape).astype(float)
        self.c = np.broadcast_to(damping, self.a.shape).astype(float)

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        nodes = np.arange(self.lattice.n_nodes)
        row_nodes = np.concatenate([nodes, self.a, self.b])
        column_nodes = np.concatenate([nodes, self.b, self.a])
        rows = 3 * row_nodes[:, None, None] + np.arange(3)[:, None] + np.zeros(3, dtype=np.int64)
        columns = 3 * column_nodes[:, None, None] + np.arange(3) + np.zeros((3, 1), dtype=np.int64)
        return rows.ravel(), columns.ravel()


class AxialTerm(SpringTerm):
    """f = T n on a and -T n on b, with T = k (L - L0) + c n . (v_b - v_a)."""

    corotational = True

    def __init__(self, lattice: Lattice, stiffness: float | np.ndarray, damping: float | np.ndarray) -> None:
        super().__init__(lattice, stiffness, damping)
        self.rest_length = lattice.rest_length
        self.rest_axis = lattice.rest_vector / lattice.rest_length[:, None]

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        axial.add_force(q, u, self.a, self.b, self.rest_length, self.rest_axis, self.k, self.c, force)

    def energy(self, time: float, q: np.ndarray) -> float:
        x = q[: 3 * self.lattice.n_nodes].reshape(-1, 3)
        stretch = np.linalg.norm(x[self.b] - x[self.a], axis=1) - self.rest_length
        return float(0.5 * np.sum(self.k * stretch**2))

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        return self._jacobian(q, u, positive_definite, False)

    def corotated_jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        # Without the springs' tension it is positive definite. Bending puts opposite tensions on top and bottom, so
        # the loss is small. A guessed motion of a fine lattice has tensions that the true one has not.
        return self._jacobian(q, u, positive_definite, True)

    def entries(self) -> np.ndarray:
        """Return the entries of `jacobian_pattern` that `add_corotated` fills, shape (n_springs, 21)."""
        lower, block = np.array([0, 3, 4, 6, 7, 8]), np.arange(9)
        own = [9 * node[:, None] + lower for node in (self.a, self.b)]
        between = 9 * (self.lattice.n_nodes + np.arange(len(self.a)))[:, None] + block
        return np.concatenate([*own, between], axis=1)

    def add_corotated(self, q: np.ndarray, rate_step: float, slots: np.ndarray, matrix: np.ndarray) -> None:
        """Add -h (C + h K) of `corotated_jacobian` to a flat matrix of the nodes.

        Args:
            q: Coordinates [m, rad], shape (n_coordinates,).
            rate_step: The step h times the method's diagonal [s].
            slots: Place in the matrix of each entry of `entries`, shape (n_springs, 21).
            matrix: The matrix's values, flat; changed in place.
        """
        weight = rate_step * (self.c + rate_step * self.k)
        axial.add_stiffness(q, self.a, self.b, self.rest_length, self.rest_axis, weight, slots, matrix)

    def _jacobian(
        self, q: np.ndarray, u: np.ndarray, positive_definite: bool, corotated: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        n_nodes, n_springs = self.lattice.n_nodes, len(self.a)
        by_position = np.zeros((n_nodes + 2 * n_springs, 3, 3))
        by_rate = np.zeros((n_nodes + 2 * n_springs, 3, 3))
        axial.fill_jacobian(
            q,
            u,
            self.a,
            self.b,
            self.rest_length,
            self.rest_axis,
            self.k,
            self.c,
            positive_definite,
            corotated,
            n_nodes,
            by_position,
            by_rate,
        )
        return by_position.ravel(), by_rate.ravel()


class AxiswiseTerm(SpringTerm):
    """f = k (u_b - u_a) + c (v_b - v_a) on a: a graph Laplacian for each axis, linear in the displacements u."""

    def __init__(self, lattice: Lattice, stiffness: float | np.ndarray, damping: float | np.ndarray) -> None:
        super().__init__(lattice, stiffness, damping)
        from scipy import sparse

        n = lattice.n_nodes

        def laplacian(weight: np.ndarray) -> sparse.csr_matrix:
            half = sparse.coo_matrix((weight, (self.a, self.b)), shape=(n, n))
            joined = half + half.T
            return (joined - sparse.diags(np.asarray(joined.sum(axis=1)).ravel())).tocsr()

        self.stiffness_matrix = laplacian(self.k)
        self.damping_matrix = laplacian(self.c)
        self.rest = lattice.reference_position

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        n = 3 * self.lattice.n_nodes
        displacement = q[:n].reshape(-1, 3) - self.rest
        force[:n] += (
            self.stiffness_matrix @ displacement + self.damping_matrix @ u[:n].reshape(-1, 3)
        ).ravel()

    def energy(self, time: float, q: np.ndarray) -> float:
        displacement = q[: 3 * self.lattice.n_nodes].reshape(-1, 3) - self.rest
        return float(-0.5 * np.sum(displacement * (self.stiffness_matrix @ displacement)))

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        def blocks(matrix: object, weight: np.ndarray) -> np.ndarray:
            scale = np.concatenate([matrix.diagonal(), weight, weight])  # type: ignore[attr-defined]
            return (scale[:, None, None] * np.eye(3)).ravel()

        return blocks(self.stiffness_matrix, self.k), blocks(self.damping_matrix, self.c)
