"""Nothing that a scene does not name is built: no effect, no coordinate, no import."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from ldcs_ros import load_scene
from ldcs_ros.physics.effects import EFFECTS

PROGRAM = """
import json, sys
from ldcs_ros import load_scene
simulation = load_scene(json.loads(sys.argv[1])).build()
simulation.advance_to(0.05)
print(json.dumps({"modules": sorted(sys.modules), "effects": simulation.effects}))
"""
SHEET = {"size": [0.14, 0.14, 0.01], "nodes": [5, 5], "mass": 0.16}
# Compiled stages, the errors that they carry, and steps under commands are ten modules more than effects one by one.
MOST_MODULES, MOST_COMPILED = 65, 75
FOREIGN = ("rclpy", "rosbags", "mcap", "matplotlib")


def _run(effects):
    scene = {"lattice": SHEET, "points": {"P1": ["mid", "free_edge"]}, "effects": effects}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(scene)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    "effects",
    [
        [{"type": "springs"}, {"type": "clamp"}],
        [{"type": "springs", "law": "axiswise"}, {"type": "gravity"}, {"type": "clamp"}],
        [{"type": "springs"}, {"type": "clamp"}, {"type": "arms"}],
        [
            {"type": "springs"},
            {"type": "payload", "at": "P1", "mass": 0.04},
            {"type": "floor", "height": -0.1},
        ],
    ],
    ids=lambda effects: "+".join(effect["type"] for effect in effects),
)
def test_a_run_imports_the_named_effects_and_no_other(effects):
    names = [effect["type"] for effect in effects]
    report = _run(effects)
    prefix = "ldcs_ros.physics.effects."
    loaded = {module.removeprefix(prefix) for module in report["modules"] if module.startswith(prefix)}
    assert report["effects"] == names
    assert loaded - {"base"} == set(names)
    # 5 x 5 nodes have banded factors, and no material.
    unused = {
        "physics.corotational",
        "physics.material",
        "integrators.implicit.nested_dissection",
        "simulation.equilibrium",
        "simulation.verification",
    }
    # The compiled force has loops for all effects, over empty tables of those that a scene does not name.
    if effects[0].get("law") == "axiswise":
        # These springs do not turn with the sheet, and the compiled force does not know them.
        unused |= {"physics.column_frames", "physics.arm", "physics.kernels.total_force"}
    assert not {f"ldcs_ros.{module}" for module in unused} & set(report["modules"])
    # The whole package has some 400 modules.
    most = MOST_MODULES if "physics.kernels.total_force" in unused else MOST_COMPILED
    assert len([module for module in report["modules"] if module.startswith("ldcs_ros")]) < most
    assert not [module for module in report["modules"] if module.split(".")[0] in FOREIGN]


def _build(*names, **keys):
    blocks = {"clamp": {}, "springs": {}, "gravity": {}, "wrench": {}, "arms": keys}
    return load_scene(
        {"lattice": SHEET, "effects": [{"type": name, **blocks[name]} for name in names]}
    ).build()


def test_the_state_is_as_long_as_the_scene_needs():
    free = _build("springs")
    clamped = _build("springs", "clamp")
    assert len(free.model.free) == free.model.n_coordinates == 3 * 50
    assert len(clamped.model.free) == 3 * (50 - 10)
    assert free.state.link_angle.size == free.state.pressure.size == 0
    torque, pressure = _build("springs", "arms", drive="torque"), _build("springs", "arms", drive="pressure")
    assert torque.model.n_coordinates == 3 * 50 + 8
    assert torque.state.link_angle.shape == (2, 4) and torque.state.pressure.size == 0
    assert pressure.state.pressure.shape == (2,)
    # A prescribed arm has no degree of freedom.
    assert len(_build("springs", "arms", drive="curvature").model.free) == 3 * 50


def test_a_term_stands_for_each_named_effect_and_nothing_else():
    names = ("springs", "gravity", "clamp", "wrench")
    simulation = _build(*names)
    assert tuple(term.name for term in simulation.model.terms) == simulation.effects == names


def test_a_term_is_called_only_where_it_has_a_force(monkeypatch):
    simulation = _build("springs", "gravity", "clamp", "wrench")
    simulation.integrator.call_effects_one_by_one()
    calls = dict.fromkeys(simulation.effects, 0)
    for term in simulation.model.terms:

        def counted(*arguments, name=term.name, add_force=term.add_force):
            calls[name] += 1
            add_force(*arguments)

        monkeypatch.setattr(term, "add_force", counted)
    simulation.advance_to(0.05)
    assert calls["clamp"] == calls["wrench"] == 0
    assert calls["springs"] == calls["gravity"] > 10
    simulation.inputs.set_wrench("node_top_4_4", force=(0.0, 0.0, 0.1))
    before = calls["springs"]
    simulation.advance_to(0.1)
    # The jump of a command asks the wrench alone.
    assert 0 < calls["springs"] - before <= calls["wrench"]
    assert calls["clamp"] == 0


def test_the_table_of_effects_is_imported_by_name_only():
    assert all(isinstance(home, str) and ":" in home for home in EFFECTS.values())


@pytest.mark.parametrize("name", ["arc", "paper", "free_flight"])
def test_statistics_count_every_force_call(name, monkeypatch):
    simulation = load_scene(name).build()
    # The compiled stages take as many: test_compiled_stages.
    simulation.integrator.call_effects_one_by_one()
    calls = 0
    force = simulation.model.force

    def counted(*arguments):
        nonlocal calls
        calls += 1
        return force(*arguments)

    monkeypatch.setattr(simulation.model, "force", counted)
    before = simulation.statistics.evaluations
    simulation.advance_to(0.3)
    # The start is evaluated before the first step, and counted with it.
    assert abs(simulation.statistics.evaluations - before - calls) <= 1
