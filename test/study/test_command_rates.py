"""Drive profiles are sent as steps at a rate, or followed smoothly; cost is measured against the same motion."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.scene import load_scene
from ldcs_ros.study import command_rates, report
from ldcs_ros.study.drive_profiles import (
    DRIVEN,
    PERIOD,
    Chamber,
    DriveProfile,
    drive_problem,
    follow,
    sampled,
)
from ldcs_ros.study.rows import Task
from ldcs_ros.study.tasks import perform

SHORT = (0.02, 0.04)


def built(name, accuracy=1e-5):
    content, profile = drive_problem(name)
    return load_scene({**content, "solver": {"accuracy": accuracy}}).build(), profile


def test_a_profile_begins_and_ends_softly_at_nothing():
    profile = DriveProfile("pressure", 140e3)
    assert profile.at(0.0) == profile.at(-1.0) == 0.0
    assert profile.at(0.5 * PERIOD) == pytest.approx(140e3)
    assert profile.at(PERIOD) == pytest.approx(0.0, abs=1e-9)


def test_a_chamber_that_follows_a_profile_obeys_its_equation():
    profile, delay, h = DriveProfile("pressure", 1.0), 0.02, 1e-4
    chamber = Chamber(profile, 0.15, 0.10, delay)
    pressure = 0.0
    for k in range(round(2.0 * PERIOD / h)):
        time = k * h
        assert chamber.at(time + delay) == pytest.approx(pressure, abs=2e-4)
        gap = profile.at(time + 0.5 * h) - pressure
        pressure += h * gap / (0.15 if gap > 0.0 else 0.10)
    assert chamber.at(0.5 * delay) == 0.0


@pytest.mark.parametrize("name", DRIVEN)
def test_ever_faster_commands_tend_to_the_smooth_case(name):
    smooth, profile = built(name)
    follow(smooth, profile)
    smooth.advance_to(0.3)
    gaps = []
    for rate in (50.0, 200.0):
        stepped, _ = built(name)
        (where,) = sampled(stepped, profile, rate, (0.3,))
        gaps.append(np.abs(where - smooth.state.position).max())
    still, _ = built(name)
    still.advance_to(0.3)
    moved = np.abs(smooth.state.position - still.state.position).max()
    assert moved > 20.0 * gaps[1] and gaps[0] > 2.0 * gaps[1]


def test_each_command_is_sent_at_its_time_and_held():
    simulation, profile = built("paper")
    sampled(simulation, profile, 10.0, (0.25,))
    assert simulation.inputs.torque[0, 0] == pytest.approx(profile.at(0.2))


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
    cost = command_rates.rate_costs([*rows, *smooth])["arc_pushed", 100.0]
    assert cost.speed == smooth[0].cpu / rows[0].cpu and cost.row is rows[0]
    assert list(cost.others) == [row.method for row in rows]
    assert "| `arc_pushed` | 100 Hz |" in list(report.command_rate_section([*rows, *smooth]))[1]


def test_a_competitor_that_takes_too_long_is_stopped_with_the_reason(monkeypatch):
    monkeypatch.setattr(command_rates, "TIMES", SHORT)
    monkeypatch.setattr(command_rates, "BDF_BUDGET", 0.0)
    rows = perform(Task("rate", "paper", 9, "all", "rate", 0.0, 1))
    assert rows[1].failure.startswith("too slow: stopped after ")
