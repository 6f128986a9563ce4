"""The node's service `reach`, live: it finds commands beside the running twin, and refuses in words."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene

srv = pytest.importorskip("ldcs_msgs.srv", reason="the interface package is not built")

PRESSURES = ["pressure.left", "pressure.right"]


def ask(user, **fields):
    """Ask for pressures from 0 to 190 kPa under which P1 rests at a height."""
    fields = {
        "targets": ["P1.z"],
        "values": [0.05],
        "variables": PRESSURES,
        "lower": [0.0, 0.0],
        "upper": [190e3, 190e3],
    } | fields
    return user.call("/ldcs/ldcs_sim/reach", srv.Reach, srv.Reach.Request(**fields), timeout=30.0)


def test_commands_for_places_and_shapes_are_found_beside_the_running_twin(start):
    scene = load_scene("rig")
    _, user = start(scene="rig", duration=1e6)
    user.listen("/ldcs/nodes", "sensor_msgs/PointCloud2")
    found = ask(user)
    assert found.success and found.stable and found.distance < 1e-8 and found.solutions == 1
    twin = scene.build()
    twin.inputs.set_pressure(list(found.commands))
    twin.settle()
    assert twin.pose("P1")[0][2] == pytest.approx(0.05, abs=1e-7)
    slopes = twin.sensitivity(["P1"], PRESSURES).values[2]
    np.testing.assert_allclose(found.sensitivity, slopes, rtol=1e-4)

    far = ask(user, values=[0.5])
    assert far.success and list(far.at_bounds) == PRESSURES and far.distance > 0.3 and far.optimality < 1e-9
    shape = ask(user, targets=[], values=[], shape="cylinder:radius=-0.1", starts=2)
    assert shape.success and 0.0 < shape.distance < 0.02 and not shape.reached

    refusals = {
        "expected a point": {"targets": ["P7.z"]},
        "expected as many of each": {"values": [0.05, 0.06]},
        "bounds": {"upper": [1.0]},
        "lower bound first": {"upper": [-1.0, -1.0]},
        "axis": {"targets": ["P1"]},
        "finite": {"values": [float("nan")]},
        "expected a command": {"variables": ["pressure.up", "pressure.left"]},
        "at most 32": {"starts": 33},
        "ldcs reach": {"shape": "/etc/passwd.csv"},
        "expected sphere": {"shape": "/etc/passwd"},
    }
    for words, fields in refusals.items():
        answer = ask(user, **fields)
        assert not answer.success and words in answer.message, (words, answer.message)
    assert user.next("/ldcs/nodes")
