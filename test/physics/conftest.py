"""Small models in general positions, for sentences about forces, energies and Jacobians."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics.effects import effect_class
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.model import Model
from ldcs_ros.physics.placed_arms import PlacedArm
from ldcs_ros.physics.points import point_at
from ldcs_ros.schema.fields import SheetPlace

# One way to build every effect of the table that has a force, with parameters that make all its parts act.
CASES = {
    "springs axial": ("springs", {"law": "axial"}),
    "springs axiswise": ("springs", {"law": "axiswise"}),
    "springs corotational": ("springs", {"law": "corotational"}),
    "gravity": ("gravity", {}),
    "force": ("force", {"at": "P1", "value": (0.1, -0.2, 0.3)}),
    "payload": ("payload", {"at": "P1", "mass": 0.04}),
    "wrench": ("wrench", {}),
    "arms torque": ("arms", {"width": 1}),
    "arms pressure, bisector": ("arms", {"drive": "pressure", "crosspiece": "bisector", "links": 3}),
    "arms raised, stiff base": ("arms", {"width": 1, "rigid_base": 0.01, "backbone_height": 0.004}),
    "arms in any direction": (
        "arms",
        {
            "arms": (
                PlacedArm("slanted", (0.02, -0.05), (0.13, 0.06), {"width": 1, "joint_damping": 0.05}),
                PlacedArm("across", (0.105, -0.07), (0.105, 0.05), {"links": 2, "link_mass": 0.02}),
                PlacedArm(
                    "backwards", (0.14, 0.01), (0.03, 0.01), {"rigid_base": 0.005, "crosspiece": "bisector"}
                ),
            )
        },
    ),
    "force between nodes": ("force", {"at": SheetPlace(0.05, -0.012), "value": (0.1, -0.2, 0.3)}),
    "payload between nodes": ("payload", {"at": SheetPlace(0.05, 0.03, "top"), "mass": 0.04}),
    "floor": ("floor", {"height": -0.004}),
    "support": ("support", {"length": 0.6}),
    "drag": ("drag", {}),
    "clamp": ("clamp", {}),
    "driven_edges": ("driven_edges", {"curvature": 8.7}),
}


@pytest.fixture
def lattice() -> Lattice:
    return Lattice((0.14, 0.14, 0.01), (5, 4), 0.16)


@pytest.fixture
def make_model(lattice):
    points = {"P0": point_at(lattice, ["mid", "centre"]), "P1": point_at(lattice, ["mid", 4, 2])}

    def make(*cases: str) -> Model:
        effects = [effect_class(CASES[case][0])(**CASES[case][1]) for case in cases]
        return Model(lattice, points, effects)

    return make


@pytest.fixture
def general_motion():
    """Coordinates and rates away from every symmetry: nodes off by 2 mm, links by 0.3 rad, rates of 0.5."""

    def motion(model: Model, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
        random = np.random.default_rng(seed)
        q, u = model.reference_state()
        n = 3 * model.lattice.n_nodes
        q[:n] += random.normal(0.0, 2e-3, n)
        q[n:] += random.normal(0.0, 0.3, len(q) - n)
        return q, u + random.normal(0.0, 0.5, len(u))

    return motion
