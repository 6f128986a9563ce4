"""Courses are sent as steps at a rate, or followed smoothly, and cost is measured against the same motion."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene import load_scene
from ldcs_ros.study import command_rates, sections
from ldcs_ros.study.drive_profiles import DRIVEN, PERIOD, Chamber, DriveProfile, follow, problem, sampled
from ldcs_ros.study.tasks import Task, perform

SHORT = (0.02, 0.04)


def built(name, accuracy=1e-5):
    content, course = problem(name)
    return load_scene({**content, "solver": {"accuracy": accuracy}}).build(), course


def test_a_course_begins_and_ends_softly_at_nothing():
    course = DriveProfile("pressure", 140e3)
    assert course.at(0.0) == course.at(-1.0) == 0.0
    assert course.at(0.5 * PERIOD) == pytest.approx(140e3)
    assert course.at(PERIOD) == pytest.approx(0.0, abs=1e-9)


def test_a_chamber_that_follows_a_course_obeys_its_equation():
    course, delay, h = DriveProfile("pressure", 1.0), 0.02, 1e-4
    chamber = Chamber(course, 0.15, 0.10, delay)
    pressure = 0.0
    for k in range(round(2.0 * PERIOD / h)):
        time = k * h
        assert chamber.at(time + delay) == pytest.approx(pressure, abs=2e-4)
        gap = course.at(time + 0.5 * h) - pressure
        pressure += h * gap / (0.15 if gap > 0.0 else 0.10)
    assert chamber.at(0.5 * delay) == 0.0


@pytest.mark.parametrize("name", DRIVEN)
def test_the_smooth_case_is_what_ever_faster_commands_tend_to(name):
    smooth, course = built(name)
    follow(smooth, course)
    smooth.advance_to(0.3)
    gaps = []
    for rate in (50.0, 200.0):
        stepped, _ = built(name)
        (where,) = sampled(stepped, course, rate, (0.3,))
        gaps.append(np.abs(where - smooth.state.position).max())
    still, _ = built(name)
    still.advance_to(0.3)
    moved = np.abs(smooth.state.position - still.state.position).max()
    assert moved > 20.0 * gaps[1] and gaps[0] > 2.0 * gaps[1]


def test_each_command_is_sent_at_its_time_and_held():
    simulation, course = built("paper")
    sampled(simulation, course, 10.0, (0.25,))
    assert simulation.inputs.torque[0, 0] == pytest.approx(course.at(0.2))


@pytest.mark.timeout(240)  # a busy machine compiles for long
@pytest.mark.skipif(not HAVE_NUMBA, reason="without numba there is no compiled baseline")
def test_a_rate_gives_rows_of_all_solvers_with_their_errors(monkeypatch):
    monkeypatch.setattr(command_rates, "TIMES", SHORT)
    rows = perform(Task("rate", "arc_pushed", 9, "all", "rate", 100.0, 1))
    smooth = perform(Task("rate", "arc_pushed", 9, "all", "rate", 0.0, 1))
    assert [row.method for row in rows] == ["esdirk43", "compiled_rkc2", "scipy_BDF"]
    assert [row.method for row in smooth] == ["esdirk43", "scipy_BDF"]
    assert all(row.failure or row.error <= command_rates.ACCURACY for row in [*rows, *smooth])
    assert rows[0].steps >= 4
    share, row = command_rates.against_smooth([*rows, *smooth])["arc_pushed"][100.0]
    assert share == smooth[0].cpu / rows[0].cpu and row is rows[0]
    assert "| `arc_pushed` | 100 Hz |" in sections.command_rates([*rows, *smooth])[1]


def test_a_rival_that_takes_too_long_is_stopped_and_told(monkeypatch):
    monkeypatch.setattr(command_rates, "TIMES", SHORT)
    monkeypatch.setattr(command_rates, "BDF_BUDGET", 0.0)
    rows = perform(Task("rate", "paper", 9, "all", "rate", 0.0, 1))
    assert rows[1].failure.startswith("too slow: stopped after ")
