"""The `material` against classical answers: strips and plates with known deflections, lengths and frequencies.

The references are closed formulas or a boundary value problem of SciPy; they share no code with the lattice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from ldcs_ros.scene.load import load_scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.validate import finite_elements as fe
from ldcs_ros.validate.benchmark import Benchmark
from ldcs_ros.validate.linear_sheets import Content, sheet_content
from ldcs_ros.validate.problems import DENSITY, LENGTH, POISSON, SIDE, THICKNESS, WIDTH, YOUNGS_MODULUS

ELASTICA_LOADS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Tip loads of the cantilever, as F L^2 / (E I)."""
MESHES = (9, 17, 33)
"""Nodes along a side."""
INERTIA = WIDTH * THICKNESS**3 / 12.0
SHEAR_MODULUS = YOUNGS_MODULUS / (2.0 * (1.0 + POISSON))
# Saint-Venant's torsion constant of a thin rectangle.
TORSION = WIDTH * THICKNESS**3 / 3.0 * (1.0 - 0.63 * THICKNESS / WIDTH)
PLATE_STIFFNESS = YOUNGS_MODULUS * THICKNESS**3 / (12.0 * (1.0 - POISSON**2))
# First root of 1 + cos x cosh x = 0 (clamped and free beam).
FIRST_ROOT, SECOND_ROOT = 1.8751040687119611, 4.694091132974174
# Centre deflection of a clamped square plate under a point load, w D / (F a^2) (Timoshenko and Woinowsky-Krieger,
# Theory of Plates and Shells, table 37).
CLAMPED_PLATE = 0.00560
# Load at the tip of a deep cantilever at which it leaves its plane, P L^2 / sqrt(E I G J) (Timoshenko, Theory
# of Elastic Stability, section 6.3).
LATERAL = 4.013


def benchmarks(meshes: tuple[int, ...] = MESHES) -> Iterator[Benchmark]:
    """Yield each comparison as soon as it is made.

    Args:
        meshes: Nodes along the side, rising; at least three.
    """
    clamp = "beam"
    for load in ELASTICA_LOADS:
        force = load * YOUNGS_MODULUS * INERTIA / LENGTH**2
        tip = {"type": "force", "at": {"x": LENGTH, "y": 0.0}, "value": [0.0, 0.0, force]}
        height = elastica(load)[1] * LENGTH
        yield _measured(
            f"cantilever, tip load {load:g} E I / L^2: height of the tip [m]",
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
        "cantilever under its weight (g / 200): sag of the tip [m]",
        sag,
        clamp,
        meshes,
        _strip(light),
        _height,
    )
    stretch = DENSITY * 1.0 * LENGTH**2 / (2.0 * YOUNGS_MODULUS)
    along = {"type": "gravity", "acceleration": [1.0, 0.0, 0.0]}
    yield _measured(
        "strip hanging by its end (g / 10): extension [m]",
        stretch,
        clamp,
        meshes,
        _strip(along),
        lambda simulation: simulation.pose("P1")[0][0] - LENGTH,
    )
    load = 1e-3
    deflection = CLAMPED_PLATE * load * SIDE**2 / PLATE_STIFFNESS
    yield _measured(
        "clamped square plate, point load: deflection [m]", deflection, "", meshes, _plate(load), _height
    )
    yield from _frequencies(meshes)
    beam = LATERAL * math.sqrt(YOUNGS_MODULUS * INERTIA * SHEAR_MODULUS * TORSION) / LENGTH**2
    values = {nodes: _lateral_buckling(nodes, beam) for nodes in meshes}
    yield Benchmark("deep cantilever, tip load: lateral buckling [N]", beam, values, "beam, torsion")
    yield Benchmark("the same, plate", YOUNGS_MODULUS * fe.LATERAL_LOAD, values, "flat, torsion")


def _frequencies(meshes: tuple[int, ...]) -> Iterator[Benchmark]:
    values: tuple[dict[int, float], ...] = ({}, {}, {})
    for nodes in meshes:
        simulation = load_scene(dict(_strip()(nodes))).build()
        simulation.settle()
        for known, value in zip(values, simulation.linearize(modes=3).frequencies[:3], strict=True):
            known[nodes] = float(value)
    bar = math.sqrt(YOUNGS_MODULUS * INERTIA / (DENSITY * WIDTH * THICKNESS * LENGTH**4))
    polar = DENSITY * WIDTH * THICKNESS * (WIDTH**2 + THICKNESS**2) / 12.0
    beams = (
        FIRST_ROOT**2 / (2.0 * math.pi) * bar,
        SECOND_ROOT**2 / (2.0 * math.pi) * bar,
        math.sqrt(SHEAR_MODULUS * TORSION / polar) / (4.0 * LENGTH),
    )
    speed = math.sqrt(YOUNGS_MODULUS / DENSITY)
    rows = (("first bending", "beam"), ("second bending", "beam"), ("torsion", "beam, torsion"))
    for k, (name, limit) in enumerate(rows):
        yield Benchmark(f"cantilever: frequency of {name} [Hz]", beams[k], values[k], limit)
        plate = limit.removeprefix("beam").removeprefix(", ")
        yield Benchmark("the same, plate", speed * fe.STRIP_FREQUENCIES[k], values[k], plate)


def _lateral_buckling(nodes: int, guess: float) -> float:
    """Return the load at which the lowest eigenvalue of the strip, loaded in its plane, is zero [N]."""
    loads, values = [], []
    for fraction in (0.0, 0.8, 0.95):
        pull = {"type": "force", "at": {"x": LENGTH, "y": 0.0}, "value": [0.0, fraction * guess, 0.0]}
        values.append(load_scene(dict(_strip(pull)(nodes))).build().settle().eigenvalue)
        loads.append(fraction * guess)
    # The eigenvalue falls nearly with the square of the load.
    curve = np.polyfit(np.square(loads), values, 2)
    roots = np.roots(curve)
    real = roots[np.abs(roots.imag) < 1e-9].real
    return math.sqrt(min(real[real > 0.0]))


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
        return sheet_content(
            (LENGTH, WIDTH), (nodes, across), {"x": LENGTH, "y": 0.0}, {"type": "clamp"}, *effects
        )

    return content


def _plate(load: float) -> Callable[[int], Content]:
    def content(nodes: int) -> Content:
        clamps = ({"type": "clamp", "edge": edge} for edge in ("x_min", "x_max", "y_min", "y_max"))
        push = {"type": "force", "at": "P1", "value": [0.0, 0.0, load]}
        return sheet_content((SIDE, SIDE), (nodes, nodes), {"x": 0.5 * SIDE, "y": 0.0}, *clamps, push)

    return content


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
