"""A compiled baseline: RKC2 with fixed steps for the scene `arc`, one loop without any generality.

The baseline is written for this one scene: no effects, no matrices, structure of arrays. A family is all springs of one
offset between node indices. One contiguous loop without branches or gather serves a family; a mask removes the pairs
that the offset wraps around an edge. Coefficients as in integrators/rkc2.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, TypeVar, cast

import numpy as np

from ldcs_ros.integrators.rkc2 import Coefficients, coefficients, stages
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene import load_scene
from ldcs_ros.study.problems import ERROR_TIMES, content_of
from ldcs_ros.study.rows import Row

Function = TypeVar("Function")


def fast(function: Function) -> Function:
    """Compile a function with all floating-point shortcuts; without numba return it as it is, far too slow."""
    if not HAVE_NUMBA:
        return function
    import numba

    return cast(Function, numba.njit(cache=True, fastmath=True, error_model="numpy")(function))


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
    near, far = slice(begin, end), slice(begin + offset, end + offset)
    ax, ay, az, bx, by, bz = x[0, near], x[1, near], x[2, near], x[0, far], x[1, far], x[2, far]
    avx, avy, avz, bvx, bvy, bvz = v[0, near], v[1, near], v[2, near], v[0, far], v[1, far], v[2, far]
    px, py, pz, used = pull[0], pull[1], pull[2], mask[begin:end]
    tension_at_zero = k * length
    for e in range(ax.size):
        dx, dy, dz = bx[e] - ax[e], by[e] - ay[e], bz[e] - az[e]
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        rate = dx * (bvx[e] - avx[e]) + dy * (bvy[e] - avy[e]) + dz * (bvz[e] - avz[e])
        tension = used[e] * (k - tension_at_zero * inverse + c * rate * inverse * inverse)
        px[e], py[e], pz[e] = tension * dx, tension * dy, tension * dz
    for axis in range(3):
        p, first, second = pull[axis], out[axis, near], out[axis, far]
        for e in range(first.size):
            first[e] += p[e]
        for e in range(second.size):
            second[e] -= p[e]


@fast
def _accelerate(x, v, families, k, c, steady, out, pull):  # type: ignore[no-untyped-def]
    # k, c and the steady load are those of a unit mass: all nodes have one mass.
    out[:] = steady
    f = families
    for i in range(f.offset.size):
        _add_family(x, v, out, f.offset[i], f.begin[i], f.end[i], f.mask[i], f.length[i], k, c, pull)


@fast
def _prescribe(time, rest, n, curvature, x, v):  # type: ignore[no-untyped-def]
    layer = rest.shape[1] // 2
    m = layer // n
    rise = min(time, 1.0)
    kappa = curvature * rise * rise * (3.0 - 2.0 * rise)
    kappa_rate = curvature * 6.0 * rise * (1.0 - rise)
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
    rest = 1.0 - a - b
    for e in range(far.size):
        far[e] = rest * start[e] + a * near[e] + b * far[e] + d * push[e] + g * push0[e]


@fast
def _run(state, sheet, steady, h, first, count, s, scheme):  # type: ignore[no-untyped-def]
    # state has shape (2, 3, n_nodes): positions and rates.
    rest, n, families, curvature, k, c = sheet
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
        flat, flat0 = start.ravel(), push0.ravel()
        _combine(0.0, 0.0, scheme.mu_tilde[1] * h, 0.0, flat, flat, near.ravel(), flat0, flat0)
        for j in range(2, s + 1):
            _prescribe(time + scheme.c[j - 1] * h, rest, n, curvature, near[0], near[1])
            push[0] = near[1]
            _accelerate(near[0], near[1], families, k, c, steady, push[1], pull)
            mu_tilde, gamma_tilde = scheme.mu_tilde[j] * h, scheme.gamma_tilde[j] * h
            _combine(
                scheme.mu[j], scheme.nu[j], mu_tilde, gamma_tilde,
                flat, near.ravel(), far.ravel(), push.ravel(), flat0,
            )  # fmt: skip
            near, far = far, near
        state[:] = near
        _prescribe(time + h, rest, n, curvature, state[0], state[1])


class ArcBaseline:
    """The scene `arc` with n x n nodes, ready to run.

    Args:
        nodes: Nodes along a side.
        h: Fixed step [s]; a whole number of them makes 0.5 s.
        radius: Spectral radius of the linearised system [1/s], which decides the number of stages.

    Attributes:
        h: The step [s].
        stages: Force evaluations of a step.
    """

    def __init__(self, nodes: int, h: float, radius: float) -> None:
        scene = load_scene(content_of("arc", nodes))
        springs, force, drive = scene.effect("springs"), scene.effect("force"), scene.effect("driven_edges")
        lattice, mass = scene.lattice, scene.lattice.node_mass[0]
        self._rest = np.ascontiguousarray(lattice.reference_position.T)
        self._per_interval = round(ERROR_TIMES[0] / h)
        self.h, self.stages = ERROR_TIMES[0] / self._per_interval, stages(1.02 * radius * h)
        self._scheme: Coefficients = coefficients(self.stages)
        families = _families(nodes, nodes, (*lattice.spacing, lattice.size[2]))
        self._sheet = (
            self._rest, nodes, families, drive.curvature, springs.stiffness / mass, springs.damping / mass,
        )  # fmt: skip
        self._loaded, self._mass = lattice.node("top", nodes - 1, nodes // 2), mass
        self._load, self._weight = force.value[2], scene.effect("gravity").acceleration[2]

    def counted(self, row: Row, duration: float) -> Row:
        """Return a row with the steps and evaluations of a duration [s]."""
        steps = round(duration / self.h)
        return replace(row, steps=steps, evaluations=steps * self.stages)

    def step(self) -> None:
        """Take the first step, for its cost."""
        self._advance(self._start(), 0, 1, push=0.0)

    def run(self, times: tuple[float, ...]) -> np.ndarray:
        """Return node positions at multiples of 0.5 s [m], shape (n_times, n_nodes, 3)."""
        return self.run_pushed(times, 1.0 / ERROR_TIMES[0], lambda time: 0.0)

    def run_pushed(self, times: tuple[float, ...], rate: float, push: Callable[[float], float]) -> np.ndarray:
        """Return node positions at times [m], shape (n_times, n_nodes, 3), with a further load that is set at a rate.

        Args:
            times: Times [s], after whole steps.
            rate: Rate at which `push` is called [Hz]; a command lasts whole steps.
            push: Further vertical force on the loaded node at a time [s, N].
        """
        state, found, done, held = self._start(), [], 0, round(1.0 / (rate * self.h))
        for time in times:
            while done < round(time / self.h):
                count = min(held - done % held, round(time / self.h) - done)
                self._advance(state, done, count, push=push(done // held / rate))
                done += count
            found.append(state[0].T.copy())
        return np.array(found)

    def _start(self) -> np.ndarray:
        return np.stack([self._rest, np.zeros_like(self._rest)])

    def _advance(self, state: np.ndarray, first: int, count: int, *, push: float) -> None:
        # The acceleration by weight and load [m/s^2], shape (3, n_nodes).
        steady = np.zeros_like(self._rest)
        steady[2] = self._weight
        steady[2, self._loaded] += (self._load + push) / self._mass
        _run(state, self._sheet, steady, self.h, first, count, self.stages, self._scheme)
