"""Large lattices and commands at a rate, as ratios in one process: how cost grows with size, and what a command costs.

Each limit is about 1.5 times what was measured when it was written down; lower it when something becomes faster.
"""

from __future__ import annotations

import math

import pytest

from ldcs_ros.integrators.spectrum import fastest_mode
from ldcs_ros.scene import load_scene
from ldcs_ros.study.baseline import ArcBaseline
from ldcs_ros.study.drive_profiles import drive_problem, follow, sampled
from ldcs_ros.study.problems import scene_of
from ldcs_ros.study.timing import in_turns

# s of simulation time: the dearest part of the benchmark; the steepest part of the courses.
LARGE_SPAN, COURSE_SPAN = 0.5, 0.6
STEP = 0.02  # s, of the baseline: an error of 2e-5 m at 65 x 65

# Sizes -> most that the power of the number of nodes may be by which cost grows between them.
GROWTH = {(17, 33): 1.6, (33, 65): 1.6}
# (problem, Hz) -> most CPU times of the smooth case.
COMMANDED = {
    ("arc_pushed", 100.0): 8.0,
    ("paper", 100.0): 15.0,
    ("rig", 100.0): 5.0,
    ("arc_pushed", 1000.0): 45.0,
}


def _runs(scene, span, prepare=lambda simulation: None):
    simulation = scene.build()
    prepare(simulation)
    simulation.advance_to(1e-4)  # loads compiled kernels

    def run():
        simulation.reset()
        simulation.advance_to(span)

    return run


@pytest.mark.timeout(600)
@pytest.mark.parametrize("sizes", GROWTH, ids="{0[0]} to {0[1]}".format)
def test_cost_grows_with_the_lattice_no_faster_than_it_did(sizes):
    runs = [_runs(scene_of("arc_material", n, accuracy=1e-5), LARGE_SPAN) for n in sizes]
    small, large = in_turns(*runs, rounds=2)
    power = math.log(large / small) / math.log((sizes[1] / sizes[0]) ** 2)
    print(f"\narc_material {sizes[0]} to {sizes[1]}: nodes^{power:.2f} (limit {GROWTH[sizes]:g})")
    assert power < GROWTH[sizes]


@pytest.mark.timeout(600)
def test_a_large_lattice_costs_no_more_baselines_than_it_did():
    limit = 1.8
    simulation = scene_of("arc", 65).build()
    mode, _ = fastest_mode(simulation.model, simulation.motion(), simulation.inputs.held())
    ArcBaseline(5, STEP, 1e3).run((LARGE_SPAN,))  # compiles
    baseline = ArcBaseline(65, STEP, mode.spectral_radius)
    run = _runs(scene_of("arc", 65, accuracy=2e-5), LARGE_SPAN)
    taken, reference = in_turns(run, lambda: baseline.run((LARGE_SPAN,)), rounds=2)
    ratio = taken / reference
    print(f"\narc 65 x 65 at 2e-5 m: {ratio:.2f} baselines (limit {limit:g})")
    assert ratio < limit


@pytest.mark.timeout(300)
@pytest.mark.parametrize("case", COMMANDED, ids=lambda case: f"{case[0]} {case[1]:g} Hz")
def test_commands_cost_no_more_smooth_courses_than_they_did(case):
    name, rate = case
    content, course = drive_problem(name)
    scene = load_scene({**content, "solver": {"accuracy": 1e-5}})
    smooth = _runs(scene, COURSE_SPAN, lambda simulation: follow(simulation, course))
    commanded = scene.build()

    def steps():
        commanded.reset()
        sampled(commanded, course, rate, (COURSE_SPAN,))

    taken, reference = in_turns(steps, smooth, rounds=3)
    ratio = taken / reference
    print(f"\n{name} at {rate:g} Hz: {ratio:.1f} smooth courses (limit {COMMANDED[case]:g})")
    assert ratio < COMMANDED[case]
