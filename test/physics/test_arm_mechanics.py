"""The arms against independent mechanics: Lagrange's equations by differences, arcs, and the weight they carry."""

from __future__ import annotations

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.errors import SceneError
from ldcs_ros.physics.effects import effect_class
from ldcs_ros.physics.inputs import NO_INPUTS, HeldCommands
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.model import Model


def _kinetic_energy(phi, rate, mass, inertia, length):
    # From the centres' velocities, not from the mass matrix.
    tip, total = np.zeros(2), 0.0
    for angle, spin, reach in zip(phi, rate, length, strict=True):
        along = reach * spin * np.array([-np.sin(angle), np.cos(angle)])
        centre = tip + 0.5 * along
        total += 0.5 * mass * centre @ centre + 0.5 * inertia * spin**2
        tip = tip + along
    return total


def test_the_mass_matrix_is_that_of_the_links_kinetic_energy(make_model, general_motion):
    model = make_model("arms torque")
    q, u = general_motion(model)
    term = model.arms
    arms = zip(term.angles(q), term.angles(u), term.inertia(q), term.link_length, strict=True)
    for phi, rate, matrix, length in arms:
        energy = _kinetic_energy(phi, rate, term.arms.link_mass, term.arms.link_inertia, length)
        np.testing.assert_allclose(0.5 * rate @ matrix @ rate, energy, rtol=1e-12)


def test_coriolis_forces_follow_from_the_kinetic_energy(make_model, general_motion):
    # Lagrange: f = dT/dphi - d/dt(M) phi', both by central differences of the kinetic energy.
    model = make_model("arms torque")
    q, u = general_motion(model)
    term, h = model.arms, 1e-6
    constants = (term.arms.link_mass, term.arms.link_inertia, term.link_length[0])
    even = 0.5 * (model.force(0.0, q, u, NO_INPUTS) + model.force(0.0, q, -u, NO_INPUTS))
    coriolis = term.angles(even - model.force(0.0, q, 0.0 * u, NO_INPUTS))
    for side in range(2):
        phi, rate = term.angles(q)[side], term.angles(u)[side]
        slope = np.array(
            [
                (
                    _kinetic_energy(phi + h * d, rate, *constants)
                    - _kinetic_energy(phi - h * d, rate, *constants)
                )
                / (2 * h)
                for d in np.eye(4)
            ]
        )
        ahead, behind = q.copy(), q.copy()
        term.angles(ahead)[side] += h * rate
        term.angles(behind)[side] -= h * rate
        change = (term.inertia(ahead)[side] - term.inertia(behind)[side]) / (2 * h)
        np.testing.assert_allclose(coriolis[side], slope - change @ rate, rtol=1e-6, atol=1e-12)


def test_half_a_joint_at_the_base_puts_the_stations_on_an_arc():
    scene = {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [9, 9], "mass": 0.16},
        "effects": [{"type": "springs"}, {"type": "clamp"}, {"type": "arms", "drive": "curvature"}],
    }
    simulation = load_scene(scene).build()
    q, u = simulation.model.reference_state()
    simulation.model.prescribe(5.0, q, u)
    stations = simulation.model.arms.station_positions(q)[0]
    radius = 1.0 / 8.695652173913043
    # Chords of 35 mm instead of arcs leave the stations at most 0.5 mm off the circle of the same curvature.
    assert np.abs(np.hypot(stations[:, 0], stations[:, 2] - radius) - radius).max() < 5e-4
    assert abs(stations[-1, 2] - 0.0755) < 1e-4


def test_a_stiff_base_and_a_raised_backbone_keep_the_flat_sheet_flat():
    arms = {"type": "arms", "rigid_base": 0.01, "backbone_height": 0.004, "width": 1}
    scene = {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [9, 9], "mass": 0.16},
        "effects": [{"type": "springs"}, {"type": "clamp"}, arms],
    }
    simulation = load_scene(scene).build()
    q, u = simulation.model.reference_state()
    assert np.abs(simulation.model.force(0.0, q, u, simulation.inputs.held())).max() < 1e-9
    stations = simulation.model.arms.station_positions(q)[0]
    np.testing.assert_allclose(stations[:, 0], [0.0, 0.035, 0.070, 0.105, 0.140], atol=1e-15)
    np.testing.assert_allclose(stations[:, 2], 0.004, atol=1e-15)


@pytest.mark.parametrize(
    ("arms", "words"),
    [({"rigid_base": 0.035}, "less than a link"), ({"backbone_height": 0.006}, "inside the sheet")],
)
def test_an_arm_outside_of_its_sheet_is_refused_when_the_scene_is_built(arms, words):
    scene = {
        "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [9, 9], "mass": 0.16},
        "effects": [{"type": "springs"}, {"type": "clamp"}, {"type": "arms", **arms}],
    }
    with pytest.raises(SceneError, match=words):
        load_scene(scene).build()


def test_a_backbone_above_the_mid_plane_lengthens_the_mid_plane_of_a_bent_arm():
    # Bending by an angle a about a line h higher than the mid-plane moves the mid-plane's end by h (sin a, 1 - cos a).
    angle = 4 * 0.035 * 8.7
    ends = []
    for height in (0.0, 0.004):
        arms = {"type": "arms", "drive": "curvature", "curvature": 8.7, "backbone_height": height}
        scene = {
            "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [9, 9], "mass": 0.16},
            "effects": [{"type": "springs", "stiffness": 1.0}, {"type": "clamp"}, arms],
        }
        simulation = load_scene(scene).build()
        simulation.settle()
        ends.append(simulation.state.position[simulation.lattice.index[:, -1, -1]].mean(axis=0)[[0, 2]])
    last_link = angle - 0.5 * 0.035 * 8.7
    expected = 0.004 * np.array([np.sin(last_link), 1.0 - np.cos(last_link)])
    np.testing.assert_allclose(ends[1] - ends[0], expected, atol=2e-5)


def test_the_sheets_weight_bends_the_arms():
    paper = load_scene("paper").build()
    unloaded = load_scene("paper_no_load").build()
    for simulation in (paper, unloaded):
        simulation.settle()
    assert (unloaded.state.link_angle[:, -1] - paper.state.link_angle[:, -1] > 0.05).all()


def test_weight_and_coriolis_forces_of_a_fast_chain_have_their_exact_slopes():
    # Without joints and couplings the chain's own forces are all there is; a stiff part would hide an error in them.
    lattice = Lattice((0.12, 0.1, 0.01), (4, 2), 0.1)
    values = {"links": 3, "link_mass": 0.05, "joint_stiffness": 0.0, "joint_damping": 0.0, "width": 0,
              "coupling_stiffness": 0.0, "coupling_damping": 0.0}  # fmt: skip
    model = Model(lattice, {}, [effect_class("gravity")(), effect_class("arms")(**values)])
    q, u = model.reference_state()
    generator = np.random.default_rng(4)
    q[-6:], u[-6:] = generator.uniform(-1.0, 1.0, 6), generator.uniform(-20.0, 20.0, 6)
    inputs = HeldCommands(torque=np.zeros((2, 3)))
    by_angle, by_rate = (np.zeros((len(q), len(q))) for _ in range(2))
    parts = model.jacobian(0.0, q, u, inputs, positive_definite=False)
    for dense, part in zip((by_angle, by_rate), parts, strict=True):
        np.add.at(dense, model.jacobian_pattern, part)
    h = 1e-5
    for dense, vector in ((by_angle, q), (by_rate, u)):
        for k in range(len(q) - 6, len(q)):
            before = vector[k]
            ends = []
            for vector[k] in (before - h, before + h):
                ends.append(model.force(0.0, q, u, inputs)[-6:].copy())
            vector[k] = before
            np.testing.assert_allclose(dense[-6:, k], (ends[1] - ends[0]) / (2.0 * h), rtol=1e-5, atol=1e-8)
    assert np.abs(by_angle[-6:, -6:]).max() > 0.01 and np.abs(by_rate[-6:, -6:]).max() > 1e-4


def test_an_arm_is_as_wide_as_the_sheets_rows_at_most():
    def built(width, **arms):
        return load_scene(small_sheet(nodes=(5, 3), arms={"links": 2, "width": width, **arms})).build()

    assert built(2).model.arms is not None
    with pytest.raises(ValueError, match=r"got 3, expected 0 \.\.\. 2, the sheet has 3 rows"):
        built(3)
    listed = [{"name": "middle", "from": [0.0, 0.0], "to": [0.14, 0.0]}]
    with pytest.raises(ValueError, match=r"got 5, expected 0 \.\.\. 4"):
        built(5, arms=listed)


def test_a_sheet_is_loose_where_nothing_holds_a_node():
    content = small_sheet(nodes=(5, 5))
    for kept, holes, loose in (
        (("springs",), [], True),
        (("springs",), [{"circle": [0.07, 0.0, 0.01]}], True),
        (("springs", "clamp"), [], False),
        (("springs", "clamp", "arms"), [], False),
    ):
        effects = [effect for effect in content["effects"] if effect["type"] in kept]
        lattice = {**content["lattice"], "holes": holes}
        points = {"P1": content["points"]["P1"]}
        scene = load_scene({"lattice": lattice, "points": points, "effects": effects})
        assert scene.build().model.is_unconstrained == loose
