"""The policy for SROS2 allows each node its actions and nothing else, and missing security is reported."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from live import LiveNode, PlainUser, own_domain

from ldcs_ros.errors import LdcsError
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.rig.rig_file import shipped_rigs
from ldcs_ros.ros.common.node_process import check_security

ROOT = Path(__file__).resolve().parents[2]
POLICY = ROOT / "ldcs_ros/config/sros2_policy.xml"
# Element -> (its attributes, what it may hold), as the schema of sros2 0.2.0 has it.
RULES = {"publish", "subscribe", "reply", "request", "call", "execute"}
ELEMENTS = {
    "policy": ({"version"}, {"enclaves"}),
    "enclaves": (set(), {"enclave"}),
    "enclave": ({"path"}, {"profiles"}),
    "profiles": (set(), {"profile"}),
    "profile": ({"ns", "node"}, {"topics", "services", "actions"}),
    "topics": ({"publish", "subscribe"}, {"topic"}),
    "services": ({"reply", "request"}, {"service"}),
    "actions": ({"call", "execute"}, {"action"}),
    "topic": (set(), set()),
    "service": (set(), set()),
    "action": (set(), set()),
}


@pytest.fixture(scope="module")
def policy():
    return ElementTree.parse(POLICY).getroot()


@pytest.fixture(scope="module")
def make_policy():
    spec = importlib.util.spec_from_file_location("make_policy", ROOT / "tools/make_policy.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def allowed(policy, node):
    """Return the full names that a node may use, by verb."""
    profile = next(one for one in policy.iter("profile") if one.get("node") == node)
    namespace = profile.get("ns").rstrip("/")
    names = {verb: set() for verb in RULES}
    for group in profile:
        for verb in group.attrib:
            for name in (one.text for one in group):
                own = name.replace("~", f"{namespace}/{node}", 1)
                names[verb].add(own if own.startswith("/") else f"{namespace}/{own}")
    return names


def test_the_policy_is_made_from_the_tables_of_the_code(make_policy):
    fresh = make_policy.policy("rig", shipped_rigs())
    assert POLICY.read_text(encoding="utf-8") == fresh, "run python tools/make_policy.py"


def test_elements_and_attributes_are_those_of_the_schema(policy):
    assert (policy.tag, policy.get("version")) == ("policy", "0.2.0")
    for element in policy.iter():
        if not isinstance(element.tag, str):
            continue  # a comment
        attributes, children = ELEMENTS[element.tag]
        assert set(element.attrib) <= attributes
        assert {child.tag for child in element if isinstance(child.tag, str)} <= children
        if element.tag in ("topics", "services", "actions"):
            assert list(element.attrib.values()) == ["ALLOW"]


def test_enclaves_are_named_as_the_nodes_are(policy):
    paths = {enclave.get("path"): enclave.find("profiles/profile") for enclave in policy.iter("enclave")}
    assert set(paths) == {"/ldcs/ldcs_sim", "/ldcs/ldcs_bridge", "/mock_rig"}
    for path, profile in paths.items():
        assert path == f"{profile.get('ns').rstrip('/')}/{profile.get('node')}"


def test_of_the_twins_topics_each_one_is_allowed_in_its_direction_only(policy):
    names = allowed(policy, "ldcs_sim")
    for topic in TOPICS.values():
        name = topic.name.format(point="P1", arm="left")
        full = name if name.startswith("/") else f"/ldcs/{name}"
        allowing, other = ("publish", "subscribe") if topic.direction == "out" else ("subscribe", "publish")
        assert full in names[allowing]
        assert full not in names[other] or full == "/clock"
    assert not names["request"] and not names["call"]
    assert not any("*" in name for verb in names.values() for name in verb)


@pytest.mark.slow
def test_what_the_live_nodes_do_in_the_graph_is_allowed(policy, tmp_path):
    domain = own_domain()
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    user = PlainUser(domain)
    sim = LiveNode(tmp_path / "sim.log", domain, scene="rig", publish_clock=True, use_sim_time=True)
    others = [
        subprocess.Popen(
            [sys.executable, "-m", "ldcs_ros.ros", program, "--ros-args", *arguments],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for program, arguments in {
            "bridge": ("-p", "rig:=controller_topics", "-p", "mode:=mirror"),
            "mock_rig": (),
        }.items()
    ]
    graph = user.node
    looks = {
        "publish": graph.get_publisher_names_and_types_by_node,
        "subscribe": graph.get_subscriber_names_and_types_by_node,
        "reply": graph.get_service_names_and_types_by_node,
        "request": graph.get_client_names_and_types_by_node,
    }
    # The last action in each node's start.
    last = {
        ("ldcs_sim", "/ldcs"): "/ldcs/traces",
        ("ldcs_bridge", "/ldcs"): "/ldcs/residual/P1",
        ("mock_rig", "/"): "/mock_rig/chambers",
    }
    try:
        for (node, namespace), topic in last.items():
            user.until(lambda topic=topic: user.node.count_publishers(topic) > 0, 20.0)
            # Its endpoints may be known before its name is.
            user.until(lambda who=(node, namespace): who in graph.get_node_names_and_namespaces(), 10.0)
            user.until(lambda who=(node, namespace): looks["reply"](*who), 10.0)
            user.spin(0.3)
            names = allowed(policy, node)
            for verb, look in looks.items():
                used = {name for name, _ in look(node, namespace)}
                actions = {name for name in used if "/_action/" in name}
                assert {name.partition("/_action/")[0] for name in actions} <= names["execute"]
                assert used - actions <= names[verb], f"{node}: {verb}"
        assert sim.stop(signal.SIGINT) == 0
    finally:
        sim.end()
        for process in others:
            process.send_signal(signal.SIGINT)
        for process in others:
            process.wait(15.0)
        user.close()


def test_security_that_would_not_be_there_is_told_or_refused():
    on = {"ROS_SECURITY_ENABLE": "true"}
    enforced = {**on, "ROS_SECURITY_STRATEGY": "Enforce"}
    assert check_security({}) == ""
    assert "names no keystore" in check_security(on)
    assert "is not Enforce" in check_security({**on, "ROS_SECURITY_KEYSTORE": "/keys"})
    assert check_security({**enforced, "ROS_SECURITY_KEYSTORE": "/keys"}) == ""
    with pytest.raises(LdcsError, match=r"names no keystore.*docs/security.md"):
        check_security(enforced)


def test_a_middleware_without_security_refuses_to_run_when_it_is_enforced(tmp_path):
    (tmp_path / "enclaves/ldcs/ldcs_sim").mkdir(parents=True)
    settings = {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_KEYSTORE": str(tmp_path),
        "ROS_DOMAIN_ID": str(own_domain()),
    }
    command = [sys.executable, "-m", "ldcs_ros.ros", "sim", "--ros-args", "--enclave", "/ldcs/ldcs_sim"]
    done = subprocess.run(command, env={**os.environ, **settings}, capture_output=True, text=True, timeout=30)
    # A distribution with DDS-Security refuses as well: there are no keys in this keystore.
    assert done.returncode == 2
    assert "sim: " in done.stderr and "Traceback" not in done.stderr
