"""A Python loop with commands beside the compiled baseline, and independent simulations over processes."""

from __future__ import annotations

import os
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from ldcs_ros.scene import load_scene
from ldcs_ros.study.baseline import ArcBaseline
from ldcs_ros.study.problems import spectral_radius
from ldcs_ros.study.timing import in_turns

COMMANDS, RATE = 50, 50.0  # Hz
STEP = 0.02  # s, of the baseline
# Measured: 23 baselines of one second for 50 random commands at 1e-4 m.
LOOP_LIMIT = 35.0
# A process more may cost each this fraction of its processor time; measured: 0.01.
SHARED_FRACTION = 0.4


def _loop(simulation):
    random = np.random.default_rng(1)

    def run():
        simulation.reset()
        for _ in range(COMMANDS):
            simulation.inputs.set_pressure(random.uniform(0.0, 140e3, 2))
            simulation.advance_to(simulation.time + 1.0 / RATE)

    return run


@pytest.mark.timeout(300)
def test_random_commands_cost_no_more_baselines_than_they_did():
    simulation = load_scene("rig").without_schedule().with_accuracy(1e-4).build()
    baseline = ArcBaseline(9, STEP, spectral_radius("arc", 9))
    for warm in (_loop(simulation), lambda: baseline.run((1.0,))):
        warm()
    taken, reference = in_turns(_loop(simulation), lambda: baseline.run((1.0,)), rounds=5)
    ratio = taken / reference
    print(f"\n50 random commands: {ratio:.1f} baselines (limit {LOOP_LIMIT:g}), {COMMANDS / taken:.0f} a CPU second")
    assert ratio < LOOP_LIMIT


def _advance(simulation):
    began = time.process_time()
    _loop(simulation)()
    return time.process_time() - began


@pytest.mark.timeout(300)
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has nothing to share")
def test_independent_simulations_scale_over_processes():
    simulation = load_scene("rig").without_schedule().with_accuracy(1e-4).build()
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(_advance, [simulation] * 2))  # loads in both processes
        alone = min(pool.submit(_advance, simulation).result() for _ in range(5))
        together = min(max(pool.map(_advance, [simulation] * 2)) for _ in range(5))
    print(f"\ntwo processes at once: {together / alone:.2f} times one (limit {1.0 + SHARED_FRACTION:g})")
    assert together < (1.0 + SHARED_FRACTION) * alone
