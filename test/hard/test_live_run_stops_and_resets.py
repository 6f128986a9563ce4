"""The live runner under a scene that cannot go on: nothing unsound is published, it pauses, `reset` brings it back."""

from __future__ import annotations

import threading
import time

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.messages.diagnostics import ERROR
from ldcs_ros.ros.sim.pacing import AS_FAST_AS_POSSIBLE, Pacer
from ldcs_ros.ros.sim.runner import RunMode, Runner
from ldcs_ros.ros.sim.status import health
from ldcs_ros.study.hard.scenes import HANGING, changed
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

# The sheet falls onto a floor on which this step is far above the stability limit: rk4 must stop there.
ENDS = changed(
    {**HANGING, "effects": HANGING["effects"][:2]},
    {"effects.springs.damping": 0.05, "solver": {"integrator": "rk4", "dt": 1e-4}},
    add=({"type": "floor", "height": -0.0055, "stiffness": 1e8},),
)


def _positions(messages):
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_KILTED)
    for topic, message_type, cdr, _ in messages:
        if topic == "nodes":
            cloud = store.deserialize_cdr(cdr, message_type)
            yield np.frombuffer(bytes(cloud.data), dtype=np.float32)


def test_a_run_that_cannot_go_on_pauses_with_an_error_and_reset_brings_it_back():
    published, told, failed = [], [], threading.Event()
    twin = Twin(
        load_scene(ENDS), RunSettings(publish_rate=1000.0), sinks=[lambda *message: published.append(message)]
    )

    def fail(reason):
        told.append(reason)
        failed.set()

    runner = Runner(
        twin,
        Pacer(AS_FAST_AS_POSSIBLE, tolerance=0.02),
        on_failure=fail,
        on_finish=lambda: None,
        on_reset=lambda: None,
    )
    runner.start()
    try:
        runner.call(runner.resume)
        assert failed.wait(30.0)
        assert runner.mode is RunMode.FAILED
        assert "stopped at t =" in told[0] and "node_" in told[0] and "reduce dt" in told[0]
        solver = next(status for status in health(runner, None, "", {}, 0) if status.name == "solver")
        assert solver.level == ERROR and "call reset" in solver.message
        stopped_at, count = twin.time, len(published)
        time.sleep(0.05)
        assert len(published) == count
        assert all(message[3] <= round(stopped_at * 1e9) for message in published)
        runner.call(runner.reset)
        assert runner.mode is not RunMode.FAILED and not runner.failure and twin.time < stopped_at + 1e-9
    finally:
        runner.stop()
    values = list(_positions(published))
    assert len(values) > 5 and all(np.isfinite(value).all() for value in values)
