"""A course of commands moves a point along its trajectory, within bounds and slew rates."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.reach import Variable, find_course, read_trajectory
from ldcs_ros.reach.least_squares import constrained_least_squares

CONTENT = {
    "lattice": {"size": [0.14, 0.14, 0.01], "nodes": [4, 4], "mass": 0.16},
    "points": {"P1": ["mid", 3, 2]},
    "effects": [
        {"type": "springs", "stiffness": 80.0, "damping": 5.0},
        {"type": "gravity"},
        {"type": "clamp"},
        {"type": "arms", "drive": "pressure", "joint_stiffness": 0.34, "links": 2},
    ],
    "inputs": [{"time": 0.0, "pressure": 100e3}],
}


@pytest.fixture
def trajectory(tmp_path):
    simulation = load_scene(CONTENT).build()
    simulation.settle()
    time = np.linspace(0.0, 0.4, 5)
    rise = 0.002 * (1.0 - np.cos(np.pi * time / 0.4))
    path = tmp_path / "targets.csv"
    rows = [f"{t:.9g},{simulation.pose('P1')[0][2] + z:.9g}" for t, z in zip(time, rise, strict=True)]
    path.write_text("time,P1.z\n" + "\n".join(rows) + "\n")
    return path


def test_a_point_follows_a_trajectory_within_limits(trajectory):
    variables = [Variable(f"pressure.{arm}", 80e3, 180e3, 200e3) for arm in ("left", "right")]
    found = find_course(
        load_scene(CONTENT), read_trajectory(trajectory), variables, interval=0.2, rate=10.0, tolerance=3e-4
    )
    assert found.rms <= 3e-4 < 3e-3 < np.ptp(read_trajectory(trajectory).value)
    for values in found.commands.values():
        assert values[0] == 100e3
        assert values.min() >= 80e3 - 1e-3 and values.max() <= 180e3 + 1e-3
        assert np.abs(np.diff(values) / np.diff(found.time)).max() <= 200e3 * (1.0 + 1e-9)
    # The schedule alone, in a simulation of its own, gives what the result says.
    simulation = load_scene(CONTENT).edited(inputs=list(found.schedule)).build()
    rest = load_scene(CONTENT).build()
    rest.settle()
    simulation.inputs.settle()
    simulation.start_from(rest.state.position, link_angle=rest.state.link_angle)
    simulation.advance_to(0.4)
    assert simulation.pose("P1")[0][2] == pytest.approx(found.reached[-1, 0], abs=1e-5)


def test_the_verb_prints_a_course_and_says_that_slow_commands_do_not_reach(trajectory, tmp_path, capsys):
    scene = tmp_path / "scene.yaml"
    scene.write_text(json.dumps(CONTENT))
    course = tmp_path / "course.csv"
    command = [
        "reach",
        str(scene),
        "--trajectory",
        str(trajectory),
        "--at",
        "0.4",
        "--vary",
        "pressure.*=80e3..180e3",
    ]
    command += [
        "--interval",
        "0.2",
        "--rate",
        "10",
        "--course",
        str(course),
        "-o",
        str(tmp_path / "course.png"),
    ]
    assert main([*command, "--slew", "pressure.*=1e3", "--tolerance", "2e-4", "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["at_limits"] == ["pressure.left", "pressure.right"] and not answer["reached"]
    lines = course.read_text().splitlines()
    assert lines[0] == "time,pressure.left,pressure.right" and len(lines) == 4
    assert (tmp_path / "course.png").stat().st_size > 1000
    assert main([*command, "--slew", "torque.left=1"]) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,P1.z\n0,1\n", "expected time"),
        ("time,P1.q\n0,1\n", "expected time"),
        ("time,P1.z\n1,0\n0,0\n", "rising"),
    ],
)
def test_a_table_that_is_no_trajectory_is_refused(text, words, tmp_path):
    path = tmp_path / "targets.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        read_trajectory(path)


def test_least_squares_with_inequalities_meets_the_conditions_of_the_optimum():
    draw = np.random.default_rng(3)
    matrix, right = draw.normal(size=(9, 5)), draw.normal(size=9)
    limits, bounds = draw.normal(size=(7, 5)), draw.normal(size=7) - 1.0
    x = constrained_least_squares(matrix, right, limits, bounds)
    slack = limits @ x - bounds
    assert slack.min() > -1e-9
    active = slack < 1e-9
    gradient = matrix.T @ (matrix @ x - right)
    multipliers = np.linalg.lstsq(limits[active].T, gradient, rcond=None)[0]
    assert (multipliers > -1e-9).all()
    np.testing.assert_allclose(limits[active].T @ multipliers, gradient, atol=1e-9)
    with pytest.raises(ValueError, match="leave no course"):
        constrained_least_squares(np.eye(1), np.zeros(1), np.array([[1.0], [-1.0]]), np.array([1.0, 1.0]))
