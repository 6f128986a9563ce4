"""The floor to beat: RKC2 with fixed steps for the scene `arc`, one compiled loop without any generality.

A strong rival, written for this one scene: no effects, no matrices, structure of arrays. A family is all springs of one
offset between node indices. One contiguous loop without branches or gather serves a family; a mask removes the pairs
that the offset wraps around an edge. Coefficients as in integrators/rkc2.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

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


class Families(NamedTuple):
    """The springs of the lattice by offset: family f joins node e to node e + offset[f], begin[f] <= e < end[f].

    Attributes:
        offset: Difference of node indices, shape (13,).
        begin: First near node, same shape.
        end: One after the last near node, same shape.
        mask: 1 where the pair is a spring, 0 where the offset wraps around an edge, shape (13, n_nodes).
        length: Rest length [m], shape (13,).
    """

    offset: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    mask: np.ndarray
    length: np.ndarray


def _families(n: int, m: int, spacing: tuple[float, float, float]) -> Families:
    layer = n * m
    i, j = np.divmod(np.arange(layer), m)
    cases = [(0, di, dj) for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1))]
    cases += [(1, di, dj) for di in (-1, 0, 1) for dj in (-1, 0, 1)]
    offset, mask, length = [], np.zeros((len(cases), 2 * layer)), []
    for case, (up, di, dj) in enumerate(cases):
        inside = (i + di >= 0) & (i + di < n) & (j + dj >= 0) & (j + dj < m)
        mask[case, :layer] = inside
        mask[case, layer:] = inside & (up == 0)
        offset.append(up * layer + di * m + dj)
        length.append(math.sqrt(sum((step * d) ** 2 for step, d in zip((di, dj, up), spacing, strict=True))))
    begin = [int(np.flatnonzero(row)[0]) for row in mask]
    end = [int(np.flatnonzero(row)[-1]) + 1 for row in mask]
    return Families(np.array(offset), np.array(begin), np.array(end), mask, np.array(length))


@fast
def _add_family(x, v, out, offset, begin, end, mask, length, k, c, pull):  # type: ignore[no-untyped-def]
    # Slices of one length, so that no index can be negative: the compiler then uses vector registers.
    ax, ay, az = x[0, begin:end], x[1, begin:end], x[2, begin:end]
    bx, by, bz = (
        x[0, begin + offset : end + offset],
        x[1, begin + offset : end + offset],
        x[2, begin + offset : end + offset],
    )
    avx, avy, avz = v[0, begin:end], v[1, begin:end], v[2, begin:end]
    bvx, bvy, bvz = (
        v[0, begin + offset : end + offset],
        v[1, begin + offset : end + offset],
        v[2, begin + offset : end + offset],
    )
    px, py, pz, used = pull[0], pull[1], pull[2], mask[begin:end]
    tension_at_zero = k * length
    for e in range(ax.size):
        dx, dy, dz = bx[e] - ax[e], by[e] - ay[e], bz[e] - az[e]
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        rate = dx * (bvx[e] - avx[e]) + dy * (bvy[e] - avy[e]) + dz * (bvz[e] - avz[e])
        tension = used[e] * (k - tension_at_zero * inverse + c * rate * inverse * inverse)
        px[e], py[e], pz[e] = tension * dx, tension * dy, tension * dz
    for axis in range(3):
        p, near, far = pull[axis], out[axis, begin:end], out[axis, begin + offset : end + offset]
        for e in range(near.size):
            near[e] += p[e]
        for e in range(far.size):
            far[e] -= p[e]


@fast
def _accelerate(x, v, families, k, c, steady, out, pull):  # type: ignore[no-untyped-def]
    # k, c and the steady load are those of a unit mass: all nodes have one mass.
    out[:] = steady
    for f in range(families.offset.size):
        _add_family(
            x,
            v,
            out,
            families.offset[f],
            families.begin[f],
            families.end[f],
            families.mask[f],
            families.length[f],
            k,
            c,
            pull,
        )


@fast
def _prescribe(time, rest, n, curvature, x, v):  # type: ignore[no-untyped-def]
    layer = rest.shape[1] // 2
    m = layer // n
    share = min(time, 1.0)
    kappa = curvature * share * share * (3.0 - 2.0 * share)
    kappa_rate = curvature * 6.0 * share * (1.0 - share)
    for i in range(n):
        s = rest[0, i * m]
        angle = s * kappa
        sine, cosine = math.sin(angle), math.cos(angle)
        if abs(angle) > 1e-4:
            px, pz = sine / kappa, (1.0 - cosine) / kappa
            sx, sz = (s * cosine - px) / kappa, (s * sine - pz) / kappa
        else:
            px, pz = s * (1.0 - angle * angle / 6.0), 0.5 * s * angle
            sx, sz = -s * s * angle / 3.0, 0.5 * s * s
        for level in range(2):
            first = level * layer + i * m
            height = rest[2, first]
            for e in (first, first + m - 1):
                x[0, e], v[0, e] = px - height * sine, kappa_rate * (sx - height * s * cosine)
                x[1, e], v[1, e] = rest[1, e], 0.0
                x[2, e], v[2, e] = pz + height * cosine, kappa_rate * (sz - height * s * sine)
    for level in range(2):
        for e in range(level * layer, level * layer + m):
            for axis in range(3):
                x[axis, e], v[axis, e] = rest[axis, e], 0.0


@fast
def _combine(a, b, d, g, start, near, far, push, push0):  # type: ignore[no-untyped-def]
    rest_share = 1.0 - a - b
    for e in range(far.size):
        far[e] = rest_share * start[e] + a * near[e] + b * far[e] + d * push[e] + g * push0[e]


@fast
def _run(  # type: ignore[no-untyped-def]
    state,
    rest,
    n,
    families,
    curvature,
    k,
    c,
    steady,
    h,
    first,
    count,
    s,
    mu,
    nu,
    mu_tilde,
    gamma_tilde,
    times,
):
    # state has shape (2, 3, n_nodes): positions and rates.
    pull = np.empty((3, rest.shape[1]))
    push0, push = np.empty_like(state), np.empty_like(state)
    near, far, start = state.copy(), state.copy(), state.copy()
    for step in range(first, first + count):
        time = step * h
        start[:] = state
        _prescribe(time, rest, n, curvature, start[0], start[1])
        push0[0] = start[1]
        _accelerate(start[0], start[1], families, k, c, steady, push0[1], pull)
        far[:] = start
        near[:] = start
        _combine(
            0.0,
            0.0,
            mu_tilde[1] * h,
            0.0,
            start.ravel(),
            start.ravel(),
            near.ravel(),
            push0.ravel(),
            push0.ravel(),
        )
        for j in range(2, s + 1):
            _prescribe(time + times[j - 1] * h, rest, n, curvature, near[0], near[1])
            push[0] = near[1]
            _accelerate(near[0], near[1], families, k, c, steady, push[1], pull)
            _combine(
                mu[j],
                nu[j],
                mu_tilde[j] * h,
                gamma_tilde[j] * h,
                start.ravel(),
                near.ravel(),
                far.ravel(),
                push.ravel(),
                push0.ravel(),
            )
            near, far = far, near
        state[:] = near
        _prescribe(time + h, rest, n, curvature, state[0], state[1])


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
        lattice, mass = scene.lattice, scene.lattice.node_mass[0]
        self._rest = np.ascontiguousarray(lattice.rest_position.T)
        self._per_interval = round(ERROR_TIMES[0] / h)
        self.h, self.stages = ERROR_TIMES[0] / self._per_interval, stages(1.02 * radius * h)
        known = coefficients(self.stages)
        self._constants = (
            self._rest,
            nodes,
            _families(nodes, nodes, (*lattice.spacing, lattice.size[2])),
            drive.curvature,
            springs.stiffness / mass,
            springs.damping / mass,
        )
        self._loaded, self._mass = lattice.node("top", nodes - 1, nodes // 2), mass
        self._load = force.value[2]
        self._weight = scene.effect("gravity").acceleration[2]
        self._scheme = (self.stages, known.mu, known.nu, known.mu_tilde, known.gamma_tilde, known.c)

    def _steady(self, push: float) -> np.ndarray:
        """Return the acceleration by weight and load [m/s^2], shape (3, n_nodes)."""
        steady = np.zeros_like(self._rest)
        steady[2] = self._weight
        steady[2, self._loaded] += (self._load + push) / self._mass
        return steady

    def step(self) -> None:
        """Take the first step, to see what one costs."""
        state = np.stack([self._rest, np.zeros_like(self._rest)])
        _run(state, *self._constants, self._steady(0.0), self.h, 0, 1, *self._scheme)

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
                steady = self._steady(push(done // held / rate))
                _run(state, *self._constants, steady, self.h, done, count, *self._scheme)
                done += count
            course.append(state[0].T.copy())
        return np.array(course)

    def run(self, times: tuple[float, ...]) -> np.ndarray:
        """Return node positions at multiples of 0.5 s [m], shape (n_times, n_nodes, 3)."""
        state = np.stack([self._rest, np.zeros_like(self._rest)])
        course, done = [], 0
        for time in times:
            whole = round(time / ERROR_TIMES[0]) * self._per_interval
            _run(state, *self._constants, self._steady(0.0), self.h, done, whole - done, *self._scheme)
            done = whole
            course.append(state[0].T.copy())
        return np.array(course)
