"""Speed of the shipped surfaces with a list of arms, as ratios within one process and to real time: `make bench`."""

from __future__ import annotations

import pytest

from ldcs_ros import load_scene
from ldcs_ros.study.timing import in_turns

SPAN = 4.0  # s of simulation time: the start under full pressures, then the way to rest
MOST_A_STEP = 1.6
LEAST_REAL_TIME = 5.0


def _run(name):
    simulation = load_scene(name).build()
    simulation.advance_to(0.05)  # loads compiled kernels

    def ours():
        simulation.reset()
        simulation.advance_to(SPAN)

    ours()
    return simulation, ours


@pytest.mark.timeout(300)
def test_a_step_of_three_arms_costs_no_more_than_1_6_of_the_rigs():
    (three, ours), (rig, other) = _run("three_arms"), _run("rig")
    taken, reference = in_turns(ours, other, rounds=7)
    ratio = taken / three.statistics.steps / (reference / rig.statistics.steps)
    print(f"\nthree_arms: {ratio:.2f} of the rig's step (limit {MOST_A_STEP})")
    assert ratio < MOST_A_STEP


@pytest.mark.timeout(300)
def test_the_mould_is_five_times_faster_than_real_time():
    simulation, ours = _run("mould")

    def half():
        simulation.reset()
        simulation.advance_to(0.5 * SPAN)

    taken, start = in_turns(ours, half, rounds=5)
    print(f"\nmould at 1e-5 m: {SPAN / taken:.1f} times real time (limit {LEAST_REAL_TIME})", end="")
    print(f", the first half alone {0.5 * SPAN / start:.1f}")
    assert taken * LEAST_REAL_TIME < SPAN
