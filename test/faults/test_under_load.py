"""The long runs under load and fault, for seconds, with the requirements of an hour."""

from __future__ import annotations

import json
from pathlib import Path

import load_tables
import pytest
from flood import flood
from full_disk import full_disk
from fuzz import IN_BAGS, fuzz
from joins import joins
from killed import killed
from soak import soak

pytestmark = pytest.mark.timed


def test_a_recorded_run_at_200_hz_loses_no_command_and_no_report_and_replays_to_the_bit(tmp_path):
    run = soak(tmp_path, duration=3.0, again=True)
    assert (run["applied"], run["refused"], run["missed"]) == (run["sent"], 0, 0)
    assert run["commands in the bag"] == run["applied"] + 1  # and the vent at the end
    assert run["reports missing in between"] == 0
    assert run["replays to the bit"]
    assert run["exit status"] == 0


def test_of_a_flood_at_1_khz_every_command_is_applied_or_refused_and_counted(tmp_path):
    run = flood(tmp_path, duration=1.5)
    assert run["missed"] == 0
    assert (run["applied"], run["refused"]) == (run["sent"] // 2, run["sent"] // 2)
    assert run["recorded"] == run["applied"]


def test_a_node_killed_in_a_flood_loses_less_than_a_second_and_nothing_in_between(tmp_path):
    run = killed(tmp_path, duration=1.5)
    assert run["published until [s]"] - run["kept until [s]"] < 1.0
    assert run["kept in order"] and run["commands kept"] > 100
    assert run["same"]


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_the_simulation_goes_on(tmp_path):
    run = full_disk(tmp_path, room=600_000)
    assert run["lines"] == 1
    assert "ldcs recover" in run["message"] and "\n" not in run["message"]
    assert run["went on"] > 0.5
    assert run["messages kept"] > 100
    assert run["exit status"] == 1, "a recording that stopped is no success"


@pytest.mark.slow
def test_subscribers_that_join_and_leave_get_everything_and_leave_nothing_behind(tmp_path):
    run = joins(tmp_path, count=10, at_once=5)
    assert run["heard"] == 10
    assert len(set(run["threads"])) == 1
    assert len(set(run["descriptors"])) == 1


@pytest.mark.slow
def test_random_messages_services_and_parameters_break_and_lose_nothing(tmp_path):
    tally, process, bags = fuzz(tmp_path, seconds=3.0, seed=1)
    assert process == {"alive": True, "exit status": 0, "tracebacks": 0, "grown": process["grown"]}
    assert not tally.wrong_halts and not tally.unanswered
    assert tally.applied + tally.refused.total() + tally.missed == tally.sent.total() > 100
    assert (bags["unreadable"], bags["differing"]) == ([], [])
    assert all(bags["found"][topic] == tally.accepted[topic] for topic in IN_BAGS)


@pytest.mark.parametrize("name", load_tables.TITLES)
def test_every_run_has_its_place_in_the_table_and_its_command(name, tmp_path):
    from under_load import RUNS

    assert name.partition("_")[0] in RUNS
    rows = [load_tables.row("x", 1.23456, "less than 2", True), load_tables.row("y", 3, "2", False)]
    run = {"machine": {"cores": "2"}, "options": {"seconds": 5.0, "seed": 1}, "took": 5.1, "rows": rows}
    load_tables.save(tmp_path, name, run)
    text = (tmp_path / "under_load.md").read_text()
    assert "| x | 1.235 | less than 2 | kept |" in text and "**not kept**" in text


def test_the_page_shows_the_figures_as_they_were_measured():
    docs = Path(__file__).resolve().parents[2] / "docs"
    runs = json.loads((docs / "under_load.json").read_text(encoding="utf-8"))
    assert (docs / "under_load.md").read_text(encoding="utf-8") == load_tables.page(runs)
