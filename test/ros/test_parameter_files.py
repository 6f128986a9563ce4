"""The example parameter files: each names every parameter of its node, and the node itself takes it without a word."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from live import own_domain

from ldcs_ros.ros.parameters import PARAMETERS
from ldcs_ros.ros.rig_parameters import BRIDGE_PARAMETERS, MOCK_RIG_PARAMETERS

CONFIG = Path(__file__).resolve().parents[2] / "ldcs_ros/config"
TABLES = {"sim": PARAMETERS, "bridge": BRIDGE_PARAMETERS, "mock_rig": MOCK_RIG_PARAMETERS}
# What each says when it has started.
STARTED = {"sim": "mm ended", "bridge": "t     0.00 s", "mock_rig": "a bridge connects"}


@pytest.mark.parametrize("node", TABLES)
def test_an_example_names_each_parameter_with_a_value_of_its_type(node):
    content = yaml.safe_load((CONFIG / f"{node}.yaml").read_text(encoding="utf-8"))
    values = content["/**"]["ros__parameters"]
    assert list(values) == list(TABLES[node])
    for name, value in values.items():
        parameter = TABLES[node][name]
        assert type(value) is type(parameter.default), name
        assert parameter.low is None or parameter.low <= value <= parameter.high, name


@pytest.mark.parametrize("node", TABLES)
def test_the_node_takes_its_example_and_complains_of_nothing(node, tmp_path):
    command = [sys.executable, "-m", f"ldcs_ros.ros.{node}_node"]
    command += ["--ros-args", "--params-file", str(CONFIG / f"{node}.yaml")]
    if node == "sim":
        command += ["-p", "duration:=0.1"]
    log = tmp_path / "log"
    environment = {**os.environ, "ROS_DOMAIN_ID": str(own_domain())}
    with open(log, "w") as stream:
        process = subprocess.Popen(
            command, env=environment, stdout=stream, stderr=stream, start_new_session=True
        )
    try:
        end = time.monotonic() + 45.0
        while STARTED[node] not in log.read_text():
            assert time.monotonic() < end and process.poll() in (None, 0), log.read_text()
            time.sleep(0.1)
        if node != "sim":
            os.killpg(process.pid, signal.SIGINT)
        assert process.wait(15.0) == 0, log.read_text()
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait(10.0)
    said = log.read_text()
    assert not [word for word in ("WARN", "ERROR", "ignored", "refused", "expected") if word in said], said
