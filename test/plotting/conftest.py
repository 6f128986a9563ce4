"""Recordings of short runs, made once for all tests of pictures."""

from __future__ import annotations

import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.bags import Recording
from ldcs_ros.bags.recording import Message
from ldcs_ros.twin.recorder import run_metadata
from ldcs_ros.twin.twin import Twin

SCENE = small_sheet(
    {"type": "payload", "at": "P1", "mass": 0.010},
    {"type": "force", "at": ["top", 4, 0], "value": [0.0, 0.1, 0.0]},
    nodes=(5, 4),
    inputs=[{"time": 0.0, "pressure": [1.0e5, 0.8e5]}],
    sensors={"tracker": {"points": ["P1"], "rate": 80.0, "delay": 0.02}, "pressure": {"rate": 100.0}},
)


def recorded(scene, *, until):
    """Return a run of a scene, recorded in memory under the names that a bag has."""
    messages = []
    twin = Twin(
        scene,
        sinks=[lambda *message: messages.append(Message("/ldcs/" + message[0].strip("/"), *message[1:]))],
    )
    twin.advance_to(until)
    return Recording.from_messages(messages, custom_data=run_metadata(twin))


@pytest.fixture
def record():
    return recorded


@pytest.fixture(scope="session")
def scene():
    return load_scene(SCENE)


@pytest.fixture(scope="session")
def recording(scene):
    return recorded(scene, until=0.4)


@pytest.fixture(scope="session")
def still(scene):
    """A recording of one moment."""
    return recorded(scene, until=0.0)
