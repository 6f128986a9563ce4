"""A closed loop in lock-step: a command and a duration in, the state out, the same on every run."""

from __future__ import annotations

import hashlib
import signal

import pytest

srv = pytest.importorskip("ldcs_msgs.srv", reason="the interface package is not built")

from builtin_interfaces.msg import Duration  # noqa: E402
from ldcs_msgs.msg import ArmCommand  # noqa: E402
from live import stamp  # noqa: E402

from ldcs_ros.replay.session import replay  # noqa: E402

PERIOD_NS = 7_000_000  # no divisor of the publish period


def advance(user, sequence=0, pressure=None, duration=PERIOD_NS):
    """Return the answer to a call of the service; without a pressure [Pa] no command goes along."""
    command = ArmCommand()
    if pressure is not None:
        command = ArmCommand(sequence=sequence, arms=["left", "right"], pressures=[pressure, pressure])
    length = Duration(sec=duration // 10**9, nanosec=duration % 10**9)
    request = srv.Advance.Request(command=command, duration=length)
    return user.call("/ldcs/ldcs_sim/advance", srv.Advance, request, timeout=30.0)


def closed_loop(user, steps=40):
    """Hold the tip at a height by the state of each step; return the hash of all states."""
    digest, height, pressure = hashlib.sha256(), 0.0, 0.0
    for k in range(steps):
        pressure = min(max(pressure + 4e5 * (0.03 - height), 0.0), 1.5e5)
        answer = advance(user, k + 1, pressure)
        assert answer.success, answer.message
        assert stamp(answer.state) == (k + 1) * PERIOD_NS
        height = answer.state.position[-1]
        for values in (
            answer.state.position,
            answer.state.velocity,
            answer.state.link_angle,
            answer.state.pressure,
        ):
            digest.update(values.tobytes())
    return digest.hexdigest()


def test_three_runs_of_a_closed_loop_give_one_hash(start, tmp_path):
    node, user = start(scene="rig", record=tmp_path / "bag")
    hashes = []
    for _ in range(2):
        assert user.call("/ldcs/ldcs_sim/pause", timeout=45.0).success
        assert user.call("/ldcs/ldcs_sim/reset").success
        hashes.append(closed_loop(user))
    assert node.stop(signal.SIGINT) == 0
    _, other = start(scene="rig")
    assert other.call("/ldcs/ldcs_sim/pause", timeout=45.0).success
    assert other.call("/ldcs/ldcs_sim/reset").success
    hashes.append(closed_loop(other))
    assert len(set(hashes)) == 1
    assert replay(tmp_path / "bag_reset2", tmp_path / "again").verdict.same_bytes


def test_an_advance_that_cannot_be_is_refused_with_the_reason_and_changes_nothing(start):
    _, user = start(scene="rig")
    assert "call pause" in advance(user).message
    assert user.call("/ldcs/ldcs_sim/pause").success and user.call("/ldcs/ldcs_sim/reset").success
    for duration in (0, -PERIOD_NS, 10**10 + 1):
        answer = advance(user, duration=duration)
        assert not answer.success and "duration" in answer.message
    answer = advance(user, 1, 1e9)
    assert not answer.success and "limit" in answer.message
    answer = advance(user)
    assert answer.success and stamp(answer.state) == PERIOD_NS
    assert (answer.state.nodes_x, len(answer.state.position)) == (9, 2 * 9 * 9 * 3)
