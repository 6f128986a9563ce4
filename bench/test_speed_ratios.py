"""Speed as ratios to one compiled loop, taken in turns in one process: `make bench` fails where something is slower.

The loop is the fixed-step RKC2 baseline of `ldcs_ros/study/baseline.py` on the same lattice; it contains nothing of
the package's own solvers, so a faster machine or a busy one changes both sides alike. Each limit is about 1.5 times
what was measured when it was written down; lower it when something becomes faster.
"""

from __future__ import annotations

import pytest

from ldcs_ros.integrators.spectrum import fastest_mode
from ldcs_ros.study.baseline import ArcBaseline
from ldcs_ros.study.problems import scene_of
from ldcs_ros.study.timing import in_turns

ROUNDS = 7
SPAN = (1.0,)  # s of simulation time
STEP = 0.02  # s, of the baseline: an error of micrometres

# What -> (limit of its CPU time in baselines, scene, nodes, solver).
RUNS = {
    "arc at 1e-5 m": (3.2, "arc", 9, {"accuracy": 1e-5}),
    "arc at 1e-7 m": (8.4, "arc", 9, {"accuracy": 1e-7}),
    "paper at 1e-5 m": (9.8, "paper", 9, {"accuracy": 1e-5}),
    "rig at 1e-5 m": (16.0, "rig", 9, {"accuracy": 1e-5}),
    "arc 17 x 17 at 1e-5 m": (2.4, "arc", 17, {"accuracy": 1e-5}),
    "arc 33 x 33 at 2e-5 m": (2.0, "arc", 33, {"accuracy": 2e-5}),
    "arc with rkc2 at 1e-5 m": (15.0, "arc", 9, {"integrator": "rkc2", "accuracy": 1e-5}),
    "arc with trbdf2 at 1e-4 m": (2.6, "arc", 9, {"integrator": "trbdf2", "accuracy": 1e-4}),
}


def _baseline(nodes):
    simulation = scene_of("arc", nodes).build()
    mode, _ = fastest_mode(simulation.model, simulation.motion(), simulation.inputs.held())
    solver = ArcBaseline(nodes, STEP, mode.spectral_radius)
    solver.run((0.5,))  # compiles
    return solver


@pytest.mark.timeout(300)
@pytest.mark.parametrize("what", RUNS)
def test_a_second_of_simulation_costs_no_more_baselines_than_it_did(what):
    limit, scene, nodes, solver = RUNS[what]
    simulation = scene_of(scene, nodes, **solver).build()
    simulation.advance_to(0.01)  # loads compiled kernels
    baseline = _baseline(nodes)

    def ours():
        simulation.reset()
        simulation.advance_to(SPAN[-1])

    taken, reference = in_turns(ours, lambda: baseline.run(SPAN), rounds=ROUNDS)
    ratio = taken / reference
    print(f"\n{what}: {ratio:.2f} baselines (limit {limit:g}), {SPAN[-1] / taken:.0f} times real time")
    assert ratio < limit


@pytest.mark.timeout(300)
def test_a_force_evaluation_costs_no_more_than_a_few_of_the_stencils():
    simulation = scene_of("arc", 9).build()
    simulation.advance_to(0.1)
    model, motion, held = simulation.model, simulation.motion(), simulation.inputs.held()
    baseline = _baseline(9)
    count = round(SPAN[-1] / STEP) * baseline.stages

    def ours():
        for _ in range(count):
            model.force(motion.time, motion.q, motion.u, held)

    taken, reference = in_turns(ours, lambda: baseline.run(SPAN), rounds=ROUNDS)
    print(f"\nforce evaluation: {taken / reference:.2f} stencil evaluations")
    assert taken / reference < 4.8
