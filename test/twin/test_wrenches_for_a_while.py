"""Wrenches of a service: their course in time, what a bag holds of it, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from fake_scene import RailScene

from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.messages import wrench_command
from ldcs_ros.twin.commands import Refusal
from ldcs_ros.twin.wrench_profile import MAX_STEPS, WrenchProfile

NOTHING = (0.0, 0.0, 0.0)
PUSH = {"point": "P1", "frame_id": "ldcs_base", "force": (0.0, 0.0, 2.0), "torque": NOTHING}


def held(collected):
    """Return the commands: time [s], frame, force along z [N]."""
    messages = [(time, decode(kind, cdr)) for _, kind, cdr, time in collected.on("external_wrench")]
    return [(time / 1e9, one.header.frame_id, one.wrench.force.z) for time, one in messages]


def test_a_wrench_acts_for_its_duration_to_the_nanosecond(run):
    twin, collected = run()
    twin.advance_to(0.0123)
    twin.apply_wrench(**PUSH, duration=0.1, ramp=0.0)
    twin.advance_to(0.5)
    assert held(collected) == [(0.0123, "P1_aligned", 2.0), (0.1123, "P1_aligned", 0.0)]
    assert 0.1123 in twin.simulation.visited
    assert twin.simulation.inputs.wrenches == {}


@pytest.mark.parametrize(("duration", "ramp"), [(0.1, 0.03), (0.2, 0.1), (0.077, 0.0123), (60.0, 30.0)])
def test_a_ramps_stairs_have_its_impulse(duration, ramp):
    course = WrenchProfile.of("P1", (0, 0, 1.0), NOTHING, start=0.25, duration=duration, ramp=ramp)
    times, shares = (np.array(column) for column in zip(*course.fractions, strict=True))
    assert len(times) <= 2 * MAX_STEPS + 2 and (np.diff(times) > 0).all()
    assert times[[0, -1]].tolist() == [250_000_000, round((0.25 + duration) * 1e9)]
    assert (shares[:-1] > 0.0).all() and (shares <= 1.0).all() and shares[-1] == 0.0
    impulse = (np.diff(times) / 1e9) @ shares[:-1]
    assert impulse == pytest.approx(duration - ramp, abs=len(times) * 1e-9)


def test_without_a_duration_it_is_held_until_it_is_replaced(run):
    twin, collected = run()
    assert twin.apply_wrench(**PUSH, duration=0.0, ramp=0.02).endswith("until it is replaced")
    twin.advance_to(2.0)
    assert [force for _, _, force in held(collected)] == [0.5, 1.5, 2.0]
    twin.apply_wrench(**{**PUSH, "force": NOTHING}, duration=0.0, ramp=0.0)
    assert twin.simulation.inputs.wrenches == {}


def test_axes_that_turn_with_the_point_are_its_own_frame(run):
    twin, collected = run()
    said = twin.apply_wrench(**{**PUSH, "frame_id": "P1"}, duration=1.0, ramp=0.0)
    assert held(collected) == [(0.0, "P1", 2.0)]
    assert said == "P1: 2 N, 0 N m, to t = 1 s"


def test_a_command_on_the_topic_replaces_the_course_of_its_frame_and_of_no_other(run):
    twin, collected = run()
    twin.apply_wrench(**PUSH, duration=0.1, ramp=0.0)
    twin.apply_wrench(**{**PUSH, "point": "P0"}, duration=0.1, ramp=0.0)
    twin.advance_to(0.05)
    twin.receive("external_wrench", wrench_command(0, "P1_aligned", (0.0, 0.0, 0.5), NOTHING))
    twin.advance_to(0.3)
    assert held(collected)[2:] == [(0.05, "P1_aligned", 0.5), (0.1, "P0_aligned", 0.0)]
    assert twin.simulation.inputs.wrenches["P1_aligned"].force == (0.0, 0.0, 0.5)


def test_a_reset_ends_all_courses(run):
    twin, collected = run()
    twin.apply_wrench(**PUSH, duration=0.1, ramp=0.0)
    twin.reset()
    twin.advance_to(0.3)
    assert len(held(collected)) == 1


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"point": "P7"}, "unknown frame"),
        ({"point": "P1_aligned"}, "unknown frame"),
        ({"frame_id": ""}, "unknown frame"),
        ({"frame_id": "P0"}, "unknown frame"),
        ({"frame_id": "world"}, "unknown frame"),
        ({"force": (0.0, float("nan"), 0.0)}, "not a number"),
        ({"torque": (float("inf"), 0.0, 0.0)}, "infinite"),
        ({"force": (0.0, 0.0, 1e3)}, "over limit"),
        ({"duration": -1.0}, "wrong time"),
        ({"ramp": -0.1}, "wrong time"),
        ({"ramp": 0.6}, "wrong time"),
        ({"duration": float("nan")}, "wrong time"),
    ],
)
def test_an_unsound_request_is_refused_whole_and_counted(run, change, reason):
    twin, collected = run()
    with pytest.raises(Refusal) as caught:
        twin.apply_wrench(**{**PUSH, "duration": 1.0, "ramp": 0.0, **change})
    assert caught.value.reason == reason
    assert twin.commands.refused == {reason: 1} and not twin.commands.accepted
    assert not twin.simulation.inputs.wrenches and not collected.on("external_wrench")
    assert twin.next_time == 0.0


def test_a_scene_without_the_effect_refuses(run):
    twin, _ = run(RailScene(effects=("arms",)))
    with pytest.raises(Refusal, match="effect absent"):
        twin.apply_wrench(**PUSH, duration=1.0, ramp=0.0)


@pytest.mark.parametrize(("ramp", "steps"), [(0.05, 5), (0.055, 6), (2.0, 200), (60.0, 200)])
def test_a_step_of_a_ramp_takes_ten_milliseconds_up_to_two_hundred_steps(ramp, steps):
    profile = WrenchProfile.of("P1", (1.0, 0.0, 0.0), NOTHING, start=0.0, duration=0.0, ramp=ramp)
    # The full wrench follows the steps.
    assert len(profile.fractions) == steps + 1
