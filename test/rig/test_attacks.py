"""A selection of the attacks of `make attack`: the bridge as a process against hostile devices, one event each."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")
sys.path.insert(0, str(Path(__file__).parents[2] / "tools" / "attack"))

from attack_run import Run
from events import events
from random_answers import random_lines, random_modbus

pytestmark = pytest.mark.timed

SELECTION = [event for event in events() if event.quick]
# What these try has a quicker sibling here or in test_bridge_and_rig_as_processes.py.
SLOW = ("SIGINT to the node", "2000 commands before arm, none after", "one answer: five registers")


@pytest.mark.timeout(120)
@pytest.mark.parametrize(
    "event",
    [pytest.param(event, marks=pytest.mark.slow if event.what in SLOW else ()) for event in SELECTION],
    ids=lambda event: f"{event.transport}, {event.phase}: {event.what}",
)
def test_no_event_leaves_a_chamber_under_pressure(event, tmp_path):
    domain = 10 + (os.getpid() * 13 + SELECTION.index(event)) % 220
    row = Run(event, tmp_path, domain).measure()
    assert row.safe, f"{row.faults}\n{(tmp_path / 'terminal.txt').read_text()}"


def test_random_modbus_answers_end_no_stage():
    assert random_modbus(1500) > 500


def test_random_serial_lines_end_no_stage():
    assert random_lines(3000) >= 3000


def test_of_the_selection_each_transport_is_attacked_by_default():
    assert {event.what for event in SELECTION} > set(SLOW)
    assert {event.transport for event in SELECTION if event.what not in SLOW} == {
        "modbus",
        "serial",
        "topics",
    }


def test_the_table_has_more_than_sixty_events_over_three_transports():
    every = events()
    assert len({(event.transport, event.phase, event.what) for event in every}) == len(every) > 60
    assert {event.transport for event in every} == {"modbus", "serial", "topics"}
