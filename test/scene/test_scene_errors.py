"""Bad scenes: one clear line with the path of the key, and nothing is built."""

from __future__ import annotations

import copy

import pytest

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.errors import SceneError

GOOD = {
    "title": "t",
    "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [5, 5], "mass": 0.16},
    "points": {"P0": ["mid", "centre"]},
    "effects": [{"type": "springs"}, {"type": "clamp", "edge": "x_min"}, {"type": "arms"}],
    "inputs": [{"time": 0.0, "torque": 0.1}],
    "sensors": {"tracker": {"points": ["P0"]}},
    "solver": {"integrator": "auto", "accuracy": 1e-5},
}
BAD = {
    "a hole that meets itself": (
        ("lattice.holes", [{"polygon": [[0, 0], [2, 2], [2, 0], [0, 2]]}]),
        "does not meet itself as at [1, 1]",
    ),
    "unknown top key": (("solvers", {}), "Did you mean 'solver'"),
    "missing effects": (("effects", None), "effects"),
    "one node": (("lattice.nodes", [1, 9]), "lattice.nodes"),
    "nodes not whole": (("lattice.nodes", [9.5, 9]), "lattice.nodes"),
    "too many nodes": (("lattice.nodes", [5000, 9]), "lattice.nodes"),
    "negative mass": (("lattice.mass", -0.1), "lattice.mass"),
    "mass as text": (("lattice.mass", "1e-1"), "without quotes"),
    "mass not a number": (("lattice.mass", float("nan")), "finite"),
    "size of two": (("lattice.size", [0.1, 0.1]), "lattice.size"),
    "unknown effect": (("effects.0.type", "spring"), "Did you mean 'springs'"),
    "effect without type": (("effects.0", {"law": "axial"}), "effects[0]"),
    "unknown parameter": (("effects.0.stifness", 1.0), "Did you mean 'stiffness'"),
    "unknown law": (("effects.0.law", "cubic"), "axial"),
    "stiffness below zero": (("effects.0.stiffness", -1.0), "effects[0].stiffness"),
    "unknown edge": (("effects.1.edge", "left"), "x_min"),
    "same effect twice": (("effects.1", {"type": "springs"}), "twice"),
    "links not whole": (("effects.2.links", 2.5), "effects[2].links"),
    "bool as number": (("effects.2.link_mass", True), "effects[2].link_mass"),
    "point outside": (("points.P0", ["mid", 9, 0]), "points.P0"),
    "point's layer": (("points.P0", ["upper", 1, 1]), "layer"),
    "point's name": (("points", {"node_top_1_1": ["mid", 1, 1]}), "taken"),
    "schedule backwards": (
        ("inputs", [{"time": 1.0, "torque": 0.0}, {"time": 0.5, "torque": 0.0}]),
        "inputs[1].time",
    ),
    "schedule commands nothing": (("inputs", [{"time": 0.0}]), "inputs[0]"),
    "tracker of nothing": (("sensors.tracker.points", ["P7"]), "sensors.tracker.points"),
    "unknown sensor": (("sensors", {"trakstar": {}}), "Did you mean 'tracker'"),
    "unknown integrator": (("solver.integrator", "rk5"), "solver.integrator"),
    "accuracy of zero": (("solver.accuracy", 0.0), "solver.accuracy"),
    "fixed step with auto": (("solver", {"integrator": "auto", "dt": 1e-3}), "solver.dt"),
}
BAD_AT_BUILD = {
    "pressure to torque arms": (("inputs", [{"time": 0.0, "pressure": 1e5}]), "drive: pressure"),
    "torque of wrong size": (("inputs", [{"time": 0.0, "torque": [1.0, 2.0, 3.0]}]), "inputs[0]"),
    "torque above the limit": (("inputs", [{"time": 0.0, "torque": 50.0}]), "at most"),
    "wrench without the effect": (("inputs", [{"time": 0.0, "wrench": {"frame": "P0"}}]), "type: wrench"),
    "arms wider than the sheet": (("effects.2.width", 7), "width"),
}


def _changed(change):
    path, value = change
    scene = copy.deepcopy(GOOD)
    *steps, last = path.split(".")
    block = scene
    for step in steps:
        block = block[int(step)] if isinstance(block, list) else block[step]
    key = int(last) if isinstance(block, list) else last
    block[key] = value
    return scene


@pytest.mark.parametrize("case", BAD)
def test_a_bad_scene_is_refused_in_one_line_with_its_place(case):
    change, words = BAD[case]
    with pytest.raises(SceneError) as refusal:
        load_scene(_changed(change))
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value) and " @ " in str(refusal.value)


@pytest.mark.parametrize("case", BAD_AT_BUILD)
def test_effects_that_do_not_fit_are_refused_when_built(case):
    change, words = BAD_AT_BUILD[case]
    with pytest.raises(SceneError, match=words.replace("[", r"\[")):
        load_scene(_changed(change)).build()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lattice: {size: [1, 1", "line"),
        ("a: 1\na: 2\n", "given twice"),
        ("lattice: &x {size: *x}\neffects: []\n", ""),
        ("- 1\n- 2\n", "mapping"),
        ("", "mapping"),
        ("x: " + "[" * 200 + "]" * 200, ""),
    ],
)
def test_a_file_that_is_no_scene_is_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(SceneError) as refusal:
        load_scene(path)
    assert words in str(refusal.value) and "bad.yaml" in str(refusal.value) and "\n" not in str(refusal.value)


def test_files_that_cannot_be_read_are_refused(tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "large.yaml").write_text("# " + "x" * 2_000_000)
    for source in (
        "no_such_scene",
        tmp_path / "none.yaml",
        tmp_path,
        tmp_path / "binary.yaml",
        tmp_path / "large.yaml",
    ):
        with pytest.raises(SceneError) as refusal:
            load_scene(source)
        assert "\n" not in str(refusal.value)


def test_a_misspelt_scene_is_met_with_the_nearest():
    with pytest.raises(SceneError, match="Did you mean 'paper'"):
        load_scene("papr")


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_a_scenes_text_makes_the_same_scene(name, tmp_path):
    scene = load_scene(name)
    path = tmp_path / f"{name}.yaml"
    path.write_text(scene.text)
    assert load_scene(path) == scene


def test_a_command_that_its_effect_will_refuse_is_refused_before_the_run():
    late = copy.deepcopy(GOOD)
    late["inputs"] += [{"time": 600.0, "torque": 99.0}]
    with pytest.raises(SceneError, match=r"torque: got .* @ inputs\[1\]"):
        load_scene(late).build()


@pytest.mark.parametrize("name", ["x" * 20_000, "a\0b", "", "/", "."])
def test_a_name_that_no_file_can_have_is_refused_in_one_line(name):
    with pytest.raises(SceneError, match="neither a file nor a shipped scene") as refused:
        load_scene(name)
    assert len(str(refused.value)) < 600
