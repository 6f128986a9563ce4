"""The gradient by all commands is that of the tangents by each."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene

from .test_run_sensitivity import CONTENT

NAMES = [
    "pressure.left@0",
    "pressure.left@0.1",
    "pressure.right@0.1",
    "pressure.right@0.2",
    "wrench.P1.force@0.15",
    "wrench.P1.torque@0.15",
]


def test_a_gradient_is_the_tangents_by_each_command():
    inputs = [
        {"time": 0.0, "pressure": 100e3},
        {"time": 0.1, "pressure": [60e3, 120e3]},
        {"time": 0.15, "wrench": {"frame": "P1", "force": [0.1, 0.0, 0.3], "torque": [0.0, 1e-3, 0.0]}},
        {"time": 0.2, "pressure": [90e3, 20e3]},
    ]
    simulation = load_scene({**CONTENT, "inputs": inputs, "solver": {"accuracy": 1e-6}}).build()
    times = [0.12, 0.24, 0.3]
    weights = np.zeros((3, 6))
    weights[0, 2], weights[1, 4], weights[2, 3:] = 0.5, -1.0, (2.0, 0.3, 1.0)
    found = simulation.run_gradient(times, ["P0", "P1"], weights)
    assert simulation.time == 0.0
    tangents = simulation.run_sensitivity(times, ["P0", "P1"], NAMES, with_error=False)
    assert found.value == pytest.approx(float(np.sum(weights * tangents.position)), abs=1e-6)
    expected = np.einsum("tr,trc->c", weights, tangents.values)
    for name, value in zip(tangents.to, expected, strict=True):
        command, _, time = name.partition("@")
        row = found.time.tolist().index(float(time))
        own = found.values[row, found.command.index(command)]
        kind = [k for k, other in enumerate(tangents.to) if other.partition(".")[0] == name.partition(".")[0]]
        # Both resolve the motion to 1e-6 m; their steps are not the same.
        assert abs(own - value) < 2e-3 * np.abs(expected[kind]).max(), name
    # At 0.2 s only pressures are commanded.
    wrenches = [k for k, name in enumerate(found.command) if name.startswith("wrench")]
    assert not found.values[found.time.tolist().index(0.2), wrenches].any()
