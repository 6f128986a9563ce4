"""Two chains of links for the independent equations: Lagrange's equations by the velocities of the links' centres."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from ldcs_ros.physics.effects.arms import Arms


class Sheet(Protocol):
    """The sheet as chains need it: size [m], nodes along x and y, number of nodes, gravity [m/s^2] of shape (3,)."""

    size: tuple[float, float, float]
    shape: tuple[int, ...]
    n: int
    gravity: np.ndarray


class Chains:
    """The arms of a scene: link angles against x in planes y = const, coupled to the sheet by springs and dampers.

    With e = (cos, sin) and n = (-sin, cos) of a link's angle, the centre of link k moves by the sum of l_j n_j phi_j'
    over the links before it and half of its own: M = sum m J^T J + I, and the rest is m J^T J' phi'.
    """

    def __init__(self, arms: Arms, sheet: Sheet) -> None:
        self.arms, self.sheet, self.n = arms, sheet, arms.links
        length, thickness = sheet.size[0], sheet.size[2]
        self.length = np.full(self.n, length / self.n)
        self.length[0] -= arms.rigid_base
        part = np.ones(self.n)
        part[0] = arms.base_joint_share
        self.stiffness, self.damping = arms.joint_stiffness / part, arms.joint_damping / part
        # Angle of the crosspiece at each station, as weights of the link angles.
        self.tilt = np.zeros((self.n + 1, self.n))
        for s in range(1, self.n + 1):
            self.tilt[s, s - 1] = 1.0
            if arms.crosspiece == "bisector" and self.n > 1:
                self.tilt[s] = 0.0
                if s < self.n:
                    self.tilt[s, [s - 1, s]] = 0.5
                else:
                    self.tilt[s, [s - 2, s - 1]] = -0.5, 1.5
        nx, ny = sheet.shape
        self.ties: list[list[tuple[int, float, float, np.ndarray]]] = []
        for rows in (range(ny - 1, ny - 2 - arms.width, -1), range(arms.width + 1)):
            ties = []
            for s in range(self.n + 1):
                column = s * (nx - 1) / self.n
                near = int(np.floor(column + 1e-12))
                part_far = column - near if column - near > 1e-12 else 0.0
                for j in rows:
                    for layer in (0, 1):
                        weight = np.zeros(sheet.n)
                        weight[(layer * nx + near) * ny + j] += 1.0 - part_far
                        if part_far:
                            weight[(layer * nx + near + 1) * ny + j] += part_far
                        y = sheet.size[1] * (j / (ny - 1) - 0.5)
                        ties.append((s, (layer - 0.5) * thickness - arms.backbone_height, y, weight))
            self.ties.append(ties)

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        """Write the angles of the drive 'curvature' at a time [s] and their rates."""
        rise = min(max(time / self.arms.rise_time, 0.0), 1.0)
        middle = np.cumsum(self.length) - 0.5 * self.length
        q[:] = np.tile(self.arms.curvature * middle * rise**2 * (3.0 - 2.0 * rise), 2)
        u[:] = np.tile(self.arms.curvature * middle * 6.0 * rise * (1.0 - rise) / self.arms.rise_time, 2)

    def accelerations(
        self,
        x: np.ndarray,
        v: np.ndarray,
        angles: np.ndarray,
        rates: np.ndarray,
        torque: np.ndarray | None,
        force: np.ndarray,
    ) -> np.ndarray:
        """Return the angular accelerations, shape (2 n,), and add the couplings' forces on the nodes to `force` [N]."""
        result = np.empty(2 * self.n)
        for side in range(2):
            here = slice(side * self.n, (side + 1) * self.n)
            phi, rate = angles[here], rates[here]
            drive = np.zeros(self.n) if torque is None else torque[side]
            matrix, push = self._chain(phi, rate, drive)
            push += self._couple(side, x, v, phi, rate, force)
            result[here] = np.linalg.solve(matrix, push)
        return result

    def _chain(self, phi: np.ndarray, rate: np.ndarray, drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n, m = self.n, self.arms.link_mass
        matrix, push = self.arms.link_inertia * np.eye(n), np.zeros(n)
        gravity = self.sheet.gravity[[0, 2]]
        for k in range(n):
            reach = np.where(np.arange(n) < k, self.length, 0.0)
            reach[k] = 0.5 * self.length[k]
            by_angle = reach * np.array([-np.sin(phi), np.cos(phi)])
            centripetal = -(reach * np.array([np.cos(phi), np.sin(phi)])) @ rate**2
            matrix = matrix + m * by_angle.T @ by_angle
            push += by_angle.T @ (m * (gravity - centripetal))
        moment = (
            drive - self.stiffness * np.diff(phi, prepend=0.0) - self.damping * np.diff(rate, prepend=0.0)
        )
        push += moment
        push[:-1] -= moment[1:]
        return matrix, push

    def _couple(
        self, side: int, x: np.ndarray, v: np.ndarray, phi: np.ndarray, rate: np.ndarray, force: np.ndarray
    ) -> np.ndarray:
        push = np.zeros(self.n)
        k, c = self.arms.coupling_stiffness, self.arms.coupling_damping
        for s, offset, y, weight in self.ties[side]:
            before = np.arange(self.n) < s
            angle = float(self.tilt[s] @ phi)
            start = np.array([self.arms.rigid_base if s else 0.0, self.arms.backbone_height])
            end = start + (before * self.length * np.array([np.cos(phi), np.sin(phi)])).sum(axis=1)
            end = end + offset * np.array([-np.sin(angle), np.cos(angle)])
            slope = before * self.length * np.array([-np.sin(phi), np.cos(phi)])
            slope = slope - offset * np.outer([np.cos(angle), np.sin(angle)], self.tilt[s])
            there, speed = weight @ x, weight @ v
            gap = there - np.array([end[0], y, end[1]])
            moving = slope @ rate
            pull = k * gap + c * (speed - np.array([moving[0], 0.0, moving[1]]))
            force -= weight[:, None] * pull
            push += slope.T @ pull[[0, 2]]
        return push
