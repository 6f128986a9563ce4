"""A short bag to look at: a small sheet lifted by pneumatic arms, pushed at P0 by a schedule and by a command."""

from __future__ import annotations

import numpy as np
import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.bags import read_bag
from ldcs_ros.messages import messages
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.twin import Twin

SCENE = small_sheet(
    {"type": "payload", "at": "P1", "mass": 0.010},
    {"type": "wrench"},
    nodes=(5, 4),
    inputs=[
        {"time": 0.0, "pressure": [1.0e5, 0.8e5]},
        {"time": 0.1, "wrench": {"frame": "P0_aligned", "force": [0.0, 0.2, 0.0]}},
    ],
)
END = 0.4


@pytest.fixture(scope="session")
def lift(tmp_path_factory):
    """The bag, and link angles [rad] and node positions [m] by the time [s] of each report."""
    twin = Twin(load_scene(SCENE))
    recorder = Recorder(tmp_path_factory.mktemp("bags") / "lift", twin)
    states = {}

    def note(topic, *_):
        if topic == "nodes":
            state = twin.simulation.state
            states[round(state.time, 6)] = (state.position.copy(), np.copy(state.link_angle))

    twin.sinks += [recorder, note]
    twin.advance_to(0.2)
    twin.receive("external_wrench", messages.wrench_command(0, "P1", (0.0, 0.0, -0.3), (0.0, 0.01, 0.0)))
    twin.advance_to(END)
    recorder.close()
    return recorder.folder, states


@pytest.fixture(scope="session")
def bag(lift):
    """Folder of the bag."""
    return lift[0]


@pytest.fixture
def recording(bag):
    """The bag, opened."""
    return read_bag(bag)
