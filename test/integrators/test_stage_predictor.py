"""What is expected of the next accelerations, and of the step after a command."""

from __future__ import annotations

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.integrators.implicit.predictor import StagePredictor


def _interval(trail, start, length, shape):
    return trail.extended([(start + share * length, shape(start, share)) for share in (0.25, 0.5, 1.0)])


def _guesses(trail, times, stages):
    """Return the guess of each stage, given the accelerations that the stages before it turned out to have."""
    bend, offset = trail.guesses(np.array([trail.points[-1][0], *times]))
    known = [trail.points[-1][1], *stages]
    return [
        known[i - 1] + bend[i] * (known[i - 1] - known[max(i - 2, 0)]) + offset.get(i, 0.0)
        for i in range(1, len(times) + 1)
    ]


def test_commands_at_a_steady_rate_are_expected_to_act_as_the_last_one_did():
    def shape(start, share):
        return np.array([10.0 * start + share * (1.0 - share)])

    trail = StagePredictor(0.0, ((0.0, np.array([0.0])),))
    for k in range(3):
        trail = _interval(trail, 0.1 * k, 0.1, shape)
        trail = trail.jumped(0.1 * (k + 1), np.array([99.0]))
    # The course between commands, one interval further on; the jump itself says nothing.
    first, second = _guesses(trail, [0.325, 0.35], [np.array([7.0])])
    np.testing.assert_allclose(first, shape(0.3, 0.25))
    np.testing.assert_allclose(second, 7.0 + shape(0.3, 0.5) - shape(0.3, 0.25))


def test_without_a_rhythm_the_last_two_points_are_extrapolated():
    trail = StagePredictor(0.0, ((0.0, np.array([1.0])), (0.5, np.array([2.0]))))
    np.testing.assert_allclose(_guesses(trail, [1.0], []), [[3.0]])
    np.testing.assert_allclose(_guesses(trail, [0.75, 1.0], [np.array([4.0])])[1], [6.0])
    np.testing.assert_allclose(_guesses(trail.jumped(0.6, np.array([5.0])), [0.7], []), [[5.0]])


def test_a_pressure_command_every_ten_milliseconds_costs_one_step_each():
    simulation = load_scene("rig").edited({"solver.integrator": "esdirk43"}).build()
    for k in range(100):
        simulation.inputs.set_pressure(70e3 * (1.0 - np.cos(np.pi * k / 100)))
        simulation.advance_to((k + 1) / 100)
    assert simulation.statistics.steps < 130
    # Five stages a step: fewer than two iterations each.
    assert simulation.statistics.evaluations < 10 * simulation.statistics.steps
