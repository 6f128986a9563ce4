"""One way to change a scene: values at paths, checked as a whole."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.errors import SceneError
from ldcs_ros.integrators.settings import Solver


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_the_content_makes_the_same_scene(name):
    scene = load_scene(name)
    again = load_scene(scene.content)
    assert (again.lattice, again.points, again.effects) == (scene.lattice, scene.points, scene.effects)
    assert (again.inputs, again.sensors, again.solver) == (scene.inputs, scene.sensors, scene.solver)


def test_an_edit_changes_its_keys_and_nothing_else():
    scene = load_scene("paper")
    heavy = scene.edited({"effects.payload.mass": np.float64(0.05), "lattice.nodes": (9, 9)}, title="heavy")
    assert heavy.effect("payload").mass == 0.05 and heavy.title == "heavy" and heavy.name == scene.name
    assert heavy.effect("springs") == scene.effect("springs") and heavy.inputs == scene.inputs
    assert scene.effect("payload").mass == 0.04


def test_none_removes_a_key_and_an_absent_key_is_no_error():
    scene = load_scene("paper")
    assert scene.edited(inputs=None).inputs == () == scene.without_schedule().without_schedule().inputs
    assert scene.edited({"effects.payload": None}).effect("payload") is None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"effects.payload.mass": -1.0}, r"payload|effects\[\d\].mass"),
        ({"effects.pendulum.mass": 1.0}, "no entry"),
        ({"effects.payload.colour": 1.0}, "unknown key"),
        ({"title": object()}, "expected a number, text"),
    ],
)
def test_an_invalid_edit_is_refused_and_leaves_the_scene(changes, words):
    scene = load_scene("paper")
    with pytest.raises(SceneError, match=words):
        scene.edited(changes)
    assert scene == load_scene("paper")


def test_a_dict_of_numpy_numbers_is_a_scene():
    content = load_scene("paper").content
    lattice = {"size": np.array([0.14, 0.14, 0.01]), "nodes": np.array([9, 9]), "mass": np.float32(0.16)}
    scene = load_scene({**content, "lattice": lattice})
    assert scene.lattice.size == load_scene("paper").lattice.size
    assert load_scene(scene.content).lattice == scene.lattice


def test_another_accuracy_keeps_the_method_of_a_fixed_step():
    fixed = load_scene("paper").edited(solver={"integrator": "rk4", "dt": 1e-6})
    assert fixed.with_accuracy(1e-4).solver == Solver("rk4", 1e-4, None)
    assert load_scene("paper").with_accuracy(1e-4).solver.integrator == load_scene("paper").solver.integrator


@pytest.mark.parametrize(
    "values",
    [
        ("rk5", 1e-5, None),
        ("auto", None, None),
        ("auto", None, 1e-3),
        ("rk4", 1e-5, 1e-3),
        ("auto", 0.1, None),
        ("auto", float("nan"), None),
        ("rk4", None, 2.0),
    ],
)
def test_solver_settings_check_themselves(values):
    with pytest.raises(SceneError, match="solver"):
        Solver(*values)
