"""A small scene for replays, and a way to record a run of it that a test drives."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

sys.path.insert(0, str(Path(__file__).parent))


def scene_with(drive, **more):
    """Return a 4 x 4 sheet with arms, wrench effect and noisy sensors."""
    sensors = {
        "tracker": {"points": ["P0", "P1"], "rate": 80.0, "delay": 0.02, "seed": 3},
        "pressure": {"rate": 100.0, "noise": 50.0},
    }
    return load_scene(
        small_sheet({"type": "wrench"}, nodes=(4, 4), arms={"drive": drive}, **{"sensors": sensors, **more})
    )


@pytest.fixture
def pneumatic():
    return scene_with("pressure", inputs=[{"time": 0.0, "pressure": 5.0e4}])


@pytest.fixture
def motorised():
    return scene_with("torque", inputs=[{"time": 0.05, "torque": 0.05}])


@pytest.fixture
def recorded(tmp_path):
    """Return a context: a twin whose run is recorded into a bag folder."""

    @contextmanager
    def run(scene, folder=None, *, watchdog=None, diagnostics=True, **settings):
        twin = Twin(scene, RunSettings(**settings), watchdog=watchdog, diagnostics=diagnostics)
        recorder = Recorder(folder or tmp_path / "original", twin)
        twin.sinks.append(recorder)
        twin.recorder = recorder
        try:
            yield twin
        finally:
            recorder.close()

    return run
