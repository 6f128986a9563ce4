"""The `material` against classical answers: strips and plates with known deflections, lengths and frequencies.

The references are closed formulas or a boundary value problem of SciPy; they share no code with the lattice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ldcs_ros.scene.load import load_scene
from ldcs_ros.simulation.simulation import Simulation

YOUNGS_MODULUS, POISSON, DENSITY = 150e3, 1.0 / 3.0, 1070.0
THICKNESS = 0.006
LENGTH, WIDTH = 0.200, 0.050  # of the strip [m]
SIDE = 0.140  # of the plate [m]
ELASTICA_LOADS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Tip loads of the cantilever, as F L^2 / (E I)."""
MESHES = (9, 17, 33)
"""Nodes along a side."""
INERTIA = WIDTH * THICKNESS**3 / 12.0
PLATE_STIFFNESS = YOUNGS_MODULUS * THICKNESS**3 / (12.0 * (1.0 - POISSON**2))
# First root of 1 + cos x cosh x = 0 (clamped and free beam).
FIRST_ROOT = 1.8751040687119611
# Centre deflection of a clamped square plate under a point load, w D / (F a^2) (Timoshenko and Woinowsky-Krieger,
# Theory of Plates and Shells, table 37).
CLAMPED_PLATE = 0.00560


Content = Mapping[str, object]


@dataclass(frozen=True)
class Benchmark:
    """A quantity of the lattice on several meshes, beside its reference.

    Attributes:
        name: What is compared.
        reference: Reference value, SI.
        values: Values of the lattice, SI, by number of nodes along the side.
        limit: Known difference of the models, in words; '' where they should agree.
    """

    name: str
    reference: float
    values: dict[int, float]
    limit: str

    @property
    def errors(self) -> dict[int, float]:
        """Relative errors by number of nodes."""
        return {nodes: value / self.reference - 1.0 for nodes, value in self.values.items()}

    @property
    def order(self) -> float:
        """Order of convergence towards the lattice's own limit, from the last three meshes; NaN without one."""
        *_, a, b, c = self.values.values()
        ratio = (a - b) / (b - c) if b != c else math.nan
        return math.log2(ratio) if ratio > 0.0 else math.nan


def benchmarks(meshes: tuple[int, ...] = MESHES) -> Iterator[Benchmark]:
    """Yield each comparison as soon as it is made.

    Args:
        meshes: Nodes along the side, rising; at least three.
    """
    clamp = (
        "the clamp holds back the lateral contraction, which a beam's theory leaves free, "
        "and central springs are 1.3 times too stiff in plane shear at this Poisson's ratio"
    )
    for load in ELASTICA_LOADS:
        force = load * YOUNGS_MODULUS * INERTIA / LENGTH**2
        tip = {"type": "force", "at": {"x": LENGTH, "y": 0.0}, "value": [0.0, 0.0, force]}
        height = elastica(load)[1] * LENGTH
        yield _measured(
            f"cantilever, tip load {load:g} E I / L^2: height of the tip",
            height,
            clamp,
            meshes,
            _strip(tip),
            _height,
        )
    weight = DENSITY * WIDTH * THICKNESS * 0.05
    sag = -weight * LENGTH**4 / (8.0 * YOUNGS_MODULUS * INERTIA)
    light = {"type": "gravity", "acceleration": [0.0, 0.0, -0.05]}
    yield _measured(
        "cantilever under its weight (g / 200): sag of the tip", sag, clamp, meshes, _strip(light), _height
    )
    stretch = DENSITY * 1.0 * LENGTH**2 / (2.0 * YOUNGS_MODULUS)
    along = {"type": "gravity", "acceleration": [1.0, 0.0, 0.0]}
    yield _measured(
        "strip hanging by its end (g / 10): extension",
        stretch,
        clamp,
        meshes,
        _strip(along),
        lambda simulation: simulation.pose("P1")[0][0] - LENGTH,
    )
    bar = math.sqrt(YOUNGS_MODULUS * INERTIA / (DENSITY * WIDTH * THICKNESS * LENGTH**4))
    frequency = FIRST_ROOT**2 / (2.0 * math.pi) * bar
    yield _measured("cantilever: lowest natural frequency", frequency, clamp, meshes, _strip(), _frequency)
    load = 1e-3
    deflection = CLAMPED_PLATE * load * SIDE**2 / PLATE_STIFFNESS
    yield _measured(
        "clamped square plate, point load: deflection", deflection, "", meshes, _plate(load), _height
    )


def elastica(load: float) -> tuple[float, float]:
    """Return x and z of the tip of an inextensible cantilever under a vertical dead load, in lengths.

    theta'' = -load cos(theta), theta(0) = 0, theta'(1) = 0, with load = F L^2 / (E I).
    """
    from scipy.integrate import solve_bvp

    s = np.linspace(0.0, 1.0, 101)
    guess = np.array([min(load / 3.0, 1.2) * np.sin(0.5 * np.pi * s), np.cos(0.5 * np.pi * s)])
    solution = solve_bvp(
        lambda _, y: np.array([y[1], -load * np.cos(y[0])]),
        lambda start, end: np.array([start[0], end[1]]),
        s,
        guess,
        tol=1e-9,
    )
    fine = np.linspace(0.0, 1.0, 2001)
    angle = solution.sol(fine)[0]
    weight = np.full(2001, 1.0 / 2000.0)
    weight[[0, -1]] *= 0.5
    return float(weight @ np.cos(angle)), float(weight @ np.sin(angle))


def _strip(*effects: Content) -> Callable[[int], Content]:
    def content(nodes: int) -> Content:
        across = max((nodes - 1) // 4 + 1, 2)
        return _content(
            (LENGTH, WIDTH), (nodes, across), {"x": LENGTH, "y": 0.0}, {"type": "clamp"}, *effects
        )

    return content


def _plate(load: float) -> Callable[[int], Content]:
    def content(nodes: int) -> Content:
        clamps = ({"type": "clamp", "edge": edge} for edge in ("x_min", "x_max", "y_min", "y_max"))
        push = {"type": "force", "at": "P1", "value": [0.0, 0.0, load]}
        return _content((SIDE, SIDE), (nodes, nodes), {"x": 0.5 * SIDE, "y": 0.0}, *clamps, push)

    return content


def _content(
    size: tuple[float, float], nodes: tuple[int, int], point: dict[str, float], *effects: Content
) -> Content:
    return {
        "lattice": {"size": [*size, THICKNESS], "nodes": list(nodes)},
        "material": {"youngs_modulus": YOUNGS_MODULUS, "poisson": POISSON, "density": DENSITY},
        "points": {"P1": point},
        "effects": [{"type": "springs"}, *effects],
    }


def _measured(
    name: str,
    reference: float,
    limit: str,
    meshes: tuple[int, ...],
    content: Callable[[int], Content],
    measure: Callable[[Simulation], float],
) -> Benchmark:
    values = {}
    for nodes in meshes:
        simulation = load_scene(dict(content(nodes))).build()
        simulation.settle()
        values[nodes] = float(measure(simulation))
    return Benchmark(name, reference, values, limit)


def _height(simulation: Simulation) -> float:
    return float(simulation.pose("P1")[0][2])


def _frequency(simulation: Simulation) -> float:
    return float(simulation.linearize(modes=1).frequencies[0])
