"""Impacts: a free sheet's momentum is kept in account, and a sheet at rest on a hard floor stays there cheaply."""

from __future__ import annotations

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.study.hard.catalogue import CASES
from ldcs_ros.study.hard.scenes import FALLING, changed


def test_a_sheet_bounces_off_a_floor_without_damping_as_high_as_a_finer_run_says():
    # Dampers inside the sheet forget all errors of an impact but the one of its momentum.
    scene = load_scene(CASES["dropped on a hard floor without damping"].scene)
    heights = []
    for accuracy in (1e-5, 1e-7):
        simulation = scene.with_accuracy(accuracy).build()
        simulation.advance_to(0.4)
        heights.append(simulation.state.position[:, 2].mean())
    assert abs(heights[0] - heights[1]) < 3e-5


def test_a_resting_contact_needs_few_steps():
    # Kept factors say nothing about a contact that opens and closes within an iteration; Newton's own do.
    scene = load_scene(changed(FALLING, {"effects.floor.height": -0.005}))
    simulation = scene.build()
    simulation.advance_to(20.0)
    steps, position = simulation.statistics.steps, simulation.state.position
    simulation.advance_to(60.0)
    assert simulation.statistics.steps - steps < 100
    assert np.abs(simulation.state.position - position).max() < 1e-9
