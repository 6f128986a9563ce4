"""What `accuracy` promises: the real error of every shipped scene stays below it, and the reported one is honest."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene, shipped_scenes

# The whole table (accuracies 1e-3 ... 1e-7 m) is part of `ldcs study`; here are the two that people use most.
ACCURACIES = (1e-4, 1e-5)
TIMES = np.linspace(0.02, 2.0, 100)


def _course(scene, accuracy):
    simulation = scene.with_accuracy(accuracy).build()
    course = []
    for time in TIMES:
        simulation.advance_to(time)
        course.append(simulation.state.position)
    return np.array(course), simulation.statistics.error_estimate


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_the_real_error_is_below_the_asked_one(name):
    scene = load_scene(name)
    reference, _ = _course(scene, 1e-8)
    for accuracy in ACCURACIES:
        course, reported = _course(scene, accuracy)
        # Removed nodes are not numbers.
        error = np.nanmax(np.abs(course - reference))
        assert error <= accuracy
        # An estimate: it may be low, by no more than a factor of two.
        assert error <= 2.0 * reported + 1e-8
