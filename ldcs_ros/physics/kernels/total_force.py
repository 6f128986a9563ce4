"""The force of all effects of a scene in one compiled call, springs in structure-of-arrays form.

A family is all springs of one offset between node indices: one contiguous loop without branches serves it. An offset
that wraps around an edge belongs to no spring, so its stiffness and damping are zero. Tables of effects
that the scene does not name are empty.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ldcs_ros.physics import arm
from ldcs_ros.physics.arm import NO_ARMS, ArmTables
from ldcs_ros.physics.compiled import compiled, compiled_fast
from ldcs_ros.physics.inputs import NO_INPUTS, HeldCommands
from ldcs_ros.physics.kernels.coverage import spring_offsets
from ldcs_ros.physics.model import Model

if TYPE_CHECKING:
    from ldcs_ros.physics.effects.springs import AxialTerm

# Effects whose force never changes.
CONSTANT = ("gravity", "force")
# Rows of the scratch array: positions, rates, forces, and a family's forces, three axes each.
SCRATCH_ROWS = 12


class ForceTables(NamedTuple):
    """The numbers of all effects, as the kernel reads them.

    Attributes:
        family: Offset, first near node and one after the last near node of each family, shape (3, n_families).
        spring: k [N/m], k times rest length [N] and c [N s/m] by near node, shape (3, n_families, n_nodes).
        drag: Force of a node by its squared speed [N s^2/m^2], shape (n_nodes,), or (0,) without drag.
        contact_at: Vertical coordinate of each contact, shape (n_contacts,).
        contact: Height [m], stiffness [N/m], damping [s/m], width [m], shape (4, n_contacts).
        arms: The tables of the arms.
    """

    family: np.ndarray
    spring: np.ndarray
    drag: np.ndarray
    contact_at: np.ndarray
    contact: np.ndarray
    arms: ArmTables


@compiled_fast
def _add_family(x, v, f, pull, offset, begin, end, k, pretension, c):  # type: ignore[no-untyped-def]
    # Slices of one length, so that no index can be negative: the compiler then uses vector registers.
    ax, ay, az = x[0, begin:end], x[1, begin:end], x[2, begin:end]
    avx, avy, avz = v[0, begin:end], v[1, begin:end], v[2, begin:end]
    begin_far, end_far = begin + offset, end + offset
    bx, by, bz = x[0, begin_far:end_far], x[1, begin_far:end_far], x[2, begin_far:end_far]
    bvx, bvy, bvz = v[0, begin_far:end_far], v[1, begin_far:end_far], v[2, begin_far:end_far]
    px, py, pz = pull[0], pull[1], pull[2]
    k, pretension, c = k[begin:end], pretension[begin:end], c[begin:end]
    for e in range(ax.size):
        dx, dy, dz = bx[e] - ax[e], by[e] - ay[e], bz[e] - az[e]
        # tension = (k (L - L0) + c (n . dv)) / L with n = d / L, so that tension d is the force.
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        rate = dx * (bvx[e] - avx[e]) + dy * (bvy[e] - avy[e]) + dz * (bvz[e] - avz[e])
        tension = k[e] - pretension[e] * inverse + c[e] * rate * inverse * inverse
        px[e], py[e], pz[e] = tension * dx, tension * dy, tension * dz
    for axis in range(3):
        p, near, far = pull[axis], f[axis, begin:end], f[axis, begin_far:end_far]
        for e in range(near.size):
            near[e] += p[e]
        for e in range(far.size):
            far[e] -= p[e]


@compiled
def _add_contact(q, u, at, contact, force):  # type: ignore[no-untyped-def]
    # The law of `PlaneContact`.
    for c in range(at.size):
        depth, width = contact[0, c] - q[at[c]], contact[3, c]
        if depth > 0.0:
            push = depth * depth / (2.0 * width) if depth < width else depth - 0.5 * width
            force[at[c]] += contact[1, c] * push * max(0.0, 1.0 - contact[2, c] * u[at[c]])


@compiled
def add_total_force(tables, drive, q, u, scratch, force):  # type: ignore[no-untyped-def]
    """Add the force of all effects [N, N m] to `force`, which holds the constant ones.

    Args:
        tables: The effects' `ForceTables`.
        drive: Drive torque of each joint [N m], shape (n_arms, n_links).
        q: Coordinates [m, rad], shape (n_coordinates,).
        u: Their rates, same shape.
        scratch: Room for structures of arrays, shape (SCRATCH_ROWS, n_nodes).
        force: Same shape as q.
    """
    n = scratch.shape[1]
    # Structures of arrays: one row an axis, so that a family reads and writes contiguous slices.
    x, v, f, pull = scratch[0:3], scratch[3:6], scratch[6:9], scratch[9:12]
    for axis in range(3):
        for e in range(n):
            x[axis, e] = q[3 * e + axis]
            v[axis, e] = u[3 * e + axis]
            f[axis, e] = force[3 * e + axis]
    for k in range(tables.family.shape[1]):
        offset, begin, end = tables.family[0, k], tables.family[1, k], tables.family[2, k]
        spring = tables.spring
        _add_family(x, v, f, pull, offset, begin, end, spring[0, k], spring[1, k], spring[2, k])
    for e in range(tables.drag.size):
        factor = tables.drag[e] * math.sqrt(v[0, e] ** 2 + v[1, e] ** 2 + v[2, e] ** 2)
        for axis in range(3):
            f[axis, e] -= factor * v[axis, e]
    for axis in range(3):
        for e in range(n):
            force[3 * e + axis] = f[axis, e]
    _add_contact(q, u, tables.contact_at, tables.contact, force)
    table = tables.arms
    links = table.links.shape[1]
    if links > 0:
        first = 3 * n
        phi, rate = q[first:].reshape(-1, links), u[first:].reshape(-1, links)
        torque = force[first:].reshape(-1, links)
        arm.add_chain_force(phi, rate, table.arms, table.links, drive, torque)
        arm.add_coupling_force(
            q,
            u,
            phi,
            rate,
            table.arms,
            table.links,
            table.ribs,
            table.couplings,
            table.nodes,
            table.weight,
            force,
            torque,
        )


class TotalForce:
    """The kernel with the tables of one model.

    Args:
        model: A model that the kernel covers (`coverage.py`).
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.tables = _tables(model)
        self.constant = np.zeros(model.n_coordinates)
        rest, still = model.reference_state()
        for term in model.terms:
            if term.name in CONSTANT:
                term.add_force(0.0, rest, still, NO_INPUTS, self.constant)
        self.scratch = np.zeros((SCRATCH_ROWS, model.lattice.n_nodes))
        self._no_drive = np.zeros((0, 0))

    def drive(self, time: float, inputs: HeldCommands) -> np.ndarray:
        """Return the drive torque of each joint [N m], shape (n_arms, n_links)."""
        arms = self.model.arms
        return self._no_drive if arms is None else np.ascontiguousarray(arms.drive_torque(time, inputs))

    def steady(self, inputs: HeldCommands) -> np.ndarray | None:
        """Return the constant forces with the held wrenches, shape (n_coordinates,); None if a wrench rotates."""
        if not inputs.wrenches:
            return self.constant
        term = self.model.wrench
        if term is None or any(
            any(wrench.torque) or not term.frame(name)[1] for name, wrench in inputs.wrenches.items()
        ):
            return None
        steady, (rest, still) = self.constant.copy(), self.model.reference_state()
        term.add_force(0.0, rest, still, inputs, steady)
        return steady

    def __call__(self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands) -> np.ndarray:
        """Return the force on all coordinates [N, N m], shape (n_coordinates,).

        Raises:
            ValueError: A held wrench rotates with the sheet.
        """
        steady = self.steady(inputs)
        if steady is None:
            raise ValueError(
                "a held wrench rotates with the sheet; the compiled force takes constant wrenches only"
            )
        force = steady.copy()
        add_total_force(self.tables, self.drive(time, inputs), q, u, self.scratch, force)
        return force


def _tables(model: Model) -> ForceTables:
    n = model.lattice.n_nodes
    family, spring, drag = np.zeros((3, 0), dtype=np.int64), np.zeros((3, 0, n)), np.zeros(0)
    contact_at, contact = [np.zeros(0, dtype=np.int64)], [np.zeros((4, 0))]
    arms = NO_ARMS
    # Effects are imported here, where a scene has named them, and no others.
    for term in model.terms:
        if term.name == "springs":
            from ldcs_ros.physics.effects.springs import AxialTerm

            assert isinstance(term, AxialTerm)
            family, spring = _families(term, n)
        elif term.name == "drag":
            from ldcs_ros.physics.effects.drag import DragTerm

            assert isinstance(term, DragTerm)
            drag = term.scale
        elif term.name in ("support", "floor"):
            from ldcs_ros.physics.contact import PlaneContact

            assert isinstance(term, PlaneContact)
            contact_at.append(term.vertical)
            row = np.array([term.height, term.stiffness, term.damping, term.contact_width])
            contact.append(np.tile(row[:, None], len(term.vertical)))
        elif term.name == "arms":
            from ldcs_ros.physics.effects.arms import ArmsTerm

            assert isinstance(term, ArmsTerm)
            arms = term.tables
    return ForceTables(
        family,
        spring,
        drag,
        np.concatenate(contact_at),
        np.concatenate(contact, axis=1),
        arms,
    )


def _families(term: AxialTerm, n: int) -> tuple[np.ndarray, np.ndarray]:
    offsets = spring_offsets(term)
    which = np.searchsorted(offsets, term.b - term.a)
    spring = np.zeros((3, len(offsets), n))
    for row, value in enumerate((term.k, term.k * term.rest_length, term.c)):
        spring[row, which, term.a] = value
    begin = [int(term.a[which == f].min()) for f in range(len(offsets))]
    end = [int(term.a[which == f].max()) + 1 for f in range(len(offsets))]
    return np.array([offsets, begin, end], dtype=np.int64), spring
