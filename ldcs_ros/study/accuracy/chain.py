"""Chains of links for the independent equations: Lagrange's equations by the velocities of the links' centres."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from ldcs_ros.physics.effects.arms import Arms
    from ldcs_ros.physics.placed_arms import PlacedArm


class Sheet(Protocol):
    """The sheet as chains need it: size [m], nodes along x and y, number of nodes, gravity [m/s^2] of shape (3,)."""

    size: tuple[float, float, float]
    shape: tuple[int, ...]
    n: int
    gravity: np.ndarray


class Chains:
    """The arms of a scene: link angles against their line in the plane of line and normal, tied to the sheet.

    With e = (cos, sin) and n = (-sin, cos) of a link's angle, the centre of link k moves by the sum of l_j n_j phi_j'
    over the links before it and half of its own: M = sum m J^T J + I, and the rest is m J^T J' phi'. Shorter chains
    end in angles that stay 0.

    Attributes:
        count: Number of arms.
        n: Links of the longest one.
    """

    def __init__(self, effect: Arms, sheet: Sheet) -> None:
        self.sheet = sheet
        self.own = [effect.of(one) for one in effect.arms] or [effect, effect]
        self.count, self.n = len(self.own), max(own.links for own in self.own)
        self.direction = np.tile([1.0, 0.0], (self.count, 1))
        self.length = np.zeros((self.count, self.n))
        self.stiffness, self.damping = np.zeros((2, self.count, self.n))
        self.mass, self.start = np.zeros((self.count, self.n)), np.zeros(self.count)
        # Angle of the rib at each station, as weights of the link angles.
        self.tilt = np.zeros((self.count, self.n + 1, self.n))
        for a, own in enumerate(self.own):
            line = effect.arms[a] if effect.arms else None
            if line is not None:
                along = np.subtract(line.end, line.start)
                self.direction[a] = along / np.hypot(*along)
                self.start[a] = float(self.direction[a] @ np.array(line.start))
            m = own.links
            whole = sheet.size[0] if line is None else float(np.hypot(*np.subtract(line.end, line.start)))
            self.length[a, :m] = whole / m
            self.length[a, 0] -= own.rigid_base
            part = np.ones(m)
            part[0] = own.base_joint_share
            self.stiffness[a, :m], self.damping[a, :m] = own.joint_stiffness / part, own.joint_damping / part
            self.mass[a, :m] = own.link_mass
            for s in range(1, m + 1):
                self.tilt[a, s, s - 1] = 1.0
                if own.crosspiece == "bisector" and m > 1:
                    self.tilt[a, s, s - 1] = 0.0
                    first, weights = (s - 1, (0.5, 0.5)) if s < m else (s - 2, (-0.5, 1.5))
                    self.tilt[a, s, first : first + 2] = weights
        self.used = self.mass > 0.0
        self.inertia = np.array([own.link_inertia for own in self.own])
        order = np.arange(self.n)
        share = np.where(order < order[:, None], 1.0, 0.0) + 0.5 * np.eye(self.n)
        self.reach = share * self.length[:, None, :]  # arm, link, angle
        self.own_inertia = self.inertia[:, None, None] * np.eye(self.n) + ~self.used[:, None, :] * np.eye(
            self.n
        )
        self._tie(effect)

    def _tie(self, effect: Arms) -> None:
        ties: list[tuple[int, int, float, float]] = []
        weights: list[np.ndarray] = []
        nx, ny = self.sheet.shape
        for a, own in enumerate(self.own):
            places = (
                self._places_of_line(effect.arms[a], own) if effect.arms else self._places_of_edge(a, own)
            )
            for s, column, row in places:
                for layer in (0, 1):
                    x, y = column * self.sheet.size[0] / (nx - 1), (row / (ny - 1) - 0.5) * self.sheet.size[1]
                    lateral = self.direction[a] @ np.array([y, -x])
                    ties.append((a, s, (layer - 0.5) * self.sheet.size[2] - own.backbone_height, lateral))
                    weights.append(self._bilinear(layer, column, row))
        self.arm, self.station = np.array([tie[:2] for tie in ties]).T
        self.offset, self.lateral = np.array([tie[2:] for tie in ties]).T
        self.weight = np.array(weights)
        self.k, self.c = (
            np.array([getattr(own, name) for own in self.own])[self.arm][:, None]
            for name in ("coupling_stiffness", "coupling_damping")
        )
        base = np.array([own.rigid_base for own in self.own])[self.arm] * (self.station > 0)
        self.base = self.start[self.arm] + base
        self.height = np.array([own.backbone_height for own in self.own])[self.arm]
        before = np.arange(self.n) < self.station[:, None]
        self.before = before * self.length[self.arm]
        self.rib = self.tilt[self.arm, self.station]

    def _places_of_edge(self, a: int, own: Arms) -> list[tuple[int, float, float]]:
        nx, ny = self.sheet.shape
        rows = range(own.width + 1) if a else range(ny - 1, ny - 2 - own.width, -1)
        return [(s, s * (nx - 1) / own.links, float(j)) for s in range(own.links + 1) for j in rows]

    def _places_of_line(self, line: PlacedArm, own: Arms) -> list[tuple[int, float, float]]:
        (nx, ny), (length, width) = self.sheet.shape, self.sheet.size[:2]
        if own.width:
            raise ValueError("the independent equations know listed arms of width 0 only")
        return [
            (s, x / length * (nx - 1), (y / width + 0.5) * (ny - 1))
            for s in range(own.links + 1)
            for x, y in [np.array(line.start) + np.subtract(line.end, line.start) * s / own.links]
        ]

    def _bilinear(self, layer: int, column: float, row: float) -> np.ndarray:
        # Hat functions of all nodes.
        nx, ny = self.sheet.shape
        along = np.maximum(1.0 - np.abs(np.arange(nx) - column), 0.0)
        across = np.maximum(1.0 - np.abs(np.arange(ny) - row), 0.0)
        along, across = along * (along > 1e-9), across * (across > 1e-9)
        weight = np.zeros((2, nx, ny))
        weight[layer] = np.outer(along, across)
        return weight.ravel()

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        """Write the angles of the drive 'curvature' at a time [s] and their rates, shape (count * n,) each."""
        for a, own in enumerate(self.own):
            here = slice(a * self.n, (a + 1) * self.n)
            rise = min(max(time / own.rise_time, 0.0), 1.0)
            middle = np.where(self.used[a], np.cumsum(self.length[a]) - 0.5 * self.length[a], 0.0)
            q[here] = own.curvature * middle * rise**2 * (3.0 - 2.0 * rise)
            u[here] = own.curvature * middle * 6.0 * rise * (1.0 - rise) / own.rise_time

    def accelerations(
        self,
        x: np.ndarray,
        v: np.ndarray,
        angles: np.ndarray,
        rates: np.ndarray,
        torque: np.ndarray | None,
        force: np.ndarray,
    ) -> np.ndarray:
        """Return the angular accelerations, and add the ties' forces on the nodes to `force`.

        Args:
            x: Node positions [m], shape (n_nodes, 3).
            v: Node velocities [m/s], same shape.
            angles: Angles [rad], shape (count * n,), as the result [rad/s^2].
            rates: Their rates [rad/s], same shape.
            torque: Joint torques [N m], shape (count, n); None for none.
            force: Forces on the nodes [N], shape (n_nodes, 3); changed in place.
        """
        phi, rate = angles.reshape(self.count, self.n), rates.reshape(self.count, self.n)
        drive = np.zeros_like(phi) if torque is None else torque
        matrix, push = self._chains(phi, rate, drive)
        self._couple(x, v, phi, rate, force, push)
        return np.asarray(np.linalg.solve(matrix, np.where(self.used, push, 0.0)[..., None])[..., 0].ravel())

    def _chains(self, phi: np.ndarray, rate: np.ndarray, drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cos, sin = np.cos(phi)[:, None], np.sin(phi)[:, None]
        matrix = self.own_inertia
        push = np.zeros_like(phi)
        square = (rate**2)[..., None]
        along = self.direction @ self.sheet.gravity[:2]
        for slope, curve, gravity in (
            (-self.reach * sin, self.reach * cos, along[:, None]),
            (self.reach * cos, self.reach * sin, self.sheet.gravity[2]),
        ):
            turned = slope.transpose(0, 2, 1)
            matrix = matrix + turned @ (self.mass[..., None] * slope)
            centripetal = -(curve @ square)[..., 0]
            push += (turned @ (self.mass * (gravity - centripetal))[..., None])[..., 0]
        bend, bend_rate = phi.copy(), rate.copy()
        bend[:, 1:] -= phi[:, :-1]
        bend_rate[:, 1:] -= rate[:, :-1]
        moment = np.where(self.used, drive - self.stiffness * bend - self.damping * bend_rate, 0.0)
        push += moment
        push[:, :-1] -= moment[:, 1:]
        return matrix, push

    def _couple(
        self,
        x: np.ndarray,
        v: np.ndarray,
        phi: np.ndarray,
        rate: np.ndarray,
        force: np.ndarray,
        push: np.ndarray,
    ) -> None:
        a, dx, dy = self.arm, self.direction[self.arm, 0], self.direction[self.arm, 1]
        cos, sin = np.cos(phi)[a], np.sin(phi)[a]
        angle = (self.rib * phi[a]).sum(axis=1)
        offset_along, offset_up = -self.offset * np.sin(angle), self.offset * np.cos(angle)
        along = self.base + (self.before * cos).sum(axis=1) + offset_along
        up = self.height + (self.before * sin).sum(axis=1) + offset_up
        slope_along = -self.before * sin - offset_up[:, None] * self.rib
        slope_up = self.before * cos + offset_along[:, None] * self.rib
        place = np.stack([dx * along - dy * self.lateral, dy * along + dx * self.lateral, up], axis=1)
        along_rate, up_rate = (slope_along * rate[a]).sum(axis=1), (slope_up * rate[a]).sum(axis=1)
        speed = np.stack([dx * along_rate, dy * along_rate, up_rate], axis=1)
        pull = self.k * (self.weight @ x - place) + self.c * (self.weight @ v - speed)
        force -= self.weight.T @ pull
        moment = slope_along * (dx * pull[:, 0] + dy * pull[:, 1])[:, None] + slope_up * pull[:, 2:]
        np.add.at(push, a, moment)
