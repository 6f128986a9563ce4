"""The magnitude of every effect, against its formula written out again with the numbers of one case."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import CommandError
from ldcs_ros.physics.curves import fill_arc
from ldcs_ros.physics.effects import effect_class
from ldcs_ros.physics.inputs import NO_INPUTS, ChamberPressure, HeldCommands, Wrench
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.material import Material
from ldcs_ros.physics.model import Model
from ldcs_ros.physics.points import point_at
from ldcs_ros.physics.rotation import best_rotation, fill_cross

# 2 x 3 cells of 50 mm x 40 mm, 10 mm thick, 240 g on 24 nodes: 10 g a node.
LATTICE = Lattice((0.10, 0.12, 0.01), (3, 4), 0.24)
SHEET = {"size": [0.1, 0.12, 0.01], "nodes": [3, 4], "mass": 0.24}


def model_of(*effects):
    points = {"P1": point_at(LATTICE, ["top", 2, 1])}
    return Model(LATTICE, points, [effect_class(name)(**values) for name, values in effects])


def force_of(model, q=None, u=None, inputs=NO_INPUTS):
    q0, u0 = model.reference_state()
    return model.force(0.0, q0 if q is None else q, u0 if u is None else u, inputs)


def on_node(model, force, node):
    return force[3 * node : 3 * node + 3]


@pytest.mark.parametrize(
    ("place", "area"),
    [(("top", 0, 0), 0.025 * 0.020), (("top", 0, 1), 0.025 * 0.040), (("bottom", 1, 2), 0.050 * 0.040)],
)
def test_drag_is_half_density_times_coefficient_area_and_speed_squared(place, area):
    model = model_of(("drag", {"density": 1000.0, "coefficient": 1.2}))
    node = LATTICE.node(*place)
    q, u = model.reference_state()
    u[3 * node : 3 * node + 3] = [0.0, 3.0, -4.0]
    expected = 0.5 * 1000.0 * 1.2 * (area / 2.0) * 25.0  # each layer carries half of the sheet's drag
    force = on_node(model, force_of(model, q, u), node)
    np.testing.assert_allclose(force, [0.0, -0.6 * expected, 0.8 * expected], rtol=1e-12)


def test_drag_of_a_sheet_that_moves_flat_is_that_of_one_plate():
    model = model_of(("drag", {"density": 1.2, "coefficient": 1.1}))
    q, u = model.reference_state()
    u[2::3] = 2.0
    assert force_of(model, q, u)[2::3].sum() == pytest.approx(-0.5 * 1.2 * 1.1 * (0.10 * 0.12) * 4.0)


def test_weight_is_mass_times_acceleration_with_the_payload():
    model = model_of(
        ("gravity", {"acceleration": (0.0, 1.0, -9.81)}), ("payload", {"at": "P1", "mass": 0.04})
    )
    force = force_of(model)
    bare, loaded = LATTICE.node("bottom", 0, 0), LATTICE.node("top", 2, 1)
    np.testing.assert_allclose(on_node(model, force, bare), [0.0, 0.010, -0.0981], rtol=1e-12)
    np.testing.assert_allclose(on_node(model, force, loaded), [0.0, 0.050, -0.4905], rtol=1e-12)
    assert force[2::3].sum() == pytest.approx(-0.28 * 9.81)


def test_a_point_force_acts_with_its_value():
    model = model_of(("force", {"at": ["mid", 1, 2], "value": (0.1, -0.2, 0.3)}))
    force = force_of(model).reshape(-1, 3)
    np.testing.assert_allclose(force.sum(axis=0), [0.1, -0.2, 0.3])
    np.testing.assert_allclose(force[LATTICE.node("top", 1, 2)], [0.05, -0.1, 0.15])


@pytest.mark.parametrize("law", ["axial", "axiswise", "corotational"])
def test_the_corner_of_a_blown_up_sheet_is_pulled_by_seven_springs(law):
    # All lengths grow by the factor 1 + s and nothing turns, so each law gives k s times the spring's vector; of
    # the seven other corners of the cell four lie further along each axis.
    k, s = 70.0, 1e-3
    model = model_of(("springs", {"law": law, "stiffness": k, "damping": 0.0}))
    q, u = model.reference_state()
    force = on_node(model, force_of(model, (1.0 + s) * q, u), LATTICE.node("bottom", 0, 0))
    np.testing.assert_allclose(force, 4.0 * k * s * np.array([0.05, 0.04, 0.01]), rtol=1e-6)


def test_a_damper_pulls_with_its_coefficient_times_the_rate_of_length():
    model = model_of(("springs", {"law": "axial", "stiffness": 0.0, "damping": 5.0}))
    q, u = model.reference_state()
    u[3 * LATTICE.node("top", 0, 0) + 2] = 0.3
    force = on_node(model, force_of(model, q, u), LATTICE.node("bottom", 0, 0))
    assert force[2] == pytest.approx(
        5.0 * 0.3
    )  # of the springs at this corner only the upright one grows at once


def test_contact_pushes_with_its_stiffness_and_a_closing_speed_adds_its_part():
    k, w, beta = 1000.0, 1e-4, 10.0
    floor = {"height": -0.005 + 3e-4, "stiffness": k, "damping": beta, "onset": w}
    model = model_of(("floor", floor))
    q, u = model.reference_state()
    node = LATTICE.node("bottom", 1, 1)
    still = k * (3e-4 - w / 2.0)
    assert on_node(model, force_of(model), node)[2] == pytest.approx(still)
    u[3 * node + 2] = -0.02
    assert on_node(model, force_of(model, q, u), node)[2] == pytest.approx(still * (1.0 + beta * 0.02))
    q[3 * node + 2] += 3e-4 - w / 2.0  # half of the onset's width is left: k d^2 / 2 w
    assert on_node(model, force_of(model, q), node)[2] == pytest.approx(k * (w / 2.0) ** 2 / (2.0 * w))


def test_a_torque_on_every_joint_is_a_torque_on_the_last_link_only():
    # Virtual work of absolute angles: Q_k = T_k - T_{k+1}.
    model = model_of(("arms", {"links": 3}))
    torque = np.array([[0.3, 0.2, 0.07], [0.1, 0.1, 0.1]])
    difference = force_of(model, inputs=HeldCommands(torque=torque)) - force_of(
        model, inputs=HeldCommands(torque=0.0 * torque)
    )
    np.testing.assert_allclose(
        difference[3 * LATTICE.n_nodes :], [0.1, 0.13, 0.07, 0.0, 0.0, 0.1], atol=1e-12
    )


def test_pressure_drives_each_joint_with_its_gain():
    model = model_of(("arms", {"links": 2, "drive": "pressure", "pressure_gain": 2e-6}))
    valves = tuple(ChamberPressure(0.0, pressure, pressure, 0.1, 0.1) for pressure in (100e3, 50e3))
    empty = tuple(ChamberPressure(0.0, 0.0, 0.0, 0.1, 0.1) for _ in range(2))
    difference = force_of(model, inputs=HeldCommands(chambers=valves)) - force_of(
        model, inputs=HeldCommands(chambers=empty)
    )
    np.testing.assert_allclose(difference[3 * LATTICE.n_nodes :], [0.0, 0.2, 0.0, 0.1], atol=1e-12)


@pytest.mark.parametrize(("key", "moving"), [("joint_stiffness", False), ("joint_damping", True)])
def test_a_joint_resists_its_own_angle_and_the_base_joint_as_half_a_link(key, moving):
    value, angles = 0.4, np.array([0.1, 0.3, 0.2])
    base = {"links": 3, "joint_stiffness": 0.0, "joint_damping": 0.0, "base_joint_share": 0.5}
    forces = []
    for number in (0.0, value):
        model = model_of(("arms", {**base, key: number}))
        q, u = model.reference_state()
        (u if moving else q)[3 * LATTICE.n_nodes :] = np.tile(angles, 2)
        forces.append(force_of(model, q, u, HeldCommands(torque=np.zeros((2, 3))))[3 * LATTICE.n_nodes :])
    bends = np.diff(angles, prepend=0.0)
    moments = -np.array([value / 0.5, value, value]) * bends
    expected = moments - np.append(moments[1:], 0.0)
    np.testing.assert_allclose(forces[1] - forces[0], np.tile(expected, 2), atol=1e-10)


def test_a_chamber_fills_and_vents_by_its_own_exponential():
    assert ChamberPressure(1.0, 20e3, 100e3, 0.15, 0.1).at(1.3) == pytest.approx(
        100e3 - 80e3 * math.exp(-2.0)
    )
    assert ChamberPressure(1.0, 100e3, 20e3, 0.15, 0.1).at(1.3) == pytest.approx(20e3 + 80e3 * math.exp(-3.0))


def test_a_wrench_gives_its_force_and_its_moment():
    model = model_of(("wrench", {}))
    wrench = Wrench(force=(0.1, 0.2, 0.3), torque=(0.01, -0.02, 0.03))
    force = force_of(model, inputs=HeldCommands(wrenches={"node_top_1_1_aligned": wrench})).reshape(-1, 3)
    origin = LATTICE.reference_position[LATTICE.node("top", 1, 1)]
    np.testing.assert_allclose(force.sum(axis=0), wrench.force, atol=1e-12)
    moment = np.cross(LATTICE.reference_position - origin, force).sum(axis=0)
    np.testing.assert_allclose(moment, wrench.torque, atol=1e-12)


@pytest.mark.parametrize(
    ("effect", "command", "limit"),
    [
        ({"type": "arms", "torque_limit": 0.2}, lambda inputs, value: inputs.set_torque(value), 0.2),
        ({"type": "arms", "torque_limit": 0.2}, lambda inputs, value: inputs.set_torque(-value), 0.2),
        (
            {"type": "arms", "drive": "pressure", "pressure_limit": 150e3},
            lambda inputs, value: inputs.set_pressure(value),
            150e3,
        ),
        (
            {"type": "wrench", "force_limit": 3.0},
            lambda inputs, value: inputs.set_wrench("node_top_1_1", force=(0.0, 0.0, value)),
            3.0,
        ),
        (
            {"type": "wrench", "torque_limit": 0.5},
            lambda inputs, value: inputs.set_wrench("node_top_1_1", torque=(0.0, value, 0.0)),
            0.5,
        ),
    ],
)
def test_a_command_is_accepted_up_to_its_limit_and_refused_above(effect, command, limit):
    scene = load_scene({"lattice": SHEET, "effects": [{"type": "springs"}, {"type": "clamp"}, effect]})
    simulation = scene.build()
    command(simulation.inputs, 0.999 * limit)
    with pytest.raises(CommandError):
        command(simulation.inputs, 1.001 * limit)


@pytest.mark.parametrize("name", ["drag", "wrench", "payload"])
def test_an_effect_that_stores_nothing_has_no_energy(name):
    values = {"payload": {"at": "P1", "mass": 0.04}}.get(name, {})
    model = model_of((name, values))
    q, _ = model.reference_state()
    assert model.potential_energy(0.0, 1.1 * q) == 0.0


def test_weight_stores_mass_times_acceleration_times_height_and_springs_half_k_s_squared():
    model = model_of(
        ("gravity", {"acceleration": (0.0, 0.0, -9.81)}), ("payload", {"at": "P1", "mass": 0.04})
    )
    q, _ = model.reference_state()
    higher = q.copy()
    higher[2::3] += 0.5
    rise = model.potential_energy(0.0, higher) - model.potential_energy(0.0, q)
    assert rise == pytest.approx(0.28 * 9.81 * 0.5)
    springs = model_of(("springs", {"law": "axial", "stiffness": 70.0, "damping": 5.0}))
    q, _ = springs.reference_state()
    moved = q.copy()
    node, d = LATTICE.node("top", 0, 0), np.array([1e-3, 2e-3, -1.5e-3])
    moved[3 * node : 3 * node + 3] += d
    rest = LATTICE.reference_position
    neighbours = [LATTICE.node(layer, i, j) for layer in ("top", "bottom") for i in (0, 1) for j in (0, 1)]
    lengths = [(np.linalg.norm(rest[node] - rest[n]), np.linalg.norm(rest[node] + d - rest[n]))
               for n in neighbours if n != node]  # fmt: skip
    expected = sum(0.5 * 70.0 * (after - before) ** 2 for before, after in lengths)
    assert springs.potential_energy(0.0, moved) == pytest.approx(expected)


@pytest.mark.parametrize(("length", "width"), [(0.5, 0), (0.49, 1), (1.0, 0)])
def test_plates_support_the_bottom_rows_at_both_sides_up_to_their_length(length, width):
    # All nodes are pressed 1 mm below the plates: k (d - w / 2) each, with the defaults k = 1000 N/m, w = 0.1 mm.
    model = model_of(("support", {"length": length, "width": width}))
    q, u = model.reference_state()
    q[2::3] -= 1e-3
    pushed = force_of(model, q, u)[2::3]
    columns = {0.5: (0, 1), 0.49: (0,), 1.0: (0, 1, 2)}[length]
    rows = {0: (0, 3), 1: (0, 1, 2, 3)}[width]
    expected = np.zeros(LATTICE.n_nodes)
    for i in columns:
        for j in rows:
            expected[LATTICE.node("bottom", i, j)] = 1000.0 * (1e-3 - 0.5e-4)
    np.testing.assert_allclose(pushed, expected, atol=1e-12)


@pytest.mark.parametrize("law", ["axial", "corotational"])
def test_the_relaxation_time_of_the_springs_is_damping_over_stiffness(law):
    model = model_of(("springs", {"law": law, "stiffness": 80.0, "damping": 5.0}))
    assert model.terms[0].relaxation_time == pytest.approx(5.0 / 80.0)
    rigid = model_of(("springs", {"law": law, "stiffness": 0.0, "damping": 5.0}))
    assert math.isinf(rigid.terms[0].relaxation_time)


ARM_LIST = [
    {"name": "long", "from": [0.0, 0.06], "to": [0.1, 0.06], "links": 3},
    {"name": "short", "from": [0.0, -0.06], "to": [0.1, -0.06], "links": 2},
]


@pytest.mark.parametrize(("drive", "value"), [("torque", [0.2, 0.1]), ("pressure", [100e3, 50e3])])
def test_a_shorter_arm_has_no_torque_at_the_joints_it_lacks(drive, value):
    arms = {"type": "arms", "drive": drive, "width": 0, "arms": ARM_LIST, "pressure_gain": 2e-6, "fill_time": 0.0,
            "dead_time": 0.0}  # fmt: skip
    simulation = load_scene(
        {"lattice": SHEET, "effects": [{"type": "springs"}, {"type": "clamp"}, arms]}
    ).build()
    getattr(simulation.inputs, f"set_{drive}")(value)
    np.testing.assert_allclose(simulation.joint_torque, [[0.2, 0.2, 0.2], [0.1, 0.1, 0.0]])


def test_an_arm_in_the_middle_holds_the_rows_at_both_sides_alike():
    # 5 rows of nodes; the arm lies on the third and its ribs reach one row to each side.
    sheet = {"size": [0.1, 0.12, 0.01], "nodes": [3, 5], "mass": 0.3}
    arms = {"type": "arms", "links": 2, "width": 1, "drive": "torque",
            "arms": [{"name": "middle", "from": [0.0, 0.0], "to": [0.1, 0.0]}]}  # fmt: skip
    simulation = load_scene({"lattice": sheet, "effects": [{"type": "clamp"}, arms]}).build()
    model = simulation.model
    q, u = model.reference_state()
    q[-2:] = [0.1, 0.3]
    full = np.zeros(len(q))
    full[model.free] = model.force(0.0, q, u, simulation.inputs.held())
    pulls = full[:-2].reshape(2, 3, 5, 3)[..., 2]
    assert (pulls[:, 1:, 1:4] > 1e-3).all()
    np.testing.assert_allclose(pulls[:, :, 1], pulls[:, :, 3], atol=1e-12)
    assert not pulls[:, :, [0, 4]].any()


def test_the_kinetic_energy_of_the_arms_is_that_of_the_centres_of_their_links_and_of_their_turning():
    # Two links of 0.05 m, 20 g and 3e-6 kg m^2 at angles 0.2 and 0.5 that turn with 1.5 and -2 rad/s, one arm.
    mass, inertia, length, angle, rate = 0.02, 3e-6, 0.05, (0.2, 0.5), (1.5, -2.0)
    arms = {"links": 2, "link_mass": mass, "link_inertia": inertia, "rigid_base": 0.0}
    model = model_of(("arms", arms))
    q, u = model.reference_state()
    q[-4:], u[-4:] = (*angle, 0.0, 0.0), (*rate, 0.0, 0.0)
    normals = [np.array([-math.sin(a), math.cos(a)]) for a in angle]
    first = 0.5 * length * rate[0] * normals[0]
    second = length * rate[0] * normals[0] + 0.5 * length * rate[1] * normals[1]
    expected = 0.5 * mass * (first @ first + second @ second) + 0.5 * inertia * (rate[0] ** 2 + rate[1] ** 2)
    assert model.kinetic_energy(q, u) == pytest.approx(expected)
    u[0] = 3.0
    assert model.kinetic_energy(q, u) == pytest.approx(expected + 0.5 * 0.01 * 9.0)


@pytest.mark.parametrize("poisson", [1.0 / 3.0, 0.45])
def test_a_stretched_sheet_of_a_material_has_the_stiffness_of_plane_stress(poisson):
    modulus, (length, width, thickness) = 2e5, (0.09, 0.12, 0.01)
    lattice = Lattice((length, width, thickness), (4, 5), 0.1)
    material = Material(youngs_modulus=modulus, poisson=poisson, density=1000.0)
    stiffness = material.stiffness(lattice)
    first, last = lattice.springs.T
    along = lattice.reference_position[last] - lattice.reference_position[first]
    # A spring of a uniform strain (xx, yy, zz) becomes longer by (x^2, y^2, z^2) . strain / length.
    longer = along**2 / np.linalg.norm(along, axis=1)[:, None]
    energy = np.einsum("s,si,sj->ij", stiffness, longer, longer)
    # The sheet is free to become thinner.
    plane = energy[:2, :2] - np.outer(energy[:2, 2], energy[2, :2]) / energy[2, 2]
    membrane = modulus * thickness / (1.0 - poisson**2) * np.array([[1.0, poisson], [poisson, 1.0]])
    np.testing.assert_allclose(plane, length * width * membrane, rtol=1e-9)


def test_a_spring_has_the_mean_of_the_cells_that_hold_both_of_its_ends():
    lattice = Lattice((0.2, 0.2, 0.01), (3, 3), 0.1)
    cells = np.array([[1.0, 2.0], [4.0, 8.0]])
    mean = dict(zip(map(tuple, lattice.springs.tolist()), lattice.mean_of_cells(cells), strict=True))

    def between(first, last):
        return mean[tuple(sorted((lattice.node("bottom", *first), lattice.node("bottom", *last))))]

    # On a side, between two cells along x and along y, and across one cell.
    assert between((0, 0), (1, 0)) == 1.0 and between((1, 2), (2, 2)) == 8.0
    assert between((0, 1), (1, 1)) == 1.5 and between((1, 1), (2, 1)) == 6.0
    assert between((1, 0), (1, 1)) == 2.5 and between((1, 1), (1, 2)) == 5.0
    assert between((0, 0), (1, 1)) == 1.0 and between((1, 1), (2, 0)) == 4.0
    # Straight across the sheet in the middle: all four.
    middle = tuple(sorted((lattice.node("bottom", 1, 1), lattice.node("top", 1, 1))))
    assert mean[middle] == 3.75


def test_gravity_is_981_of_the_nodes_mass_where_a_scene_says_no_more():
    model = model_of(("gravity", {}))
    force = force_of(model).reshape(-1, 3)
    np.testing.assert_allclose(force[:, 2].sum(), -0.24 * 9.81, rtol=1e-12)
    assert not force[:, :2].any()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("angle", [np.pi, 3.0, -2.5, 0.1])
def test_the_best_rotation_of_a_turned_set_is_its_turn(axis, angle):
    a, b = [k for k in range(3) if k != axis]
    turn = np.eye(3)
    turn[[a, a, b, b], [a, b, a, b]] = [np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)]
    found = np.empty((3, 3))
    best_rotation(turn @ np.diag([1.0, 2.0, 3.0]), found)
    np.testing.assert_allclose(found, turn, atol=1e-12)


@pytest.mark.parametrize("angle", [1e-3, 0.05, 0.0999, 0.1001, 1.2])
def test_places_on_an_arc_are_those_of_the_circle_and_their_rates_its_slopes(angle):
    along, height, kappa_rate = 0.14, 0.02, 3.0
    kappa = angle / along
    place, rate = np.empty((2, 1, 3))
    fill_arc(np.array([along]), np.array([0.03]), np.array([height]), kappa, kappa_rate, place, rate)
    # The middle of the circle is at (0, 1 / kappa); half angles keep the digits.
    x, z = np.sin(angle) / kappa, 2.0 * np.sin(0.5 * angle) ** 2 / kappa
    expected = [x - height * np.sin(angle), 0.03, z + height * np.cos(angle)]
    np.testing.assert_allclose(place[0], expected, rtol=1e-13)
    # The same in 19 digits on both sides of the curvature gives the slope.
    wide = np.longdouble(along) * (np.longdouble(kappa) + np.array([-1e-5, 1e-5], np.longdouble))
    arc = np.array([np.sin(wide), 2.0 * np.sin(0.5 * wide) ** 2]) * along / wide
    ends = arc + height * np.array([-np.sin(wide), np.cos(wide)])
    slope = ((ends[:, 1] - ends[:, 0]) / np.longdouble(2e-5)).astype(float)
    np.testing.assert_allclose(rate[0, [0, 2]], kappa_rate * slope, rtol=1e-9)


def test_the_matrix_of_a_cross_product_overwrites_whatever_was_there():
    v, w, out = np.array([1.0, -2.0, 3.0]), np.array([0.5, 4.0, -1.0]), np.full((3, 3), 7.0)
    fill_cross(v, 2.0, out)
    np.testing.assert_allclose(out @ w, 2.0 * np.cross(v, w), rtol=1e-14)
