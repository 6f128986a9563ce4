"""The compiled stages and the effects called one by one give the same step, on random scenes of the whole schema."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import SceneError
from ldcs_ros.integrators.implicit.esdirk import Dirk
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.study.accuracy.random_scenes import random_case
from ldcs_ros.study.accuracy.reference import start_velocity

pytestmark = pytest.mark.skipif(not HAVE_NUMBA, reason="there is nothing compiled to compare with")

# Both sum in another order, and what one iteration leaves differs by rounding times the number of iterations.
ROUNDING = 1e-9
SEEDS = range(24)


def _runs(case):
    """Return two simulations of a case at its start, the second without compiled stages, or None if it has none."""
    runs = [load_scene(case.content).with_accuracy(1e-5).build() for _ in range(2)]
    velocity = start_velocity(case, runs[0].state.position)
    for run in runs:
        if velocity is not None:
            run.start_from(run.state.position, velocity)
        assert isinstance(run.integrator, Dirk)
    if runs[0].integrator.kernel is None:
        return None
    runs[1].integrator.call_effects_one_by_one()
    return runs


def test_the_compiled_stages_are_those_of_the_effects_called_one_by_one():
    compared = 0
    for seed in SEEDS:
        case = random_case(seed)
        try:
            runs = _runs(case)
        except SceneError:
            continue
        if runs is None:
            continue
        for run in runs:
            run.advance_to(0.05)
        compared += 1
        gap = np.abs(runs[0].state.position - runs[1].state.position).max()
        assert gap <= ROUNDING, (case.name, gap)
        counts = [(run.statistics.steps, run.statistics.evaluations) for run in runs]
        assert counts[0] == counts[1], case.name
        estimates = [run.statistics.error_estimate for run in runs]
        assert estimates[0] == pytest.approx(estimates[1], rel=1e-3, abs=ROUNDING), case.name
    assert compared >= 6


@pytest.mark.parametrize("name", ["arc", "paper", "rig", "hanging_sheet"])
def test_shipped_scenes_take_the_same_steps_either_way(name):
    runs = [load_scene(name).build() for _ in range(2)]
    assert runs[0].integrator.kernel is not None
    runs[1].integrator.call_effects_one_by_one()
    for run in runs:
        run.advance_to(0.3)
    assert np.abs(runs[0].state.position - runs[1].state.position).max() <= 1e-12
    assert runs[0].statistics.steps == runs[1].statistics.steps
    assert runs[0].statistics.error_estimate == pytest.approx(runs[1].statistics.error_estimate, rel=1e-6)
