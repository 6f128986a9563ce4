"""The output process' parts without a process: socket, serial lines, the end of a stage, the bridge's estimate."""

from __future__ import annotations

import socket
from types import SimpleNamespace

import numpy as np
import pytest

from ldcs_ros.errors import BridgeError
from ldcs_ros.messages.cdr import decode
from ldcs_ros.rig import state_estimator
from ldcs_ros.rig.clocks import ClockEstimate
from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.process import MessageSocket
from ldcs_ros.rig.output.serial_line import SerialDevice, SerialSettings
from ldcs_ros.rig.output.stage import OutputStage, OutputStatus
from ldcs_ros.rig.output.topics import TopicDevice
from ldcs_ros.rig.reading import RawReading
from ldcs_ros.rig.rig_file import load_rig
from ldcs_ros.rig.units import PressureUnit

pytestmark = pytest.mark.timed

PRESSURES = "std_msgs/msg/Float64MultiArray"


def test_a_socket_that_nobody_reads_drops_whole_messages_and_mixes_none():
    ours, theirs = socket.socketpair()
    sender, receiver = MessageSocket(ours), MessageSocket(theirs)
    for number in range(40):
        sender.send({"number": number, "padding": "x" * 100_000})
    heard = receiver.receive()
    while sender._pending:
        sender._flush()
        heard += receiver.receive()
    heard += receiver.receive()
    numbers = [message["number"] for message in heard]
    assert numbers[0] == 0 and numbers == sorted(set(numbers)) and len(numbers) < 40
    assert all(len(message["padding"]) == 100_000 for message in heard)
    # After the backlog the next message goes through; a closed side is noticed.
    sender.send({"number": 99})
    assert [message["number"] for message in receiver.receive()] == [99]
    sender.close()
    assert receiver.receive() == [] and receiver.lost


def test_stamps_of_a_serial_line_are_milliseconds_and_answers_belong_to_their_questions(clock):
    device = SerialDevice(SerialSettings("none", unit=PressureUnit("mbar")), ("left", "right"), clock)
    device.clock = clock
    device._line((12e3, 34e3))
    clock.pass_time(0.02)
    device._take(["A", "1", "2500"])
    device._take(["S", "7", "2510", "120", "340", "119", "338"])
    readings, _, round_trips, answers = device.take()
    assert round_trips == [(100.0, 2.5, pytest.approx(100.02))] and answers == [""]
    assert [(one.kind, one.arm, one.value, pytest.approx(one.stamp)) for one in readings] == [
        ("pressure_command", "left", pytest.approx(12e3), 2.51),
        ("pressure", "left", pytest.approx(11.9e3), 2.51),
        ("pressure_command", "right", pytest.approx(34e3), 2.51),
        ("pressure", "right", pytest.approx(33.8e3), 2.51),
    ]


def test_a_serial_line_that_cannot_be_opened_is_a_broken_connection(clock):
    device = SerialDevice(SerialSettings("/dev/none\0"), ("left", "right"), clock)
    stage = OutputStage(device, Limits(), clock, commands=False)
    stage.step()
    status = stage.exchange().status
    assert not status.connected and "cannot open the serial line" in status.error


def test_a_stage_ends_with_its_patience_where_no_zero_is_confirmed(clock):
    written = []
    device = TopicDevice(written.append, PressureUnit(), clock, rate=100.0, reads_back=True)
    stage = OutputStage(device, Limits(), clock, commands=True)
    stage.set_target([5e3, 5e3], 1, clock())
    stage.step()
    stage.end("test", 0.5)
    for _ in range(49):
        clock.pass_time(0.01)
        stage.step()
    assert not stage.ended and written[-1] == [0.0, 0.0]
    clock.pass_time(0.02)
    stage.step()
    assert stage.ended and not stage.confirmed
    # A target after the end changes nothing.
    stage.set_target([5e3, 5e3], 2, clock())
    assert stage.limiter.epoch == 1


def test_a_new_status_counts_from_zero():
    status = OutputStatus()
    assert (status.drops, status.malformed, status.heartbeats, status.refusals, status.clipped) == (0,) * 5
    assert not (status.ready or status.connected or status.zero_confirmed)


def test_one_message_from_the_past_is_late_and_two_are_a_clock_that_was_set_back():
    clock = ClockEstimate()
    for k in range(20):
        assert clock.one_way(0.1 * k, 50.0 + 0.1 * k)
    assert clock.offset == pytest.approx(50.0)
    # Held up on its way: neither taken nor a jump.
    assert not clock.one_way(0.0, 52.0) and clock.jumps == 0 and clock.offset == pytest.approx(50.0)
    assert clock.one_way(2.1, 52.1) and clock.jumps == 0
    clock.one_way(0.0, 52.2)
    clock.one_way(0.1, 52.3)
    assert clock.jumps == 1 and clock.offset == pytest.approx(52.2)


@pytest.mark.parametrize(
    ("rate", "is_allowed"), [(1.0, True), (0.99, False), (1000.0, True), (1001.0, False)]
)
def test_a_rig_on_topics_takes_one_to_a_thousand_set_points_per_second(rate, is_allowed):
    content = {
        "limits": {"command_timeout": 5.0, "rig_timeout": 5.0, "vent_time": 10.0},
        "links": [
            {
                "type": "topics",
                "rate": rate,
                "receive": [
                    {"topic": "/p", "type": PRESSURES, "gives": "pressure", "names": ["left", "right"]}
                ],
                "send": {"topic": "/set"},
            }
        ],
    }
    if is_allowed:
        assert load_rig(content).links[0].rate == rate
    else:
        with pytest.raises(BridgeError, match="rate"):
            load_rig(content)


def test_only_a_bridge_that_commands_gets_a_link_that_writes(clock):
    rig = load_rig("controller_topics")
    assert [link.commands for link in rig.connect(clock, commands=False)] == [False]
    assert sorted(link.commands for link in rig.connect(clock, commands=True)) == [False, True]


def test_the_pose_of_an_estimate_has_the_covariance_of_its_position_and_no_other():
    covariance = np.arange(1.0, 10.0).reshape(3, 3)
    estimate = SimpleNamespace(points={"P1": (np.array([0.1, 0.2, 0.3]), covariance)})
    cdr = state_estimator._pose(5, "P1", estimate)
    message = decode("geometry_msgs/msg/PoseWithCovarianceStamped", cdr)
    found = np.asarray(message.pose.covariance).reshape(6, 6)
    expected = np.zeros((6, 6))
    expected[:3, :3] = covariance
    assert found.tolist() == expected.tolist()


def test_an_estimate_is_corrected_by_accepted_positions_and_counts_skipped_ones(monkeypatch):
    basis = SimpleNamespace(close=lambda: None, result=lambda: None)
    monkeypatch.setattr(state_estimator, "BasisProcess", lambda *_: basis)
    simulation = SimpleNamespace(
        points={"P0": None, "P1": None}, lattice=SimpleNamespace(nodes=(3, 3)), arm_names=("left",)
    )
    twin = SimpleNamespace(simulation=simulation, settings=SimpleNamespace(publish_rate=50.0), scene=None)
    estimator = state_estimator.StateEstimator(twin)
    accepted = [1.0]
    estimator.filter = SimpleNamespace(correct=lambda time, places: accepted[0], pressure=lambda *_: None)

    def positions(*times):
        return [(RawReading("position", "P1", np.zeros(3), time, "t"), time) for time in times]

    assert estimator.skipped == 0
    estimator.take(positions(2.0))
    assert estimator._corrected_at == 2.0
    accepted[0] = None
    estimator.take(positions(3.0))
    assert estimator._corrected_at == 2.0
    # Of a backlog the newest sixteen count.
    estimator.take(positions(*np.arange(20) * 0.01 + 4.0))
    assert estimator.skipped == 4
