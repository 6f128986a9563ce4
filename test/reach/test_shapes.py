"""Shapes of the whole sheet: heights and slopes are right, known shapes give back their pressures, files are read."""

from __future__ import annotations

import json

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.reach import Variable, free_arms, reach, shape_target, workspace

CONTENT = small_sheet()
BOTH = [Variable("pressure.left", 0.0, 190e3), Variable("pressure.right", 0.0, 190e3)]


@pytest.fixture(scope="module")
def simulation():
    simulation = load_scene(CONTENT).build()
    simulation.settle()
    return simulation


def middle(pressures):
    """Return the middle of the sheet at rest, shape (5, 5, 3)."""
    simulation = load_scene(CONTENT).build()
    simulation.inputs.set_pressure(pressures)
    simulation.settle()
    return simulation.state.position.reshape(2, 5, 5, 3).mean(axis=0)


def write(path, columns, rows):
    path.write_text("\n".join([columns, *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return str(path)


TEXTS = (
    "sphere:radius=0.4",
    "sphere:radius=-0.4,z=0.01",
    "cylinder:radius=0.3,axis=x",
    "saddle:radius=0.5,x=0.05,z=0",
    "sine:amplitude=0.01,length=0.1,axis=y",
)


@pytest.mark.parametrize("text", TEXTS)
def test_slopes_of_the_residual_are_its_differences(text, simulation):
    shape = shape_target(text, simulation.lattice)
    draw = np.random.default_rng(1)
    q = simulation.operating_point().q
    move = draw.normal(size=q.shape)
    step = 1e-6
    by_hand = (shape.residual(q + step * move) - shape.residual(q - step * move)) / (2 * step)
    np.testing.assert_allclose(shape.slope(q, move[:, None])[:, 0], by_hand, atol=1e-7)
    assert np.isclose(np.linalg.norm(shape.residual(q)), np.sqrt(np.mean(shape.error(q) ** 2)))


def test_a_dome_falls_away_from_its_middle_and_a_bowl_rises(simulation):
    x, y = np.array([0.07, 0.11]), np.zeros(2)
    for sign in (1.0, -1.0):
        height, slope, _ = shape_target(f"sphere:radius={0.3 * sign}", simulation.lattice).height(x, y)
        assert height[0] == pytest.approx(0.0) and sign * height[1] < 0.0 and sign * slope[1] < 0.0
        assert abs(height[1]) == pytest.approx(0.3 - np.sqrt(0.3**2 - 0.04**2))


@pytest.mark.parametrize("columns", ["i,j,z", "x,y,z"])
def test_a_shape_that_the_sheet_takes_gives_back_its_pressures(columns, simulation, tmp_path):
    pressures = (100e3, 140e3)
    sheet = middle(pressures)
    if columns == "i,j,z":
        rows = [[i, j, float(sheet[i, j, 2])] for i in range(5) for j in range(5)]
    else:
        rows = sheet.reshape(-1, 3).tolist()
    shape = shape_target(write(tmp_path / "mould.csv", columns, rows), simulation.lattice)
    best = reach(simulation, [], BOTH, shape=shape)[0]
    # Points of a surface are joined by a spline; between them it is not the sheet to the last digit.
    near = 1e-3 if columns == "i,j,z" else 2e-2
    np.testing.assert_allclose(list(best.commands.values()), pressures, rtol=near)
    assert best.distance < (1e-9 if columns == "i,j,z" else 1e-4)


def test_a_free_height_is_the_best_one(simulation, tmp_path):
    sheet = middle((100e3, 100e3))
    rows = [[i, j, float(sheet[i, j, 2]) + 0.03] for i in range(5) for j in range(5)]
    path = write(tmp_path / "high.csv", "i,j,z", rows)
    free = reach(simulation, [], BOTH, shape=shape_target(f"{path}:z=free", simulation.lattice))[0]
    lowered = reach(simulation, [], BOTH, shape=shape_target(f"{path}:z=-0.03", simulation.lattice))[0]
    assert free.distance < 1e-9 and lowered.distance < 1e-9
    assert reach(simulation, [], BOTH, shape=shape_target(path, simulation.lattice))[0].distance > 1e-3


def test_places_without_weight_do_not_count(simulation, tmp_path):
    sheet = middle((60e3, 90e3))
    rows = [[i, j, float(sheet[i, j, 2]) if i > 2 else 9.0, float(i > 2)] for i in range(5) for j in range(5)]
    shape = shape_target(write(tmp_path / "tip.csv", "i,j,z,weight", rows), simulation.lattice)
    assert len(shape.nodes) == 10 and reach(simulation, [], BOTH, shape=shape)[0].distance < 1e-9


def test_free_joints_come_nearer_than_any_pressures(simulation):
    shape = shape_target("sine:amplitude=0.01,length=0.14", simulation.lattice)
    found = reach(simulation, [], BOTH, shape=shape)
    bound = free_arms(simulation, [], BOTH, found, shape=shape)
    assert bound.distance < 0.9 * found[0].distance and len(bound.commands) == len(simulation.joint_names)
    # More starts never make it worse.
    assert free_arms(simulation, [], BOTH, found, shape=shape, starts=3).distance <= bound.distance + 1e-12


def test_one_torque_at_all_joints_is_as_good_as_the_pressure(simulation):
    # The bound begins at the solution: where nothing is left to gain it ends there.
    sheet = middle((100e3, 140e3))
    from ldcs_ros.reach import TargetCoordinate

    targets = [TargetCoordinate("P1", "z", float(sheet[4, 2, 2]))]
    bound = free_arms(simulation, targets, BOTH, reach(simulation, targets, BOTH))
    assert bound.distance < 1e-8 and bound.steps <= 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cube:radius=1", "expected sphere"),
        ("sphere", "expected radius"),
        ("sphere:radius=0.01", "farthest node"),
        ("sphere:radius=1,depth=2", "expected radius, x, y, z"),
        ("cylinder:radius=1,axis=z", "axis"),
        ("sine:amplitude=0.1,length=0", "wave length"),
        ("saddle:radius=1,radius=2", "each key once"),
        ("saddle:radius=wide", "finite number"),
    ],
)
def test_unknown_shapes_are_refused(text, words, simulation):
    with pytest.raises(ValueError, match=words):
        shape_target(text, simulation.lattice)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "columns"),
        ("a,b,c\n1,2,3\n", "columns"),
        ("i,j,z\n", "at least one row"),
        ("i,j,z\n1,2\n", "3 finite numbers"),
        ("i,j,z\n9,0,0.1\n", "got node"),
        ("i,j,z\n1,0,0.1\n1,0,0.2\n", "each once"),
        ("x,y,z\n0,0,0.1\n1,1,0.1\n2,2,0.1\n", "span a plane"),
        ("x,y,z\n5,5,0\n6,5,0\n5,6,0\n", "around the sheet"),
        ("i,j,z,weight\n1,0,0.1,-1\n", "weights"),
    ],
)
def test_files_that_are_no_shape_are_refused(text, words, simulation, tmp_path):
    path = tmp_path / "shape.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        shape_target(str(path), simulation.lattice)


def test_the_workspace_holds_the_rest_states_of_its_commands(simulation):
    found = workspace(simulation, "P1", BOTH)
    assert found.levels == 15 and found.position.shape == (15, 15, 3) and found.failed == 0
    np.testing.assert_allclose(found.position[0, 14], middle((0.0, 190e3))[4, 2], atol=1e-8)
    np.testing.assert_allclose(found.position[7, 7], middle((95e3, 95e3))[4, 2], atol=1e-8)
    # Neighbours differ by little: the branch was followed.
    assert np.abs(np.diff(found.position, axis=0)).max() < 0.02


@pytest.fixture
def scene_file(tmp_path):
    import yaml

    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(CONTENT))
    return str(path)


def test_the_verb_prints_the_rms_and_the_bound_of_a_shape(scene_file, tmp_path, capsys):
    words = [
        "reach",
        scene_file,
        "--shape",
        "cylinder:radius=-0.2",
        "--vary",
        "pressure.*=0..190e3",
        "--bound",
    ]
    assert main([*words, "--json", "-o", str(tmp_path / "shape.png"), "--tolerance", "0.05"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert 0.0 < found["bound"] < found["distance"] <= found["largest_shape_error"]
    assert set(found["commands"]) == {"pressure.left", "pressure.right"}
    assert (tmp_path / "shape.png").stat().st_size > 10_000
    assert main(words) == 1
    out = capsys.readouterr().out
    assert "RMS" in out and "free joints" in out


def test_the_verb_draws_the_workspace_of_a_point(scene_file, tmp_path, capsys):
    words = ["reach", scene_file, "--workspace", "P1", "--vary", "pressure.*=0..190e3"]
    assert main([*words, "-o", str(tmp_path / "work.png"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["positions"]) == 225 and found["low"][2] < found["high"][2]
    assert (tmp_path / "work.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["--workspace", "P1", "--target", "P1.z=0.1"],
        ["--workspace", "P9"],
        ["--shape", "missing.csv"],
        ["--shape", "cube"],
    ],
)
def test_the_verb_refuses_what_it_cannot_do(words, scene_file, capsys):
    assert main(["reach", scene_file, *words, "--vary", "pressure.*=0..190e3"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
