"""Independent equations of motion in plain NumPy: the numbers of a scene are shared with the product, no code is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import bmat, csc_matrix, csr_matrix, identity

from ldcs_ros.schema.fields import SheetPlace
from ldcs_ros.study.accuracy.chain import Chains
from ldcs_ros.study.accuracy.places import Place, frame_of, place_of

if TYPE_CHECKING:
    from ldcs_ros.scene.scene import Scene


class Equations:
    """A scene's accelerations q'' = M^-1 f for flat coordinates: nodes (layer, i, j, axis), then link angles.

    Attributes:
        free: Indices of the coordinates that no effect prescribes.
        held: The drive torque of each joint [N m], shape (n_arms, n_links), or None.
        pressure: A function of time that returns the gauge pressure of each arm [Pa], or None.
        wrenches: Wrenches by frame: (force [N], torque [N m]).
    """

    def __init__(self, scene: Scene) -> None:
        lattice = scene.lattice
        self.size, self.shape = lattice.size, tuple(lattice.nodes)
        nx, ny = self.shape
        self.grid = np.array(list(product(range(2), range(nx), range(ny))))
        self.n = len(self.grid)
        unit = np.array([self.size[0] / (nx - 1), self.size[1] / (ny - 1), self.size[2]])
        self.rest = self.grid[:, [1, 2, 0]] * unit - np.array([0.0, 0.5 * self.size[1], 0.5 * self.size[2]])
        cut_out = np.zeros(self.n, dtype=bool)
        cut_out[lattice.missing] = True
        pairs = [
            (a, b)
            for a in np.flatnonzero(~cut_out)
            for b in np.flatnonzero(np.abs(self.grid - self.grid[a]).max(axis=1) == 1)
            if b > a and not cut_out[b]
        ]
        self.a, self.b = np.array(pairs).T
        self.vector = self.rest[self.b] - self.rest[self.a]
        self.length = np.linalg.norm(self.vector, axis=1)
        # Adds each spring's pull to its first node and subtracts it from its second.
        ends, spring = np.concatenate([self.a, self.b]), np.arange(len(pairs))
        signs = np.repeat([1.0, -1.0], len(pairs))
        self.incidence = csr_matrix((signs, (ends, np.tile(spring, 2))), shape=(self.n, len(pairs)))
        effects: list[Any] = list(scene.effects)
        self.effects: dict[str, Any] = {effect.name: effect for effect in effects}
        self.points = {
            name: Place(point.layers, *self._columns_and_rows(point.nodes))
            for name, point in scene.points.items()
        }
        # Numbers of a scene: masses, and stiffnesses that regions or a material set.
        self.mass = lattice.node_mass.copy()
        self.mass[cut_out] = 1.0
        self.constant = np.zeros((self.n, 3))
        self.gravity = np.zeros(3)
        fixed = np.tile(cut_out[:, None], (1, 3))
        for effect in effects:
            if effect.name == "payload":
                nodes = self._nodes(effect.at)
                self.mass[nodes] += effect.mass / len(nodes)
            elif effect.name == "force":
                nodes = self._nodes(effect.at)
                self.constant[nodes] += np.array(effect.value) / len(nodes)
            elif effect.name == "gravity":
                self.gravity = np.array(effect.acceleration)
            elif effect.name == "clamp":
                if effect.between is not None or effect.box is not None:
                    raise ValueError("the independent equations know clamped edges only")
                fixed[self._edge(effect.edge)] = True
        self.constant += self.mass[:, None] * self.gravity
        self.driven = np.zeros(self.n, dtype=bool)
        if "driven_edges" in self.effects:
            for edge in self.effects["driven_edges"].edges:
                self.driven |= self._edge(edge)
            fixed[self.driven] = True
        area = np.outer(*(np.where((np.arange(m) % (m - 1)) == 0, 0.5, 1.0) for m in self.shape)).ravel()
        self.area = np.tile(area, 2) * unit[0] * unit[1]
        self.chains = Chains(self.effects["arms"], self) if "arms" in self.effects else None
        moving = [~fixed.ravel()]
        if self.chains is not None:
            moving.append(self.chains.used.ravel() & (self.effects["arms"].drive != "curvature"))
        self.free = np.flatnonzero(np.concatenate(moving))
        self.n_coordinates = sum(len(part) for part in moving)
        self.held: np.ndarray | None = None
        self.pressure: Callable[[float], np.ndarray] | None = None
        self.wrenches: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.pushed_frames = {command.wrench[0] for command in scene.inputs if command.wrench is not None}
        springs = self.effects.get("springs")
        if springs is not None:
            if scene.material is None:
                self.k, self.c = (
                    value * lattice.spring_factor(name)
                    for name, value in (("stiffness", springs.stiffness), ("damping", springs.damping))
                )
            else:
                self.k = scene.material.stiffness(lattice)
                self.c = scene.material.relaxation_time * scene.material.stiffness(lattice, "damping")
        if springs is not None and springs.law == "corotational":
            # A star a node: its springs, padded with weight zero to the most that a node has.
            stars = [np.flatnonzero((self.a == i) | (self.b == i)) for i in range(self.n)]
            most = max(len(star) for star in stars)
            self.member = np.zeros((self.n, most), dtype=int)
            self.weight = np.zeros((self.n, most))
            for i, star in enumerate(stars):
                self.member[i, : len(star)] = np.where(self.a[star] == i, self.b[star], self.a[star])
                self.weight[i, : len(star)] = 1.0

    def _nodes(self, at: str | Sequence[str | int] | SheetPlace) -> np.ndarray:
        if isinstance(at, SheetPlace):
            (nx, ny), (length, width) = self.shape, self.size[:2]
            column, row = at.x / length * (nx - 1), (at.y / width + 0.5) * (ny - 1)
            if abs(column - round(column)) + abs(row - round(row)) > 1e-9:
                raise ValueError("the independent equations know places on nodes only")
            at = (str(at.layer), round(column), round(row))
        return place_of(at, self.shape, self.points).nodes(self.grid)

    def _columns_and_rows(self, nodes: np.ndarray) -> tuple[tuple[int, ...], tuple[int, ...]]:
        place = self.grid[nodes]
        columns, rows = (tuple(int(n) for n in np.unique(place[:, axis])) for axis in (1, 2))
        return columns, rows

    def _edge(self, name: str) -> np.ndarray:
        axis = 1 if name.startswith("x") else 2
        last = self.shape[axis - 1] - 1
        edge: np.ndarray = self.grid[:, axis] == (0 if name.endswith("min") else last)
        return edge

    def begin(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates and rates of the flat sheet at rest, shape (n_coordinates,) each."""
        q, u = np.zeros(self.n_coordinates), np.zeros(self.n_coordinates)
        q[: 3 * self.n] = self.rest.ravel()
        self.prescribe(0.0, q, u)
        return q, u

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        """Write driven coordinates and rates at a time [s], shape (n_coordinates,) each; clamped ones stay."""
        if self.driven.any():
            effect = self.effects["driven_edges"]
            rise = min(max(time / effect.rise_time, 0.0), 1.0)
            kappa = effect.curvature * (3.0 - 2.0 * rise) * rise**2
            rate = effect.curvature * 6.0 * rise * (1.0 - rise) / effect.rise_time
            x, y, z = self.rest[self.driven].T
            # (x, z) of an arc is the integral of (cos, sin)(kappa s): Gauss's rule with 30 points is exact to rounding.
            place, speed = arc(x, kappa)
            normal = np.stack([-np.sin(kappa * x), np.cos(kappa * x)], axis=1)
            turn = np.stack([-np.cos(kappa * x), -np.sin(kappa * x)], axis=1) * x[:, None]
            place, speed = place + z[:, None] * normal, rate * (speed + z[:, None] * turn)
            q[: 3 * self.n].reshape(-1, 3)[self.driven] = np.stack([place[:, 0], y, place[:, 1]], axis=1)
            u[: 3 * self.n].reshape(-1, 3)[self.driven] = np.stack([speed[:, 0], 0 * y, speed[:, 1]], axis=1)
        if self.chains is not None and self.effects["arms"].drive == "curvature":
            self.chains.prescribe(time, q[3 * self.n :], u[3 * self.n :])

    def accelerations(self, time: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the accelerations of all coordinates, shape (n_coordinates,); the prescribed ones mean nothing."""
        x, v = q[: 3 * self.n].reshape(-1, 3), u[: 3 * self.n].reshape(-1, 3)
        force = self.constant + self._springs(x, v)
        if "drag" in self.effects:
            drag = self.effects["drag"]
            speed = np.linalg.norm(v, axis=1, keepdims=True)
            force -= 0.25 * drag.density * drag.coefficient * self.area[:, None] * speed * v
        for name in ("floor", "support"):
            if name in self.effects:
                self._contact(name, x, v, force)
        for frame, (push, moment) in self.wrenches.items():
            self._wrench(frame, push, moment, x, force)
        result = np.empty_like(q)
        if self.chains is not None:
            torque = None
            if self.effects["arms"].drive == "torque":
                torque = self.held
            elif self.pressure is not None:
                gain = np.array([own.pressure_gain for own in self.chains.own])
                torque = np.outer(gain * self.pressure(time), np.ones(self.chains.n))
            result[3 * self.n :] = self.chains.accelerations(
                x, v, q[3 * self.n :], u[3 * self.n :], torque, force
            )
        result[: 3 * self.n] = (force / self.mass[:, None]).ravel()
        return result

    def pattern(self) -> csc_matrix:
        """Return where the slope of (q, u) depends on (q, u), for free coordinates."""
        near = np.eye(self.n, dtype=bool)
        near[self.a, self.b] = near[self.b, self.a] = True
        if "springs" in self.effects and self.effects["springs"].law == "corotational":
            near = near.astype(int) @ near > 0  # a star's rotation depends on all of its nodes
        for frame in self.pushed_frames:
            place = place_of(frame.removesuffix("_aligned"), self.shape, self.points)
            patch = Place((0, 1), place.columns, place.rows).within(self.grid, 1)
            near[np.ix_(patch, patch)] = True
        whole = np.zeros((self.n_coordinates, self.n_coordinates), dtype=bool)
        nodes = 3 * self.n
        whole[:nodes, :nodes] = np.kron(near, np.ones((3, 3), dtype=bool))
        for a in range(self.chains.count if self.chains is not None else 0):
            assert self.chains is not None
            held = np.flatnonzero((self.chains.weight[self.chains.arm == a] > 0.0).any(axis=0))
            # The masses of a chain couple its angles, so each of them feels all nodes that it holds.
            angles = nodes + a * self.chains.n + np.arange(self.chains.n)
            held = (3 * held[:, None] + np.arange(3)).ravel()
            whole[np.ix_(angles, angles)] = whole[np.ix_(angles, held)] = whole[np.ix_(held, angles)] = True
            for tie in self.chains.weight[self.chains.arm == a] > 0.0:
                corners = (3 * np.flatnonzero(tie)[:, None] + np.arange(3)).ravel()
                whole[np.ix_(corners, corners)] = True
        part = csc_matrix(whole[np.ix_(self.free, self.free)])
        return csc_matrix(bmat([[None, identity(len(self.free))], [part, part]]))

    def _springs(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        force = np.zeros_like(x)
        effect = self.effects.get("springs")
        if effect is None:
            return force
        if effect.law == "corotational":
            return self._corotational(x, v, effect.stiffness, effect.damping)
        k, c = self.k, self.c
        r, w = x[self.b] - x[self.a], v[self.b] - v[self.a]
        if effect.law == "axiswise":
            pull = k[:, None] * (r - self.vector) + c[:, None] * w
        else:
            length = np.sqrt(np.einsum("ij,ij->i", r, r))
            axis = r / length[:, None]
            pull = (k * (length - self.length) + c * (axis * w).sum(axis=1))[:, None] * axis
        return np.asarray(self.incidence @ pull)

    def _corotational(self, x: np.ndarray, v: np.ndarray, k: float, c: float) -> np.ndarray:
        # Kabsch's best rotation of each star by singular values; least-dissipation spin by normal equations.
        on = self.weight[:, :, None]
        d = (self.rest[self.member] - self.rest[:, None]) * on
        r, w = (x[self.member] - x[:, None]) * on, (v[self.member] - v[:, None]) * on
        left, _, right = np.linalg.svd(np.einsum("nsi,nsj->nij", r, d))
        left[:, :, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))[:, None]
        rotated = np.einsum("nij,njk,nsk->nsi", left, right, d)
        square = (r**2).sum(axis=(1, 2))
        inertia = square[:, None, None] * np.eye(3) - np.einsum("nsi,nsj->nij", r, r)
        spin = np.linalg.solve(inertia, np.cross(r, w).sum(axis=1)[:, :, None])[:, :, 0]
        pull = 0.5 * (k * (r - rotated) + c * (w - np.cross(spin[:, None], r)))
        force = pull.sum(axis=1)
        np.subtract.at(force, self.member[self.weight > 0.0], pull[self.weight > 0.0])
        return np.asarray(force)

    def _contact(self, name: str, x: np.ndarray, v: np.ndarray, force: np.ndarray) -> None:
        effect = self.effects[name]
        if name == "floor":
            touched, height = np.ones(self.n, dtype=bool), effect.height
        else:
            nx, ny = self.shape
            layer, i, j = self.grid.T
            touched = (layer == 0) & (i <= effect.length * (nx - 1) * (1 + 1e-9) + 1e-9)
            touched &= np.minimum(j, ny - 1 - j) <= effect.width
            height = -0.5 * self.size[2]
        depth = np.maximum(height - x[:, 2], 0.0)
        w = effect.onset
        push = effect.stiffness * np.where(depth < w, depth**2 / (2 * w), depth - 0.5 * w)
        force[:, 2] += touched * push * np.maximum(1.0 - effect.damping * v[:, 2], 0.0)

    def _wrench(
        self, frame: str, push: np.ndarray, moment: np.ndarray, x: np.ndarray, force: np.ndarray
    ) -> None:
        place = place_of(frame.removesuffix("_aligned"), self.shape, self.points)
        axes = np.eye(3) if frame.endswith("_aligned") else frame_of(place, self.shape, self.grid, x)
        nodes = place.nodes(self.grid)
        force[nodes] += axes @ push / len(nodes)
        if np.any(moment):
            patch = place.patch(self.grid)
            arm = x[patch] - x[patch].mean(axis=0)
            tensor = sum(np.dot(r, r) * np.eye(3) - np.outer(r, r) for r in arm)
            force[patch] += np.cross(np.linalg.solve(tensor, axes @ moment), arm)


# Nodes and weights of Gauss's rule with 60 points.
GAUSS = np.polynomial.legendre.leggauss(60)


def arc(s: np.ndarray, kappa: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (x, z) of an arc at lengths s [m], shape (n, 2), and their derivatives by the curvature."""
    nodes, weights = GAUSS
    t = 0.5 * (nodes + 1.0) * s[:, None]
    scale = 0.5 * s[:, None] * weights
    place = [(scale * np.cos(kappa * t)).sum(axis=1), (scale * np.sin(kappa * t)).sum(axis=1)]
    slope = [(-scale * t * np.sin(kappa * t)).sum(axis=1), (scale * t * np.cos(kappa * t)).sum(axis=1)]
    return np.stack(place, axis=1), np.stack(slope, axis=1)


def chamber(time: float, start: float, pressure: float, target: float, tau: float) -> float:
    """Return the pressure [Pa] of a chamber that tends to a target with a time constant [s]."""
    return target if tau == 0.0 else target + (pressure - target) * math.exp(-(time - start) / tau)
