"""A small hidden truth, bags of it as the tracker saw them (80 Hz, 0.1 mm), and a wrong guess to start from."""

from __future__ import annotations

import pytest

from ldcs_ros import load_scene
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

HIDDEN = {"effects.springs.stiffness": 110.0, "effects.arms.pressure_gain": 1.1e-6}
DURATION = 0.7  # s
SCHEDULES = {
    "a": [{"time": 0.0, "pressure": 1.0e5}, {"time": 0.4, "pressure": [1.4e5, 1.1e5]}],
    "b": [{"time": 0.0, "pressure": [6.0e4, 1.3e5]}],
    "c": [{"time": 0.0, "pressure": 1.4e5}, {"time": 0.35, "pressure": [2.0e4, 9.0e4]}],
}


def small_scene(schedule, *, law="axial", stiffness=80.0, gain=1.0e-6, accuracy=1.0e-6):
    """Return a 3 x 3 sheet with pneumatic arms of two links, as a dict."""
    return {
        "title": "A small sheet",
        "lattice": {"size": [0.140, 0.140, 0.010], "nodes": [3, 3], "mass": 0.160},
        "points": {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]},
        "effects": [
            {"type": "springs", "law": law, "stiffness": stiffness, "damping": 5.0},
            {"type": "gravity"},
            {"type": "clamp"},
            {"type": "arms", "drive": "pressure", "links": 2, "pressure_gain": gain},
        ],
        "inputs": schedule,
        "sensors": {"tracker": {"points": ["P0", "P1"], "rate": 80.0, "noise": 1.0e-4, "quantum": 2.8e-5}},
        "solver": {"accuracy": accuracy},
    }


def record(folder, content, *, seed, settle=False):
    """Run a scene and record it."""
    twin = Twin(load_scene(content), RunSettings(seed=seed, publish_rate=5.0))
    if settle:
        twin.settle()
    recorder = Recorder(folder, twin)
    twin.sinks.append(recorder)
    twin.advance_to(twin.time + DURATION)
    recorder.close()
    return folder


@pytest.fixture(scope="session")
def guess():
    """The scene to start from: its stiffness and gain are wrong."""
    return load_scene(small_scene([{"time": 0.0, "pressure": 0.0}]))


@pytest.fixture(scope="session")
def bags(tmp_path_factory):
    """Bags of the truth with hidden numbers."""
    folder = tmp_path_factory.mktemp("truth")
    return {
        name: record(folder / name, small_scene(schedule, stiffness=110.0, gain=1.1e-6), seed=10 + number)
        for number, (name, schedule) in enumerate(SCHEDULES.items())
    }


@pytest.fixture(scope="session")
def other_law(tmp_path_factory):
    """A bag of a truth with another spring law."""
    folder = tmp_path_factory.mktemp("other")
    return record(folder / "a", small_scene(SCHEDULES["a"], law="corotational"), seed=20)
