"""The complete text of a scene names every default and means the very same scene."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.scene.load import complete_text, parse_scene


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_the_complete_text_means_the_same_scene(name):
    scene = load_scene(name)
    text = complete_text(scene)
    again = parse_scene(text, name=name, origin=name)
    assert again.effects == scene.effects and again.sensors == scene.sensors and again.solver == scene.solver
    assert complete_text(again) == text
    one, two = scene.build(), again.build()
    for simulation in (one, two):
        simulation.advance_to(0.05)
    assert np.array_equal(one.state.position, two.state.position, equal_nan=True)


def test_no_parameter_is_left_to_a_default():
    content = yaml.safe_load(complete_text(load_scene("rig")))
    arms = next(block for block in content["effects"] if block["type"] == "arms")
    assert {"joint_damping", "coupling_stiffness", "torque_limit"} <= set(arms)
    assert content["sensors"]["tracker"]["delay"] == 0.0
