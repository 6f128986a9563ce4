"""The force's slope by a number of a scene as one compiled function, for scenes that the compiled force covers."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from ldcs_ros.integrators.implicit.bordered_kernel import fill_residual
from ldcs_ros.physics.arm import NO_ARMS, ArmTables
from ldcs_ros.physics.compiled import compiled
from ldcs_ros.physics.kernels.total_force import SCRATCH_ROWS, ForceTables, TotalForce
from ldcs_ros.physics.model import Model


class SideTables(NamedTuple):
    """What differs in a scene with another number: f - M a without the rest.

    Attributes:
        force: Its effects.
        steady: Its constant forces, shape (n_coordinates,).
        mass: Of the free coordinates of nodes [kg], 0 for angles, shape (n_free,).
        inertia: Room for the arms' mass matrices where they differ, shape (n_arms or 0, n_links, n_links).
    """

    force: ForceTables
    steady: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray


@compiled
def fill_slopes(sides, drives, width, free, scratch, q, u, a, slopes):  # type: ignore[no-untyped-def]
    """Write d(f - M a)/d(number) of the free coordinates at instants, shape (n_instants, n_free).

    Args:
        sides: `SideTables` of the number ahead, then before; the latter counts only what is not linear in it.
        drives: Drive torques of both [N m], shape (2, n_instants, n_arms, n_links).
        width: Difference of the number between both sides.
        free: Free coordinates.
        scratch: Room of the force.
        q, u, a: Motions, a row each.
        slopes: The result.
    """
    ahead, before = sides
    force, other = np.empty(q.shape[1]), np.empty(free.size)
    is_linear = before.force.arms.arms.size == 0 and before.force.contact_at.size == 0
    for k in range(q.shape[0]):
        fill_residual(
            ahead.force, drives[0, k], ahead.steady, scratch, free, ahead.mass, q[k], u[k], a[k],
            ahead.inertia, force, slopes[k],
        )  # fmt: skip
        if not is_linear:
            fill_residual(
                before.force, drives[1, k], before.steady, scratch, free, before.mass, q[k], u[k], a[k],
                before.inertia, force, other,
            )  # fmt: skip
            for i in range(free.size):
                slopes[k, i] -= other[i]
        for i in range(free.size):
            slopes[k, i] /= width


class NumberKernel:
    """The tables of both neighbours of a scene for `fill_slopes`.

    The force is linear in the tables of springs, drag, masses and constant forces: their difference is on one side.

    Args:
        models: The models with the number ahead and before, both covered by the compiled force.
        width: Difference of the number.
        terms: Names of the effects whose force differs.
        changes_inertia: Whether the arms' mass matrices differ.
    """

    def __init__(
        self, models: tuple[Model, Model], width: float, terms: Collection[str], *, changes_inertia: bool
    ) -> None:
        ahead, before = (TotalForce(model) for model in models)
        model, self._width = models[0], width
        self._free, n_free = model.free, len(model.free)
        self._scratch = np.zeros((SCRATCH_ROWS, model.lattice.n_nodes))
        shape = ahead.tables.arms.links.shape
        inertia = np.zeros((shape[0] if changes_inertia else 0, shape[1], shape[1]))
        masses = np.zeros((2, n_free))
        for mass, side in zip(masses, models, strict=True):
            mass[: side.n_free_nodes] = side.mass
        one, other = ahead.tables, before.tables
        n_drag = one.drag.size if "drag" in terms else 0
        springs = "springs" in terms
        difference = ForceTables(
            one.family if springs else one.family[:, :0].copy(),
            one.spring - other.spring if springs else one.spring[:, :0].copy(),
            (one.drag - other.drag)[:n_drag],
            *_nonlinear(one, terms),
        )
        rest = ForceTables(
            other.family[:, :0].copy(), other.spring[:, :0].copy(), np.zeros(0), *_nonlinear(other, terms)
        )
        self._sides = (
            SideTables(difference, ahead.constant - before.constant, masses[0] - masses[1], inertia),
            SideTables(rest, np.zeros(model.n_coordinates), np.zeros(n_free), inertia),
        )

    def fill(
        self, drives: np.ndarray, q: np.ndarray, u: np.ndarray, a: np.ndarray, slopes: np.ndarray
    ) -> None:
        """Write the slopes at instants; see `fill_slopes`."""
        fill_slopes(self._sides, drives, self._width, self._free, self._scratch, q, u, a, slopes)


def _nonlinear(tables: ForceTables, terms: Collection[str]) -> tuple[np.ndarray, np.ndarray, ArmTables]:
    touches = "support" in terms or "floor" in terms
    count = tables.contact_at.size if touches else 0
    contact = tables.contact if touches else tables.contact[:, :0].copy()
    return tables.contact_at[:count], contact, tables.arms if "arms" in terms else NO_ARMS
