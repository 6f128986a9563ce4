"""A run of the twin that moves, and the same motion as a rig would have recorded it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

sys.path.insert(0, str(Path(__file__).parents[1] / "replay"))

import rig_bag
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

SCENE = small_sheet()


def record(folder, *, seed=None, **changes):
    """Record two seconds of the scene: lifted at 0.3 s, half let down at 1.1 s."""
    twin = Twin(load_scene({**SCENE, **changes}), RunSettings(seed=seed))
    recorder = Recorder(folder, twin)
    twin.sinks.append(recorder)
    for time, pressure in ((0.3, 1.2e5), (1.1, 5e4), (2.0, 0.0)):
        twin.advance_to(time)
        twin.receive("pressure_command", pressure_command([pressure]))
    recorder.close()
    return folder


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """The bag of a run."""
    return record(tmp_path_factory.mktemp("runs") / "run")


@pytest.fixture(scope="session")
def softer(tmp_path_factory):
    """The bag of a run with a softer sheet."""
    effects = [{**SCENE["effects"][0], "stiffness": 60.0}, *SCENE["effects"][1:]]
    return record(tmp_path_factory.mktemp("runs") / "softer", effects=effects)


@pytest.fixture(scope="session")
def motion(run):
    """Times [s] and true positions of P0 and P1 [m] of the run."""
    from ldcs_ros.bags import read_bag
    from ldcs_ros.signals.tracks import point_tracks

    tracks = point_tracks(read_bag(run), truth=True)
    return tracks["P1"].time, {name: track.value for name, track in tracks.items()}


@pytest.fixture
def rig(motion, tmp_path):
    """Return a function that writes the motion as a tracker's driver would: late clock, mm, other axes, noise."""
    time, places = motion

    def write(
        name="rig", *, ahead=0.0, noise=1e-4, rate=80.0, silent=(9.0, 9.0), begin=0.0, until=2.0, bias=0.0
    ):
        draw = np.random.default_rng(7)
        through = {point: CubicSpline(time, place) for point, place in places.items()}
        messages = []
        for k in range(int(begin * rate), int(until * rate)):
            when = k / rate + draw.uniform(0.0, 1e-4)
            if silent[0] <= when <= silent[1]:
                continue
            stamp = rig_bag.WALL + round((when + ahead) * 1e9)
            for probe, point in enumerate(("P0", "P1")):
                x, y, z = through[point](when) + draw.normal(0.0, noise, 3) + [0.0, 0.0, bias]
                # The tracker's base stands 50 mm along x and is turned half around y.
                turned = 1e3 * np.array([0.05 - x, y, -z])
                messages.append(
                    ("/tracker", stamp + 2_000_000, rig_bag.transform(stamp, f"probe{probe}", turned))
                )
        start = rig_bag.WALL + round(ahead * 1e9)
        first = (
            "/note",
            start,
            rig_bag.array([0.0]),
        )  # the bag begins when the run begins, but for its clock
        return rig_bag.write(tmp_path / name, [first, *messages])

    return write


MAPPING = {
    "measurements": [
        {
            "topic": "/tracker",
            "to": point,
            "child": f"probe{probe}",
            "unit": "mm",
            "translation": [0.05, 0.0, 0.0],
            "rotation": [0.0, 1.0, 0.0, 0.0],
        }
        for probe, point in enumerate(("P0", "P1"))
    ]
}


@pytest.fixture
def tracker_mapping():
    from ldcs_ros.signals.mapping import parse_mapping

    return parse_mapping(MAPPING)
