"""How points, nodes and arm links move: positions, frames, and their first and second time derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from scipy import sparse

from ldcs_ros.physics.effects.arms import ArmsTerm
from ldcs_ros.physics.points import Point, quaternion

Derivatives = tuple[np.ndarray, np.ndarray, np.ndarray]
"""A quantity with its first and second time derivative."""


@dataclass(frozen=True)
class Motions:
    """How things move at an instant, in ldcs_base; row k belongs to the k-th.

    Attributes:
        position: Where they are [m], shape (n, 3).
        axes: Their frames, axes as columns, shape (n, 3, 3).
        velocity: [m/s], shape (n, 3).
        turning: Angular velocity [rad/s], shape (n, 3).
        acceleration: [m/s^2], shape (n, 3).
        turning_rate: Angular acceleration [rad/s^2], shape (n, 3).
        ends: Where they begin and end [m], shape (n, 2, 3): the same for what has no length.
    """

    position: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray
    turning: np.ndarray
    acceleration: np.ndarray
    turning_rate: np.ndarray
    ends: np.ndarray

    def orientation(self, row: int) -> list[float]:
        """Return an orientation as a unit quaternion x, y, z, w."""
        turned: list[float] = quaternion(self.axes[row]).tolist()
        return turned

    def behind(self, other: Motions) -> Motions:
        """Return these rows behind those of another."""
        names = [field.name for field in fields(self)]
        return Motions(
            **{name: np.concatenate([getattr(other, name), getattr(self, name)]) for name in names}
        )


class Means:
    """Motions of points: position and tangents of each are fixed means of the lattice's nodes.

    Args:
        points: The points; all of one lattice.
        n_nodes: Its number of nodes.
    """

    def __init__(self, points: Sequence[Point], n_nodes: int) -> None:
        here = [point.nodes for point in points]
        behind, ahead, right, left = zip(*(point.neighbours for point in points), strict=True)
        self._place = _mean(here, n_nodes)
        self._along_x = _mean(ahead, n_nodes) - _mean(behind, n_nodes)
        self._along_y = _mean(left, n_nodes) - _mean(right, n_nodes)

    def motions(self, nodes: Derivatives) -> Motions:
        """Return how they move, from the positions of the nodes [m], shape (n_nodes, 3), and their derivatives."""
        place, velocity, acceleration = (self._place @ flat for flat in nodes)
        along_x, along_y = (tuple(mean @ flat for flat in nodes) for mean in (self._along_x, self._along_y))
        x, z = _unit(along_x), _unit(_cross(along_x, along_y))
        axes = (x, _cross(z, x), z)
        return Motions(
            position=place,
            axes=np.stack([axis[0] for axis in axes], axis=-1),
            velocity=velocity,
            # e' = w x e for each axis e, so that sum e x e' = 2 w, and once more derived sum e x e'' = 2 w'.
            turning=0.5 * np.sum([np.cross(axis[0], axis[1]) for axis in axes], axis=0),
            acceleration=acceleration,
            turning_rate=0.5 * np.sum([np.cross(axis[0], axis[2]) for axis in axes], axis=0),
            ends=np.stack([place, place], axis=1),
        )


def link_motions(arms: ArmsTerm, across: Sequence[float], angles: Derivatives) -> Motions:
    """Return how the links of both arms move, left arm first, base to tip; their places are their middles.

    Args:
        arms: The arms' term of the model.
        across: Where each arm is along y [m].
        angles: Angles to the x axis in the XZ plane [rad], shape (2, n_links), and their derivatives.
    """
    phi, rate, bend = angles
    along, up, zero = np.cos(phi), np.sin(phi), np.zeros_like(phi)
    axis = np.stack([along, zero, up], axis=-1)
    normal = np.stack([-up, zero, along], axis=-1)
    step = arms.link_length[:, None] * axis
    step1 = (arms.link_length * rate)[..., None] * normal
    step2 = arms.link_length[:, None] * (bend[..., None] * normal - (rate**2)[..., None] * axis)
    base = np.array([[arms.base[0], y, arms.base[1]] for y in across])[:, None, :]
    end, velocity, acceleration = (np.cumsum(one, axis=1) for one in (step, step1, step2))
    end = end + base
    side = np.broadcast_to([0.0, 1.0, 0.0], axis.shape)
    return Motions(
        position=(end - 0.5 * step).reshape(-1, 3),
        axes=np.stack([axis, side, normal], axis=-1).reshape(-1, 3, 3),
        velocity=(velocity - 0.5 * step1).reshape(-1, 3),
        # An angle that grows lifts the link: it turns about -y.
        turning=(-rate[..., None] * side).reshape(-1, 3),
        acceleration=(acceleration - 0.5 * step2).reshape(-1, 3),
        turning_rate=(-bend[..., None] * side).reshape(-1, 3),
        ends=np.stack([end - step, end], axis=2).reshape(-1, 2, 3),
    )


def _mean(blocks: Sequence[np.ndarray], n_nodes: int) -> sparse.csr_array:
    lengths = np.array([len(block) for block in blocks])
    weights = np.repeat(1.0 / lengths, lengths)
    starts = np.concatenate([[0], np.cumsum(lengths)])
    return sparse.csr_array((weights, np.concatenate(blocks), starts), shape=(len(blocks), n_nodes))


def _cross(a: Derivatives, b: Derivatives) -> Derivatives:
    return (
        np.cross(a[0], b[0]),
        np.cross(a[1], b[0]) + np.cross(a[0], b[1]),
        np.cross(a[2], b[0]) + 2.0 * np.cross(a[1], b[1]) + np.cross(a[0], b[2]),
    )


def _unit(a: Derivatives) -> Derivatives:
    # From a = s u: a' = s' u + s u' and a'' = s'' u + 2 s' u' + s u'', where u . u' = 0.
    s = np.linalg.norm(a[0], axis=-1, keepdims=True)
    u = a[0] / s
    s1 = np.sum(u * a[1], axis=-1, keepdims=True)
    u1 = (a[1] - s1 * u) / s
    s2 = np.sum(u1 * a[1] + u * a[2], axis=-1, keepdims=True)
    return u, u1, (a[2] - s2 * u - 2.0 * s1 * u1) / s
