"""The example parameter files: complete, taken by the nodes without a word; and the services that these then offer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml
from live import PlainUser, own_domain

from ldcs_ros.ros.common.service_table import BRIDGE_SERVICES, SIM_SERVICES
from ldcs_ros.ros.rig.rig_parameters import BRIDGE_PARAMETERS, MOCK_RIG_PARAMETERS
from ldcs_ros.ros.sim.parameters import PARAMETERS

CONFIG = Path(__file__).resolve().parents[2] / "ldcs_ros/config"
TABLES = {"sim": PARAMETERS, "bridge": BRIDGE_PARAMETERS, "mock_rig": MOCK_RIG_PARAMETERS}
SERVICES = {"sim": SIM_SERVICES, "bridge": BRIDGE_SERVICES, "mock_rig": ()}
NAMES = {"sim": ("/ldcs", "ldcs_sim"), "bridge": ("/ldcs", "ldcs_bridge"), "mock_rig": ("/", "mock_rig")}
# The line that each node prints after its start.
STARTED = {"sim": "mm running", "bridge": " s | shadow, ", "mock_rig": "a bridge connects"}
# Services that every node has.
STANDARD = ("rcl_interfaces/", "lifecycle_msgs/", "type_description_interfaces/")


@pytest.fixture(scope="module", params=TABLES)
def example(request, tmp_path_factory):
    """Run a node with its example until it has started and end it as Ctrl-C does: its name, output and services."""
    node, domain = request.param, own_domain()
    log = tmp_path_factory.mktemp(node) / "log"
    command = [sys.executable, "-m", "ldcs_ros.ros", node]
    command += ["--ros-args", "--params-file", str(CONFIG / f"{node}.yaml")]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    with open(log, "w") as stream:
        process = subprocess.Popen(
            command, env=environment, stdout=stream, stderr=stream, start_new_session=True
        )
    user = PlainUser(domain)
    try:
        user.until(lambda: STARTED[node] in log.read_text() or process.poll() is not None, 45.0)
        assert process.poll() is None, log.read_text()
        services = offered(user, *NAMES[node])
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(15.0) == 0, log.read_text()
    finally:
        user.close()
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait(10.0)
    return node, log.read_text(), services


def offered(user, namespace, name):
    """Return the services of a node beyond those that every node has, named as in the table, with their types."""
    own = f"{namespace.rstrip('/')}/{name}/"

    def services():
        user.spin(0.1)
        found = user.node.get_service_names_and_types_by_node(name, namespace)
        return {
            service.replace(own, "~/").removeprefix(f"{namespace}/"): kinds[0]
            for service, kinds in found
            if not kinds[0].startswith(STANDARD) and "/_action/" not in service
        }

    user.until(lambda: (name, namespace) in user.node.get_node_names_and_namespaces())
    before, now = None, services()
    end = time.monotonic() + 10.0
    while before != now and time.monotonic() < end:
        before = now
        user.spin(0.4)
        now = services()
    return now


@pytest.mark.parametrize("node", TABLES)
def test_an_example_names_each_parameter_with_a_value_of_its_type(node):
    content = yaml.safe_load((CONFIG / f"{node}.yaml").read_text(encoding="utf-8"))
    values = content["/**"]["ros__parameters"]
    assert list(values) == list(TABLES[node])
    for name, value in values.items():
        parameter = TABLES[node][name]
        assert type(value) is type(parameter.default), name
        in_range = parameter.low is None or parameter.low <= value <= parameter.high
        assert in_range or value == parameter.off, name


def test_the_node_takes_its_example_and_complains_of_nothing(example):
    _node, said, _ = example
    assert not [word for word in ("WARN", "ERROR", "ignored", "refused", "expected") if word in said], said


def test_the_services_of_a_node_are_those_of_the_reference(example):
    node, _, services = example
    # Services of packages, or versions of them, that are not installed are documented all the same.
    assert services == {one.name: one.type for one in SERVICES[node] if is_installed(one.type)}


def is_installed(kind):
    """Tell whether a service type can be imported here; actions do not count."""
    package, family, name = kind.split("/")
    return family == "srv" and bool(find_spec(package)) and hasattr(import_module(f"{package}.srv"), name)
