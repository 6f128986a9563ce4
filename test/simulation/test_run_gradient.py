"""The gradient by all commands is that of the tangents by each."""

from __future__ import annotations

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene

# Small and short: it moves, and every command acts, on each scene.
WRENCH = {"frame": "P1", "force": [0.1, 0.0, 0.3], "torque": [0.0, 1e-3, 0.0]}
TIMES = [0.018, 0.033, 0.05]
SCENES = {
    "pressure through a valve": (
        {"dead_time": 0.004},
        [
            {"time": 0.0, "pressure": 100e3},
            {"time": 0.01, "pressure": [60e3, 120e3]},
            {"time": 0.02, "wrench": WRENCH},
            {"time": 0.03, "pressure": [90e3, 20e3]},
        ],
        ["pressure.left@0", "pressure.left@0.01", "pressure.right@0.01", "pressure.right@0.03"],
    ),
    "pressure without delay": (
        {"fill_time": 0.0, "vent_time": 0.0},
        [
            {"time": 0.0, "pressure": 100e3},
            {"time": 0.02, "wrench": WRENCH},
            {"time": 0.03, "pressure": [90e3, 20e3]},
        ],
        ["pressure.left@0", "pressure.right@0", "pressure.left@0.03", "pressure.right@0.03"],
    ),
    "torque": (
        {"drive": "torque"},
        [
            {"time": 0.0, "torque": 0.02},
            {"time": 0.02, "wrench": WRENCH},
            {"time": 0.03, "torque": [0.03, -0.01]},
        ],
        ["torque.left_joint_1@0", "torque.right_joint_2@0.03"],
    ),
}


@pytest.mark.parametrize("scene", SCENES)
def test_a_gradient_is_the_tangents_by_each_command(scene):
    arms, inputs, names = SCENES[scene]
    names = [*names, "wrench.P1.force@0.02", "wrench.P1.torque@0.02"]
    content = small_sheet(
        {"type": "wrench"},
        nodes=(3, 3),
        arms={"links": 2, "joint_stiffness": 0.34, **arms},
        inputs=inputs,
        solver={"accuracy": 1e-5},
    )
    simulation = load_scene(content).build()
    weights = np.zeros((3, 6))
    weights[0, 2], weights[1, 4], weights[2, 3:] = 0.5, -1.0, (2.0, 0.3, 1.0)
    found = simulation.run_gradient(TIMES, ["P0", "P1"], weights)
    assert simulation.time == 0.0
    tangents = simulation.run_sensitivity(TIMES, ["P0", "P1"], names, with_error=False)
    assert found.value == pytest.approx(float(np.sum(weights * tangents.position)), abs=1e-5)
    expected = np.einsum("tr,trc->c", weights, tangents.values)
    for name, value in zip(tangents.to, expected, strict=True):
        command, _, time = name.partition("@")
        row = found.time.tolist().index(float(time))
        own = found.values[row, found.command.index(command)]
        kind = [k for k, other in enumerate(tangents.to) if other.partition(".")[0] == name.partition(".")[0]]
        assert abs(own - value) < 2e-3 * np.abs(expected[kind]).max(), name
    # At 0.03 s only the drive is commanded.
    wrenches = [k for k, name in enumerate(found.command) if name.startswith("wrench")]
    assert not found.values[found.time.tolist().index(0.03), wrenches].any()


def test_weights_of_another_shape_are_refused_and_lists_are_taken():
    simulation = load_scene(small_sheet(inputs=[{"time": 0.0, "pressure": 50e3}])).build()
    with pytest.raises(ValueError, match=r"weights: got shape \(3,\), expected \(1, 3\)"):
        simulation.run_gradient([0.01], of=["P1"], weights=[1.0, 0.0, 0.0])
    assert simulation.run_gradient([0.01], of=["P1"], weights=[[1.0, 0.0, 0.0]]).value > 0.0
