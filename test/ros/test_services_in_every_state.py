"""Every service of the node in every state of its lifecycle: it answers, refuses with a reason, and nothing breaks."""

from __future__ import annotations

from importlib import import_module

import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
from live import LiveNode, PlainUser, own_domain
from std_srvs.srv import Trigger

NODE = "/ldcs/ldcs_sim"
# Changes the state, and is what the test itself uses.
LEFT_OUT = {f"{NODE}/change_state"}
OK, INCORRECT_STATE, OPERATION_FAILED = 1, 3, 4
STEPS = {
    "unconfigured": [],
    "inactive": [Transition.TRANSITION_CONFIGURE],
    "active": [Transition.TRANSITION_ACTIVATE],
    "inactive again": [Transition.TRANSITION_DEACTIVATE],
    "unconfigured again": [Transition.TRANSITION_CLEANUP],
}
# Answered whenever a scene is there; the others of the standard simulator services change something.
READING = ("get_entities", "get_entities_states", "get_entity_state", "get_entity_info")
CHANGING = ("set_simulation_state", "step_simulation", "reset_simulation")


class Operator(PlainUser):
    """Somebody who drives the lifecycle and calls whatever is offered."""

    @property
    def services(self):
        """Name -> class of every service that the node offers."""
        if ("ldcs_sim", "/ldcs") not in self.node.get_node_names_and_namespaces():
            return {}
        found = self.node.get_service_names_and_types_by_node("ldcs_sim", "/ldcs")
        plain = [(name, kinds[0]) for name, kinds in sorted(found) if "/_action/" not in name]
        return {name: _class(kind) for name, kind in plain if name not in LEFT_OUT}

    def call_all(self):
        """Name -> answer to a call of every service, with a request as it is sent when nothing is filled in."""
        return {name: self.call(name, kind, _request(name, kind)) for name, kind in self.services.items()}


def _class(kind):
    package, _, name = kind.split("/")
    return getattr(import_module(f"{package}.srv"), name)


def _request(name, kind):
    request = kind.Request()
    if name.endswith("/set_simulation_state"):
        request.state.state = request.state.STATE_PLAYING
    if name.endswith(("/get_entity_state", "/get_entity_info")):
        request.entity = "P0"
    return request


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """State -> answers of all services in it, and the node's state after them."""
    domain = own_domain()
    node = LiveNode(
        tmp_path_factory.mktemp("states") / "node.log", domain, scene="single_spring", autostart=False
    )
    user, seen = Operator(domain), {}
    try:
        user.until(lambda: f"{NODE}/rearm" in user.services, timeout=20.0)
        user.spin(0.5)  # what is discovered behind it
        for state, transitions in STEPS.items():
            for transition in transitions:
                assert user.change_state(transition), state
            assert not user.change_state(99), "a transition that there is not"
            seen[state] = user.call_all()
            seen[state]["state"] = user.call(f"{NODE}/get_state", GetState).current_state.id
        assert user.change_state(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
        assert node.process.wait(10.0) == 0
        assert "Traceback" not in node.output
    finally:
        node.end()
        user.close()
    return seen


def of(answers, name):
    return answers[f"{NODE}/{name}"]


def test_every_service_answers_in_every_state_and_changes_none(answers):
    expected = [
        State.PRIMARY_STATE_UNCONFIGURED,
        State.PRIMARY_STATE_INACTIVE,
        State.PRIMARY_STATE_ACTIVE,
        State.PRIMARY_STATE_INACTIVE,
        State.PRIMARY_STATE_UNCONFIGURED,
    ]
    assert [answers[state]["state"] for state in STEPS] == expected
    names = [set(answers[state]) for state in STEPS]
    assert all(one == names[0] for one in names), "the same services in every state"
    assert len(names[0]) > 15


@pytest.mark.parametrize("state", STEPS)
def test_what_changes_something_is_refused_with_the_way_out_unless_active(answers, state):
    for name in ("pause", "resume", "reset", "rearm"):
        answer = of(answers[state], name)
        assert isinstance(answer, Trigger.Response)
        assert answer.success == (state == "active"), (name, answer)
        if state != "active":
            way_out = "configure" if state.startswith("unconfigured") else "activate"
            assert way_out in answer.message
    assert not of(answers[state], "step").success, "time runs, or the node is not active"


@pytest.mark.parametrize("state", STEPS)
def test_own_services_say_why_they_refuse(answers, state):
    pytest.importorskip("ldcs_msgs", reason="the interface package is not built")
    for name in ("apply_wrench", "load_scene", "reach"):
        answer = of(answers[state], name)
        assert not answer.success and answer.message
        if state != "active":
            assert "activate" in answer.message


@pytest.mark.parametrize("state", STEPS)
def test_the_standard_simulator_services_answer_with_the_code_for_the_state(answers, state):
    pytest.importorskip("simulation_interfaces", reason="simulation_interfaces is not installed")
    here, loaded = answers[state], not state.startswith("unconfigured")
    assert of(here, "get_simulation_state").result.result == OK
    states = {"active": {1}, "inactive": {0}, "inactive again": {2}}.get(state, {4})
    assert of(here, "get_simulation_state").state.state in states
    assert len(of(here, "get_simulator_features").features.features) > 10
    for name in READING:
        assert of(here, name).result.result == (OK if loaded else INCORRECT_STATE), name
    for name in CHANGING:
        result = of(here, name).result
        if state != "active":
            assert result.result == INCORRECT_STATE, name
            assert "activate" in result.error_message
    if state == "active":
        assert of(here, "step_simulation").result.result == OPERATION_FAILED
        assert of(here, "reset_simulation").result.result == OK
