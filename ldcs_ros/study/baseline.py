"""The floor to beat: RKC2 with fixed steps for the scene `arc`, one compiled loop without any generality.

This is what a good programmer writes in an afternoon for this one scene: no effects, no matrices, a stencil over
rows of the lattice that the compiler turns into vector instructions. Coefficients as in integrators/rkc2.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ldcs_ros.integrators.rkc2 import coefficients, stages
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.study.problems import ERROR_TIMES, content_of

if HAVE_NUMBA:
    import numba

    fast = numba.njit(cache=True, fastmath=True, error_model="numpy")
else:

    def fast(function: Any) -> Any:
        """Leave the loops to Python: as right, far too slow to compare with."""
        return function


@fast
def _add_family(x, v, force, la, lb, di, dj, length, k, c, pull):  # type: ignore[no-untyped-def]
    # Springs from (la, i, j) to (lb, i + di, j + dj); `pull` keeps the two sums apart, so that both vectorise.
    n, m = x.shape[2], x.shape[3]
    low, high = max(0, -dj), m - max(0, dj)
    for i in range(n - di):
        for j in range(low, high):
            dx = x[0, lb, i + di, j + dj] - x[0, la, i, j]
            dy = x[1, lb, i + di, j + dj] - x[1, la, i, j]
            dz = x[2, lb, i + di, j + dj] - x[2, la, i, j]
            inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
            rate = dx * (v[0, lb, i + di, j + dj] - v[0, la, i, j])
            rate += dy * (v[1, lb, i + di, j + dj] - v[1, la, i, j])
            rate += dz * (v[2, lb, i + di, j + dj] - v[2, la, i, j])
            tension = k * (1.0 - length * inverse) + c * rate * inverse * inverse
            pull[0, j], pull[1, j], pull[2, j] = tension * dx, tension * dy, tension * dz
        for axis in range(3):
            for j in range(low, high):
                force[axis, la, i, j] += pull[axis, j]
            for j in range(low, high):
                force[axis, lb, i + di, j + dj] -= pull[axis, j]


@fast
def _accelerate(x, v, rest, mass, k, c, load, out, pull):  # type: ignore[no-untyped-def]
    n, m = x.shape[2], x.shape[3]
    out[:] = 0.0
    dx, dy, dz = (
        rest[0, 0, 1, 0] - rest[0, 0, 0, 0],
        rest[1, 0, 0, 1] - rest[1, 0, 0, 0],
        rest[2, 1, 0, 0] - rest[2, 0, 0, 0],
    )
    for case in range(4):
        di, dj = ((1, 0), (0, 1), (1, 1), (1, -1))[case]
        flat = math.sqrt((di * dx) ** 2 + (dj * dy) ** 2)
        across = math.sqrt(flat * flat + dz * dz)
        _add_family(x, v, out, 0, 0, di, dj, flat, k, c, pull)
        _add_family(x, v, out, 1, 1, di, dj, flat, k, c, pull)
        _add_family(x, v, out, 0, 1, di, dj, across, k, c, pull)
        _add_family(x, v, out, 1, 0, di, dj, across, k, c, pull)
    _add_family(x, v, out, 0, 1, 0, 0, dz, k, c, pull)
    out[2, 1, n - 1, m // 2] += load
    for axis in range(3):
        for layer in range(2):
            for i in range(n):
                for j in range(m):
                    out[axis, layer, i, j] *= 1.0 / mass
    out[2] -= 9.81


@fast
def _prescribe(time, rest, curvature, x, v):  # type: ignore[no-untyped-def]
    n, m = x.shape[2], x.shape[3]
    share = min(time, 1.0)
    kappa, kappa_rate = (
        curvature * share * share * (3.0 - 2.0 * share),
        curvature * 6.0 * share * (1.0 - share),
    )
    for layer in range(2):
        for i in range(n):
            s, height = rest[0, 0, i, 0], rest[2, layer, 0, 0]
            angle = s * kappa
            sine, cosine = math.sin(angle), math.cos(angle)
            if abs(angle) > 1e-4:
                px, pz = sine / kappa, (1.0 - cosine) / kappa
                sx, sz = (s * cosine - px) / kappa, (s * sine - pz) / kappa
            else:
                px, pz = s * (1.0 - angle * angle / 6.0), 0.5 * s * angle
                sx, sz = -s * s * angle / 3.0, 0.5 * s * s
            for j in (0, m - 1):
                x[0, layer, i, j], v[0, layer, i, j] = (
                    px - height * sine,
                    kappa_rate * (sx - height * s * cosine),
                )
                x[1, layer, i, j], v[1, layer, i, j] = rest[1, layer, i, j], 0.0
                x[2, layer, i, j], v[2, layer, i, j] = (
                    pz + height * cosine,
                    kappa_rate * (sz - height * s * sine),
                )
        for j in range(m):
            for axis in range(3):
                x[axis, layer, 0, j], v[axis, layer, 0, j] = rest[axis, layer, 0, j], 0.0


@fast
def _run(state, rest, curvature, mass, k, c, load, h, first, count, s, mu, nu, mu_tilde, gamma_tilde, times):  # type: ignore[no-untyped-def]
    # state has shape (2, 3, 2, n, m): positions and rates.
    pull = np.empty((3, rest.shape[3]))
    push0, push = np.empty_like(state), np.empty_like(state)
    near, far, start = state.copy(), state.copy(), state.copy()
    for step in range(first, first + count):
        time = step * h
        start[:] = state
        _prescribe(time, rest, curvature, start[0], start[1])
        push0[0] = start[1]
        _accelerate(start[0], start[1], rest, mass, k, c, load, push0[1], pull)
        far[:] = start
        flat_near, flat_far, flat_push = near.ravel(), far.ravel(), push.ravel()
        flat_start, flat_push0 = start.ravel(), push0.ravel()
        for e in range(flat_near.size):
            flat_near[e] = flat_start[e] + mu_tilde[1] * h * flat_push0[e]
        for j in range(2, s + 1):
            _prescribe(time + times[j - 1] * h, rest, curvature, near[0], near[1])
            push[0] = near[1]
            _accelerate(near[0], near[1], rest, mass, k, c, load, push[1], pull)
            a, b, d, g = mu[j], nu[j], mu_tilde[j] * h, gamma_tilde[j] * h
            rest_share = 1.0 - a - b
            flat_near, flat_far = near.ravel(), far.ravel()
            for e in range(flat_near.size):
                flat_far[e] = (
                    rest_share * flat_start[e]
                    + a * flat_near[e]
                    + b * flat_far[e]
                    + d * flat_push[e]
                    + g * flat_push0[e]
                )
            near, far = far, near
        state[:] = near
        _prescribe(time + h, rest, curvature, state[0], state[1])


class ArcBaseline:
    """The scene `arc` with n x n nodes, ready to run.

    Args:
        nodes: Nodes along a side.
        h: Fixed step [s]; a whole number of them makes 0.5 s.
        radius: Spectral radius of the linearised system [1/s], which decides the number of stages.
    """

    def __init__(self, nodes: int, h: float, radius: float) -> None:
        from ldcs_ros.scene import load_scene

        scene = load_scene(content_of("arc", nodes))
        springs, force, drive = scene.effect("springs"), scene.effect("force"), scene.effect("driven_edges")
        self._shape = (2, nodes, nodes)
        self._rest = np.ascontiguousarray(scene.lattice.rest_position.T.reshape(3, *self._shape))
        self._per_interval = round(ERROR_TIMES[0] / h)
        self.h, self.stages = ERROR_TIMES[0] / self._per_interval, stages(1.02 * radius * h)
        known = coefficients(self.stages)
        self._constants = (
            self._rest,
            drive.curvature,
            scene.lattice.node_mass[0],
            springs.stiffness,
            springs.damping,
        )
        self._load = force.value[2]
        self._scheme = (self.stages, known.mu, known.nu, known.mu_tilde, known.gamma_tilde, known.c)

    def step(self) -> None:
        """Take the first step, to see what one costs."""
        state = np.stack([self._rest, np.zeros_like(self._rest)])
        _run(state, *self._constants, self._load, self.h, 0, 1, *self._scheme)

    def run_pushed(self, times: tuple[float, ...], rate: float, push: Callable[[float], float]) -> np.ndarray:
        """Return node positions at times [m] with a further load that is set anew at a rate.

        Args:
            times: When [s], after whole steps.
            rate: How often `push` is asked [Hz]; a command lasts whole steps.
            push: Further vertical force on the loaded node at a time [s, N].
        """
        state = np.stack([self._rest, np.zeros_like(self._rest)])
        course, done, held = [], 0, round(1.0 / (rate * self.h))
        for time in times:
            while done < round(time / self.h):
                count = min(held - done % held, round(time / self.h) - done)
                load = self._load + push(done // held / rate)
                _run(state, *self._constants, load, self.h, done, count, *self._scheme)
                done += count
            course.append(state[0].reshape(3, -1).T.copy())
        return np.array(course)

    def run(self, times: tuple[float, ...]) -> np.ndarray:
        """Return node positions at multiples of 0.5 s [m], shape (n_times, n_nodes, 3)."""
        state = np.stack([self._rest, np.zeros_like(self._rest)])
        course, done = [], 0
        for time in times:
            whole = round(time / ERROR_TIMES[0]) * self._per_interval
            _run(state, *self._constants, self._load, self.h, done, whole - done, *self._scheme)
            done = whole
            course.append(state[0].reshape(3, -1).T.copy())
        return np.array(course)
