"""Commanded pressures are the schedule until a sender takes over, then what is sent, without what the twin refuses."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.bags import Recording, read_bag
from ldcs_ros.bags.recording import Message
from ldcs_ros.messages.cdr import encode, header, message_class
from ldcs_ros.signals.commanded import commanded_pressures

sys.path.insert(0, str(Path(__file__).parents[1] / "replay"))
import rig_bag

SECOND = 1_000_000_000  # ns


def steps(track):
    return np.column_stack([track.time, 1e-3 * track.value])


def test_a_sender_replaces_the_schedule_and_a_refused_command_makes_no_step(tmp_path):
    sent = [(1, [60e3, 90e3]), (2, [math.nan, 0.0]), (3, [1e9]), (4, [1.0, 2.0, 3.0]), (5, [20e3])]
    messages = [("/ldcs/pressure_command", time * SECOND, rig_bag.array(data)) for time, data in sent]
    recording = read_bag(rig_bag.write(tmp_path / "bag", messages))
    scene = load_scene("rig").edited(
        inputs=[{"time": 0.5, "pressure": 30e3}, {"time": 4.5, "pressure": 50e3}]
    )
    tracks = commanded_pressures(recording, scene, 6.0)
    assert list(tracks) == ["left", "right"]
    left = [
        (0.0, 0.0),
        (0.5, 0.0),
        (0.5, 30.0),
        (1.0, 30.0),
        (1.0, 60.0),
        (5.0, 60.0),
        (5.0, 20.0),
        (6.0, 20.0),
    ]
    assert steps(tracks["left"]) == pytest.approx(np.array(left))
    assert steps(tracks["right"])[4] == pytest.approx([1.0, 90.0])


def test_a_scene_without_pressure_drive_has_none(tmp_path):
    recording = read_bag(
        rig_bag.write(tmp_path / "bag", [("/pressure_command", SECOND, rig_bag.array([1.0]))])
    )
    assert commanded_pressures(recording, load_scene("paper"), 2.0) == {}
    assert commanded_pressures(recording, None, 2.0) == {}


def test_a_command_of_one_arm_keeps_the_other_and_one_of_an_unknown_arm_makes_no_step():
    kind = "ldcs_msgs/msg/ArmCommand"
    sent = [
        (1, ["left"], [60e3]),
        (2, ["right"], [40e3]),
        (3, ["middle"], [9e3]),
        (4, [], []),
        (5, ["left"], [math.nan]),
    ]
    messages = [
        Message(
            "/ldcs/arm_command",
            kind,
            encode(
                message_class(kind)(
                    header=header(time * SECOND, ""),
                    sequence=time,
                    arms=arms,
                    pressures=np.array(values),
                    torques=np.zeros(0),
                )
            ),
            time * SECOND,
        )
        for time, arms, values in sent
    ]
    tracks = commanded_pressures(Recording.from_messages(messages), load_scene("rig").edited(inputs=[]), 6.0)
    left = [(0.0, 0.0), (1.0, 0.0), (1.0, 60.0), (2.0, 60.0), (2.0, 60.0), (6.0, 60.0)]
    right = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 40.0), (6.0, 40.0)]
    assert steps(tracks["left"]) == pytest.approx(np.array(left))
    assert steps(tracks["right"]) == pytest.approx(np.array(right))
