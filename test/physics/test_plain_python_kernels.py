"""Kernels give the same answers without numba: the same run of a small scene with arms, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np

from ldcs_ros import load_scene

SCENE = {
    "lattice": {"size": [0.1, 0.1, 0.01], "nodes": [3, 2], "mass": 0.1},
    "points": {"P1": ["mid", "free_edge"]},
    "effects": [
        {"type": "springs"},
        {"type": "gravity"},
        {"type": "clamp"},
        {"type": "drag"},
        {"type": "arms", "links": 2, "width": 0, "drive": "torque"},
    ],
    "inputs": [{"time": 0.0, "torque": [0.02, 0.01]}],
}
PROGRAM = """
import json, sys
from ldcs_ros import load_scene
from ldcs_ros.physics.compiled import HAVE_NUMBA
simulation = load_scene(json.loads(sys.argv[1])).build()
simulation.advance_to(0.05)
print(json.dumps([HAVE_NUMBA, simulation.state.position.tolist(), simulation.state.link_angle.tolist()]))
"""


def test_a_run_without_numba_ends_where_the_compiled_one_does():
    plain = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(SCENE)],
        env={**os.environ, "LDCS_NO_NUMBA": "1"},
        capture_output=True,
        text=True,
        timeout=50,
    )
    assert plain.returncode == 0, plain.stderr
    have_numba, position, link_angle = json.loads(plain.stdout)
    assert not have_numba
    simulation = load_scene(SCENE).build()
    simulation.advance_to(0.05)
    np.testing.assert_allclose(simulation.state.position, position, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(simulation.state.link_angle, link_angle, rtol=0.0, atol=1e-6)
    assert np.abs(simulation.state.link_angle).max() > 1e-3
