"""Inverse statics recovers commands, proves the nearest point where a target is out of reach, and lists solutions."""

from __future__ import annotations

import json

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.reach import TargetCoordinate, Variable, reach

CONTENT = small_sheet(
    {"type": "payload", "at": "P1", "mass": 0.04},
    points={"P0": ["mid", 2, 2], "P1": ["mid", 4, 2], "P2": ["mid", 4, 4]},
)
BOTH = [Variable("pressure.left", 0.0, 190e3), Variable("pressure.right", 0.0, 190e3)]


@pytest.fixture(scope="module")
def simulation():
    simulation = load_scene(CONTENT).build()
    simulation.settle()
    return simulation


def places(pressures):
    simulation = load_scene(CONTENT).build()
    simulation.inputs.set_pressure(pressures)
    simulation.settle()
    return {name: simulation.pose(name)[0] for name in ("P0", "P1", "P2")}


@pytest.mark.parametrize("pressures", [(100e3, 120e3), (20e3, 60e3), (185e3, 140e3)])
def test_reachable_targets_give_back_the_commands(simulation, pressures):
    at = places(pressures)
    targets = [TargetCoordinate("P1", "z", at["P1"][2]), TargetCoordinate("P2", "z", at["P2"][2])]
    best = reach(simulation, targets, BOTH)[0]
    np.testing.assert_allclose(list(best.commands.values()), pressures, rtol=1e-3)
    assert best.distance < 1e-9 and best.stable and not best.at_bounds
    # The commands that were found give the point in the twin itself.
    again = places(list(best.commands.values()))
    assert abs(again["P1"][2] - at["P1"][2]) < 1e-8


def test_out_of_reach_the_nearest_point_is_proved_by_its_slopes(simulation):
    best = reach(simulation, [TargetCoordinate("P1", "z", 0.15)], BOTH)[0]
    assert best.at_bounds == ("pressure.left", "pressure.right") and best.optimality == 0.0
    highest = places((190e3, 190e3))["P1"][2]
    assert best.reached["P1.z"] == pytest.approx(highest, abs=1e-8)
    assert best.distance == pytest.approx(0.15 - highest, abs=1e-8)


def test_inside_the_bounds_the_nearest_point_has_no_way_down(simulation):
    # Two coordinates and one command: the distance is stationary.
    targets = [TargetCoordinate("P1", "z", 0.005), TargetCoordinate("P1", "x", 0.134)]
    best = reach(simulation, targets, [BOTH[0]])[0]
    assert not best.at_bounds and best.optimality < 1e-9
    around = []
    for factor in (0.99, 1.01):
        at = places((best.commands["pressure.left"] * factor, 0.0))["P1"]
        around.append(np.hypot(at[2] - 0.005, at[0] - 0.134))
    assert min(around) > best.distance


def test_far_out_of_reach_few_steps_lead_to_the_nearest_point(simulation):
    # What remains is long and the sheet bends away from it: steps by slopes alone do not end in 60.
    targets = [TargetCoordinate("P1", axis, x) for axis, x in zip("xyz", (0.15, -0.02, 0.02), strict=True)]
    best = reach(simulation, targets, BOTH)[0]
    assert best.distance > 0.02 and best.optimality < 1e-9 and not best.at_bounds and best.steps <= 30


def test_a_weight_draws_the_nearest_point_to_its_target(simulation):
    def apart(weight):
        targets = [TargetCoordinate("P1", "z", 0.005, weight), TargetCoordinate("P1", "x", 0.134)]
        best = reach(simulation, targets, [BOTH[0]])[0]
        return abs(best.reached["P1.z"] - 0.005)

    assert apart(10.0) < 0.5 * apart(1.0)


def test_other_starts_list_other_solutions_once(simulation):
    # One height and two pressures: every start finds a pair of its own, equal ones are listed once.
    found = reach(simulation, [TargetCoordinate("P1", "z", 0.02)], BOTH, starts=4)
    assert 2 <= len(found) <= 4 and all(one.distance < 1e-8 for one in found)
    same = reach(simulation, [TargetCoordinate("P1", "z", 0.15)], BOTH, starts=4)
    assert len(same) == 1


@pytest.mark.parametrize(
    ("targets", "variables", "words"),
    [
        ([], BOTH, "at least one target"),
        ([TargetCoordinate("P9", "z", 0.0)], BOTH, "expected a point"),
        ([TargetCoordinate("P1", "z", 0.0)], [Variable("pressure.up", 0.0, 1.0)], "expected a command"),
        ([TargetCoordinate("P1", "z", 0.0)], [Variable("pressure.left", 2.0, 1.0)], "lower bound first"),
    ],
)
def test_unknown_names_and_bounds_are_refused(simulation, targets, variables, words):
    with pytest.raises(ValueError, match=words):
        reach(simulation, targets, variables)


@pytest.fixture
def scene_file(tmp_path):
    import yaml

    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(CONTENT))
    return str(path)


def test_the_verb_prints_commands_under_their_names(scene_file, tmp_path, capsys):
    wanted = places((100e3, 100e3))["P1"][2]
    words = ["reach", scene_file, "--target", f"P1.z={wanted}"]
    vary = ["--vary", "pressure.left=0..190e3", "--vary", "pressure.right=0..190e3"]
    assert main([*words, *vary, "--json", "-o", str(tmp_path / "reached.png")]) == 0
    found = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(
        [found["commands"][name] for name in ("pressure.left", "pressure.right")], 100e3, rtol=1e-3
    )
    assert found["reached"] is True and (tmp_path / "reached.png").stat().st_size > 10_000
    assert main(["reach", scene_file, "--target", "P1.z=0.15", *vary]) == 1
    assert "held by bounds" in capsys.readouterr().out


def test_the_bag_of_the_verb_holds_the_rest_state_under_its_commands(scene_file, tmp_path, capsys):
    words = ["reach", scene_file, "--target", "P1.z=0.02", "--target", "P2.z=0.03"]
    bag = tmp_path / "rest"
    assert main([*words, "--vary", "pressure.*=0..190e3", "--json", "--bag", str(bag)]) in (0, 1)
    found = json.loads(capsys.readouterr().out)
    assert main(["export", str(bag), "-o", str(tmp_path / "rest.csv"), "--json"]) == 0
    header, row, *_ = (tmp_path / "rest.csv").read_text().splitlines()
    held = dict(zip(header.split(","), row.split(","), strict=True))
    for place, z in found["coordinates"].items():
        assert float(held[f"{place} [m]"]) == pytest.approx(z, abs=1e-8)
    for name, value in found["commands"].items():
        assert float(held[name.replace("pressure", "pressure_command") + " [Pa]"]) == pytest.approx(value)
    capsys.readouterr()
    assert main(["replay", str(bag), "--bag", str(tmp_path / "again"), "--json"]) == 0
    # A folder that exists is not overwritten.
    assert main([*words, "--vary", "pressure.*=0..190e3", "--bag", str(bag)]) == 2


@pytest.mark.parametrize(
    "words",
    [
        ["--target", "P1.w=0.1", "--vary", "pressure.left=0..1"],
        ["--target", "P1.z=0.1", "--vary", "pressure.left=0"],
        ["--target", "P1.z=0.1", "--vary", "pressure.up=0..1"],
    ],
)
def test_the_verb_refuses_what_it_cannot_read(scene_file, words, capsys):
    assert main(["reach", scene_file, *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_sensitivity_verb_prints_a_table_and_a_picture(scene_file, tmp_path, capsys):
    words = ["sensitivity", scene_file, "--of", "P1", "--to", "pressure.left", "effects.payload.mass"]
    assert main([*words, "-o", str(tmp_path / "bars.png")]) == 0
    out = capsys.readouterr().out
    assert "pressure.left" in out and "m/(kg)" in out and (tmp_path / "bars.png").stat().st_size > 5_000
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rows"] == ["P1.x", "P1.y", "P1.z"] and len(found["values"][0]) == 2
    assert main(["sensitivity", scene_file, "--of", "P9", "--to", "pressure.left"]) == 2
