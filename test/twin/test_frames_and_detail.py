"""Prefixed frames, and the two messages that come only on demand."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from fake_scene import RailScene

from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.diagnostics import SolverReport
from ldcs_ros.messages.messages import wrench_command

SENSORS = {"tracker": {"points": ("P0", "P1"), "rate": 50.0}, "pressure": {"rate": 50.0}}


def frames_of(message):
    """Every frame that a message names."""
    for one in getattr(message, "transforms", getattr(message, "markers", [message])):
        yield from (
            text for text in (one.header.frame_id, getattr(one, "child_frame_id", "")) if text and text != "_"
        )


def test_every_frame_has_the_prefix(run):
    twin, collected = run(
        RailScene(sensors=SENSORS),
        publish_tf=True,
        full_precision=True,
        frame_prefix="twin1/",
        has_subscribers=lambda topic: topic == "nodes",
    )
    twin.advance_to(0.1)
    named = defaultdict(set)
    for topic, kind, cdr, _ in collected:
        if topic.startswith("/tf") or "header" in decode(kind, cdr).__dataclass_fields__:
            named[topic] |= set(frames_of(decode(kind, cdr)))
    assert {"nodes", "truth/P0/pose", "P1/pose", "left/pressure", "lattice_state"} <= set(named)
    assert all(frame.startswith("twin1/") for frames in named.values() for frame in frames), named
    assert named["/tf"] == {"twin1/ldcs_base", "twin1/P0", "twin1/P1"}
    assert named["/tf_static"] == {"twin1/ldcs_base", "twin1/trakstar_base"}
    assert named["trakstar_msg"] == {"twin1/trakstar_base", "twin1/trakstar0", "twin1/trakstar1"}


def test_a_wrench_may_name_its_frame_with_or_without_the_prefix_of_this_twin(run):
    twin, collected = run(frame_prefix="twin1/")
    push = (0.0, 0.0, 1.0)
    assert twin.receive("external_wrench", wrench_command(0, "twin1/P1", push, push)) is None
    assert twin.receive("external_wrench", wrench_command(0, "P1_aligned", push, push)) is None
    assert "unknown frame" in twin.receive("external_wrench", wrench_command(0, "twin2/P1", push, push))
    assert set(twin.simulation.inputs.wrenches) == {"P1", "P1_aligned"}
    twin.apply_wrench(
        point="twin1/P0", frame_id="twin1/ldcs_base", force=push, torque=push, duration=0.0, ramp=0.0
    )
    _, kind, cdr, _ = collected.on("external_wrench")[-1]
    assert decode(kind, cdr).header.frame_id == "twin1/P0_aligned"


def test_the_lattice_state_is_the_state_to_the_last_bit(run):
    twin, collected = run(has_subscribers=lambda topic: topic == "lattice_state")
    twin.advance_to(0.1)
    _, kind, cdr, time = collected.on("lattice_state")[-1]
    message, state = decode(kind, cdr), twin.simulation.state
    assert (message.header.frame_id, time, len(collected.on("lattice_state"))) == ("ldcs_base", 10**8, 6)
    assert (message.nodes_x, message.nodes_y, message.arms, message.links) == (3, 2, ["left", "right"], 2)
    for name in ("position", "velocity", "link_angle", "link_rate", "pressure"):
        assert np.array_equal(getattr(message, name), np.ravel(getattr(state, name))), name


def test_the_solver_reports_ten_times_a_second_at_any_publish_rate(run):
    for rate, times in ((50.0, 11), (100.0, 11), (5.0, 6), (12.0, 13)):
        twin, collected = run(has_subscribers=lambda topic: topic == "solver_status", publish_rate=rate)
        twin.overruns = 7
        twin.receive("pressure_command", b"nonsense")
        twin.advance_to(1.0)
        assert len(collected.on("solver_status")) == times
    _, kind, cdr, _ = collected.on("solver_status")[-1]
    message = decode(kind, cdr)
    assert (message.integrator, message.step, message.evaluations) == ("rails", 0.125, 3)
    assert (message.overruns, message.rejected_commands) == (7, 1)
    assert message.real_time_factor > 1.0


def test_messages_without_subscribers_cost_nothing(run):
    twin, collected = run()
    twin.advance_to(0.2)
    assert not collected.on("lattice_state") and not collected.on("solver_status")
    assert not twin.topics["lattice_state"].recorded and not twin.topics["solver_status"].recorded


def test_the_pace_is_that_of_the_last_second_and_a_pause_does_not_count(run):
    now = [0.0]
    report = SolverReport(lambda: now[0])
    twin, _ = run()

    def factor(elapsed, simulated):
        now[0] += elapsed
        twin.advance_to(twin.time + simulated)
        cdr = report.build(0, twin.simulation, overruns=0, refused=0)
        return decode("ldcs_msgs/msg/SolverStatus", cdr).real_time_factor

    assert factor(0.0, 0.0) == 0.0
    assert [factor(0.125, 0.25) for _ in range(4)] == [2.0] * 4
    assert [factor(0.125, 0.125) for _ in range(20)][-1] == 1.0
    now[0] += 1000.0
    report.restart()
    assert (factor(0.0, 0.0), factor(0.125, 0.125)) == (0.0, 1.0)
