"""Commands of a rig act at the right times whatever the clocks of its stamps and of its recorder do."""

from __future__ import annotations

import pytest
from rig_bag import WALL, array, fluid, write

from ldcs_ros.bags import read_bag
from ldcs_ros.errors import RecordingError
from ldcs_ros.identify.experiments import read_experiment
from ldcs_ros.messages.cdr import decode
from ldcs_ros.replay.session import Changes, replay
from ldcs_ros.replay.span import check_span
from ldcs_ros.signals.mapping import parse_mapping

SECOND = 10**9
COMMAND = {"topic": "/l", "to": "pressure_command", "arms": ["left"]}


def fed(tmp_path, scene, messages, **options):
    """Return (time [s], pressure of the left arm [kPa]) of each command that a replay applied, and its report."""
    source = write(
        tmp_path / "rig", [("/l", log, fluid(stamp, 101325.0 + 1e3 * kpa)) for log, stamp, kpa in messages]
    )
    mapping = parse_mapping({"commands": [COMMAND], "initial": "start", **options})
    done = replay(source, tmp_path / "twin", changes=Changes(scene=scene), mapping=mapping)
    applied = [
        (round(message.time / 1e9, 6), round(decode(message.type, message.cdr).data[0] / 1e3))
        for message in read_bag(tmp_path / "twin").channels["/ldcs/pressure_command"].raw
    ]
    return applied, done.reports[0]


@pytest.mark.parametrize("time", ["log", "stamp"])
@pytest.mark.parametrize("stamp", [lambda log: WALL - 5 * SECOND, lambda log: log // SECOND * SECOND])
def test_commands_of_one_stamp_and_one_content_are_all_applied(tmp_path, pneumatic, time, stamp):
    period = SECOND // 10
    logs = [WALL // SECOND * SECOND + k * period for k in range(5)]
    sent = [(log, stamp(log), kpa) for log, kpa in zip(logs, (20, 60, 20, 60, 20), strict=True)]
    applied, _ = fed(tmp_path, pneumatic, sent, time=time)
    assert applied == [(round(0.1 * k, 6), kpa) for k, kpa in enumerate((20, 60, 20, 60, 20))]


def test_one_stamp_that_was_not_set_moves_no_command(tmp_path, pneumatic):
    sent = [(WALL + k * SECOND // 100, k * SECOND // 100, 20 if k < 10 else 50) for k in range(30)]
    applied, report = fed(tmp_path, pneumatic, sent, time="stamp")
    assert applied == [(0.0, 20), (0.1, 50)]
    assert (report.unstamped, report.out_of_order, report.late) == (1, 0, 0)


def test_a_clock_that_is_set_moves_no_command(tmp_path, pneumatic):
    sent = [
        (WALL + k * SECOND // 100, k * SECOND // 100 + (5 * SECOND if k < 20 else WALL), 20 if k < 10 else 50)
        for k in range(40)
    ]
    applied, report = fed(tmp_path, pneumatic, sent, time="stamp")
    assert applied == [(0.0, 20), (0.1, 50)]
    assert report.clock_steps == (pytest.approx((WALL - 5 * SECOND) / SECOND),)


def test_a_first_log_time_of_zero_is_refused_before_the_run(tmp_path, pneumatic):
    sent = [(0, WALL, 20), *((WALL + k * SECOND // 10, WALL, 50) for k in range(5))]
    with pytest.raises(
        RecordingError, match=r"spans 56.7 years, but is silent for 56.7 years after its first 0.000 s"
    ):
        fed(tmp_path, pneumatic, sent)
    assert not (tmp_path / "twin").exists()


def test_identification_refuses_a_bag_that_spans_years_too(tmp_path, pneumatic):
    source = write(tmp_path / "rig", [("/l", log, fluid(log, 101325.0)) for log in (0, WALL, WALL + SECOND)])
    mapping = parse_mapping({"commands": [COMMAND], "measurements": [{"topic": "/l", "to": "left/pressure"}]})
    with pytest.raises(RecordingError, match=r"spans 56\.7 years"):
        read_experiment(source, pneumatic, mapping=mapping)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_span_of_a_long_bag_is_known_without_its_messages(tmp_path, storage, monkeypatch):
    # Ten minutes, whose messages fill several chunks of MCAP.
    padded = array([0.0] * 1000)
    sent = [("/p", WALL + k * SECOND, padded) for k in range(600)]
    recording = read_bag(write(tmp_path / "whole", sent, storage=storage))
    broken = read_bag(write(tmp_path / "broken", [("/p", SECOND, padded), *sent], storage=storage))
    with monkeypatch.context() as patch:
        patch.setattr(type(recording), "in_order", lambda *_: pytest.fail("messages are read"))
        check_span(recording)
    with pytest.raises(RecordingError, match="is silent for 5"):
        check_span(broken)


@pytest.mark.parametrize(
    ("messages", "taken"),
    [
        ([array([float("nan")]), array([9e9])], False),
        ([("std_msgs/msg/Float64MultiArray", b"\0\1\0\0\xff")] * 3, False),
        ([array([1.0, 2.0, 3.0])] * 2, False),
        ([array([9e9]), array([0.0])], True),
    ],
)
def test_a_replay_says_whether_any_command_was_taken(tmp_path, pneumatic, messages, taken):
    source = write(tmp_path / "rig", [("/p", WALL + k * SECOND // 50, one) for k, one in enumerate(messages)])
    mapping = parse_mapping({"commands": [{"topic": "/p", "to": "pressure_command"}], "initial": "start"})
    done = replay(source, tmp_path / "twin", changes=Changes(scene=pneumatic), mapping=mapping)
    assert done.took_no_command is not taken
