"""Small displacements of strips and plates against closed formulas and finite elements."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ldcs_ros.validate import finite_elements as fe
from ldcs_ros.validate import linear_sheets as sheets
from ldcs_ros.validate import problems as p
from ldcs_ros.validate.benchmark import Benchmark
from ldcs_ros.validate.linear_sheets import Content, LinearSheet, sheet_content

MESHES = (9, 17, 33, 65)
"""Nodes along a side."""
PLATE_STIFFNESS = p.YOUNGS_MODULUS * p.THICKNESS**3 / (12.0 * (1.0 - p.POISSON**2))
# Centre deflection of a simply supported square plate under a point load, w D / (F a^2) (Timoshenko and
# Woinowsky-Krieger, Theory of Plates and Shells, table 23).
SUPPORTED_PLATE = 0.01160
SHEAR_MODULUS = p.YOUNGS_MODULUS / (2.0 * (1.0 + p.POISSON))
_TIP = {"x": p.LENGTH, "y": 0.0}
_CLAMP = {"type": "clamp"}
Case = tuple[str, float, str, Callable[[int], Content], Callable[[LinearSheet], float]]
"""Name, reference, names of its limits, scene by number of nodes, measure."""


def small_displacements(meshes: tuple[int, ...] = MESHES) -> Iterator[Benchmark]:
    """Yield each comparison as soon as it is made.

    Args:
        meshes: Nodes along the side, rising; at least three.
    """
    for name, reference, limit, content, measure in _cases():
        values = {nodes: measure(LinearSheet(content(nodes))) for nodes in meshes}
        yield Benchmark(name, reference, values, limit)


def _cases() -> list[Case]:
    elements = p.DENSITY / p.YOUNGS_MODULUS
    supported = SUPPORTED_PLATE * p.SIDE**2 / PLATE_STIFFNESS
    hole = "pulled strip with a hole: "
    holed: list[Case] = []
    measures = (sheets.stress_concentration, sheets.strain_beside_hole, sheets.hole_elongation)
    words = (
        "stress concentration",
        "strain beside the hole",
        "elongation of the hole",
    )
    for k, (measure, quantity) in enumerate(zip(measures, words, strict=True)):
        holed += [
            (hole + quantity, fe.HOLED[k], "shear, cut cells", _holed, measure),
            ("the same, shear of the lattice", fe.HOLED_OF_LATTICE_SHEAR[k], "cut cells", _holed, measure),
        ]
    return [
        ("cantilever plate, weight: sag [m]", elements * fe.STRIP_SAG, "", _strip, sheets.sag),
        ("thinner to its tip, in steps [m]", elements * fe.TAPERED_THICKNESS_SAG, "", _stepped, sheets.sag),
        ("narrower to its tip [m]", elements * fe.TAPERED_WIDTH_SAG, "cut cells", _narrowed, sheets.sag),
        ("simply supported plate, 1 N: deflection [m]", supported, "", _square, sheets.simply_supported),
        *holed,
        ("pulled square with a stiff one inside: strain", fe.INCLUSION, "shear", _included, sheets.extension),
        ("in-plane shear modulus [Pa]", SHEAR_MODULUS, "shear", _square, sheets.shear_modulus),
        (
            "springs without material: bending stiffness",
            1.0,
            "two layers",
            _springs,
            sheets.bending_over_stretching,
        ),
    ]


def _strip(nodes: int, **lattice: object) -> Content:
    across = max((nodes - 1) // 4 + 1, 2)
    return sheet_content((p.LENGTH, p.WIDTH), (nodes, across), _TIP, _CLAMP, **lattice)


def _stepped(nodes: int) -> Content:
    step = p.LENGTH / p.TAPER_STEPS
    regions = [
        {
            "box": [k * step, -p.WIDTH, (k + 1) * step, p.WIDTH],
            "thickness": float(p.stepped_thickness(np.array((k + 0.5) * step))) / p.THICKNESS,
        }
        for k in range(p.TAPER_STEPS)
    ]
    return _strip(nodes, regions=regions)


def _wide(nodes: int, *effects: Content, holes: list[Content]) -> Content:
    size, count = (p.LENGTH, p.HOLED_WIDTH), (nodes, (nodes - 1) // 2 + 1)
    return sheet_content(size, count, _TIP, *effects, holes=holes)


def _narrowed(nodes: int) -> Content:
    half = 0.5 * p.HOLED_WIDTH
    beside = [
        {"polygon": [[0.0, side * half], [p.LENGTH, side * p.TAPER * half], [p.LENGTH, side * half]]}
        for side in (1.0, -1.0)
    ]
    return _wide(nodes, _CLAMP, holes=list(beside))


def _holed(nodes: int) -> Content:
    return _wide(nodes, holes=[{"circle": [0.5 * p.LENGTH, 0.0, p.HOLE_RADIUS]}])


def _square(nodes: int, **lattice: object) -> Content:
    return sheet_content((p.SIDE, p.SIDE), (nodes, nodes), {"x": 0.5 * p.SIDE, "y": 0.0}, **lattice)


def _included(nodes: int) -> Content:
    low, half = 0.5 * (p.SIDE - p.INCLUSION_SIDE), 0.5 * p.INCLUSION_SIDE
    box = [low, -half, low + p.INCLUSION_SIDE, half]
    return _square(nodes, regions=[{"box": box, "stiffness": p.INCLUSION_FACTOR}])


def _springs(nodes: int) -> Content:
    return {
        "lattice": {"size": [p.SIDE, p.SIDE, 0.010], "nodes": [nodes, nodes], "mass": 0.160},
        "effects": [{"type": "springs", "stiffness": 80.0}],
    }
