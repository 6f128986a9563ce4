"""The standard simulator services of a live node, as a user of another simulator calls them."""

from __future__ import annotations

import re
import signal

import numpy as np
import pytest

pytest.importorskip("simulation_interfaces", reason="simulation_interfaces is not installed")

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Vector3
from lifecycle_msgs.msg import Transition
from live import LiveNode, PlainUser, own_domain, stamp
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from simulation_interfaces import srv
from simulation_interfaces.action import SimulateSteps
from simulation_interfaces.msg import (
    Bounds,
    EntityCategory,
    EntityFilters,
    Resource,
    Result,
    SimulationState,
    SimulatorFeatures,
    TagsFilter,
)

from ldcs_ros.ros.simulator.answers import usual_name

PERIOD_NS = 20_000_000
NODES = "/ldcs/nodes"
STATES = {"stopped": 0, "playing": 1, "paused": 2, "quitting": 3}


HANGING = """\
title: Mine
lattice: {size: [0.14, 0.14, 0.01], nodes: [3, 3], mass: 0.16}
effects:
  - {type: springs, law: axial, stiffness: 80.0, damping: 5.0}
  - {type: gravity}
  - {type: clamp, edge: x_min}
"""


class Operator(PlainUser):
    """A user of the standard services."""

    _client = None

    def ask(self, kind, **fields):
        """The answer to a call of the service with the usual name."""
        service = getattr(srv, kind)
        # A world that is loaded may have its kernels compiled.
        timeout = 45.0 if kind == "LoadWorld" else 10.0
        return self.call(f"/ldcs/ldcs_sim/{usual_name(kind)}", service, service.Request(**fields), timeout)

    def set_state(self, word):
        """The result code of a change of state."""
        return self.ask("SetSimulationState", state=SimulationState(state=STATES[word])).result.result

    @property
    def state(self):
        number = self.ask("GetSimulationState").state.state
        return next(word for word, one in STATES.items() if one == number)

    def time_of(self, entity="P1"):
        """Return the simulation time [ns] as the stamp of an entity's state."""
        return stamp(self.ask("GetEntityState", entity=entity).state)

    def names(self, **filters):
        answer = self.ask("GetEntities", filters=EntityFilters(**filters))
        return answer.entities if answer.result.result == Result.RESULT_OK else answer.result.result

    def _action_client(self):
        if self._client is None:
            self._client = ActionClient(
                self.node,
                SimulateSteps,
                "/ldcs/ldcs_sim/simulate_steps",
                feedback_sub_qos_profile=QoSProfile(depth=100),
            )
            self.until(self._client.server_is_ready)
            # The server may find the subscription to its feedback a little later.
            self.spin(0.5)
        return self._client

    def begin(self, steps):
        """Send a goal; the future of its handle, and the list that its feedback goes into."""
        told = []
        sent = self._action_client().send_goal_async(
            SimulateSteps.Goal(steps=steps), feedback_callback=lambda message: told.append(message.feedback)
        )
        self.until(sent.done)
        return sent, told

    def simulate(self, steps, enough=lambda feedback: False):
        """Send a goal, cancel it when feedback is enough; status, result and all feedback."""
        sent, told = self.begin(steps)
        ended = sent.result().get_result_async()
        self.until(lambda: ended.done() or (told and enough(told[-1])))
        if not ended.done():
            self.until(sent.result().cancel_goal_async().done)
        self.until(ended.done)
        return ended.result().status, ended.result().result.result, told


@pytest.fixture(scope="module")
def user(tmp_path_factory):
    """The paper's scene, live for all tests of this file."""
    domain = own_domain()
    folder = tmp_path_factory.getbasetemp()
    node = LiveNode(
        tmp_path_factory.mktemp("simulator") / "node.log", domain, scene="paper", graph_folder=folder
    )
    user = Operator(domain)
    try:
        user.listen(NODES, "sensor_msgs/PointCloud2")
        user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
        # Its kernels may have to be compiled.
        user.until(lambda: user.received[NODES], timeout=45.0)
        yield user
    finally:
        node.end()
        user.close()


@pytest.fixture
def paused(user):
    user.set_state("paused")
    assert user.state == "paused"
    return user


def test_the_features_are_those_whose_services_are_there(user):
    features = user.ask("GetSimulatorFeatures").features
    numbers = features.features.tolist()
    names = {name for name in dir(SimulatorFeatures) if getattr(SimulatorFeatures, name) in numbers}
    assert {"ENTITY_STATE_GETTING", "SIMULATION_RESET", "STEP_SIMULATION_ACTION", "ENTITY_TAGS"} <= names
    never = {"SPAWNING", "DELETING", "ENTITY_STATE_SETTING", "SIMULATION_RESET_TIME", "ENTITY_BOUNDS_CONVEX"}
    assert not names & never
    assert "publish_rate" in features.custom_info
    assert user.diagnostics("interfaces")["simulation_interfaces"].startswith("in use")


def test_the_state_goes_from_playing_to_paused_to_stopped_and_back(user):
    response = srv.SetSimulationState.Response
    user.set_state("playing")
    assert user.set_state("playing") == response.ALREADY_IN_TARGET_STATE
    assert user.set_state("paused") == Result.RESULT_OK
    assert user.state == "paused" and user.time_of() > 0
    assert user.set_state("stopped") == Result.RESULT_OK
    assert user.state == "stopped" and user.time_of() == 0
    assert user.ask("StepSimulation").result.result == Result.RESULT_OPERATION_FAILED
    assert user.time_of() == 0
    assert user.set_state("paused") == Result.RESULT_OK
    assert user.time_of() == 0, "paused from the start on, without a step"
    assert user.set_state("playing") == Result.RESULT_OK
    user.until(lambda: user.time_of() > 0)
    assert user.set_state("stopped") == Result.RESULT_OK
    assert user.set_state("playing") == Result.RESULT_OK


@pytest.mark.parametrize("number", [4, 5, 77])
def test_a_state_that_cannot_be_asked_for_is_refused(user, number):
    result = user.ask("SetSimulationState", state=SimulationState(state=number)).result
    assert result.result == srv.SetSimulationState.Response.INCORRECT_TRANSITION
    assert "playing (1)" in result.error_message


def test_steps_are_publish_periods_and_leave_it_paused(paused):
    before = paused.time_of()
    paused.received[NODES].clear()
    assert paused.ask("StepSimulation").result.result == Result.RESULT_OK
    assert paused.ask("StepSimulation", steps=4).result.result == Result.RESULT_OK
    clouds = paused.received[NODES]
    paused.until(lambda: len(clouds) == 5)
    assert np.diff([stamp(cloud) for cloud in clouds]).tolist() == [PERIOD_NS] * 4
    assert paused.time_of() - before <= 5 * PERIOD_NS
    assert paused.state == "paused"
    assert paused.ask("StepSimulation", steps=0).result.result == Result.RESULT_OK


def test_steps_are_refused_while_time_runs(user):
    user.set_state("playing")
    result = user.ask("StepSimulation").result
    assert result.result == Result.RESULT_OPERATION_FAILED
    assert "paused" in result.error_message
    status, result, told = user.simulate(3)
    assert (status, result.result) == (GoalStatus.STATUS_ABORTED, Result.RESULT_OPERATION_FAILED)
    assert "paused" in result.error_message and not told


def test_the_action_tells_of_each_step(paused):
    before = paused.time_of()
    status, result, told = paused.simulate(20)
    assert (status, result.result) == (GoalStatus.STATUS_SUCCEEDED, Result.RESULT_OK)
    # rclpy's client drops feedback that arrives after the end.
    assert told and {one.completed_steps + one.remaining_steps for one in told} == {20}
    assert np.diff([one.completed_steps for one in told]).tolist() == [1] * (len(told) - 1)
    assert 19 * PERIOD_NS < paused.time_of() - before <= 20 * PERIOD_NS


def test_the_action_can_be_cancelled_and_leaves_whole_steps(paused):
    status, result, told = paused.simulate(2**63, enough=lambda feedback: feedback.completed_steps >= 5)
    assert status == GoalStatus.STATUS_CANCELED
    taken = int(re.fullmatch(r"cancelled after (\d+) of \d+ steps", result.error_message)[1])
    assert taken >= told[-1].completed_steps >= 5
    assert paused.time_of() % PERIOD_NS == 0
    assert paused.ask("StepSimulation").result.result == Result.RESULT_OK


@pytest.mark.parametrize(
    ("service", "fields", "state"),
    [
        ("SetSimulationState", {"state": SimulationState(state=STATES["playing"])}, "playing"),
        ("SetSimulationState", {"state": SimulationState(state=STATES["stopped"])}, "stopped"),
        ("ResetSimulation", {}, "paused"),
    ],
)
def test_who_lets_time_run_or_resets_ends_the_steps_of_others(paused, service, fields, state):
    kind = getattr(srv, service)
    other = paused.node.create_client(kind, f"/ldcs/ldcs_sim/{usual_name(service)}")
    paused.until(other.service_is_ready)
    request, asked = kind.Request(**fields), []

    def enough(feedback):
        if not asked:
            asked.append(other.call_async(request))
        return False

    status, result, told = paused.simulate(10**6, enough=enough)
    assert (status, result.result) == (GoalStatus.STATUS_ABORTED, Result.RESULT_OPERATION_FAILED)
    taken = int(re.search(r"(\d+) of 1000000 steps were taken", result.error_message)[1])
    assert taken >= told[-1].completed_steps
    assert paused.state == state
    paused.node.destroy_client(other)


def test_a_reset_takes_time_and_state_together(paused):
    request = srv.ResetSimulation.Request
    assert paused.ask("StepSimulation", steps=2).result.result == Result.RESULT_OK
    for scope in (request.SCOPE_TIME, request.SCOPE_STATE, request.SCOPE_SPAWNED, 5):
        assert paused.ask("ResetSimulation", scope=scope).result.result == Result.RESULT_FEATURE_UNSUPPORTED
    assert paused.time_of() > 0
    for scope in (request.SCOPE_DEFAULT, request.SCOPE_ALL, request.SCOPE_TIME | request.SCOPE_STATE):
        assert paused.ask("StepSimulation", steps=2).result.result == Result.RESULT_OK
        assert paused.ask("ResetSimulation", scope=scope).result.result == Result.RESULT_OK
        assert paused.time_of() == 0
    assert paused.state == "paused"


def test_entities_are_chosen_by_name_category_tag_and_place(paused):
    paused.set_state("stopped")
    assert len(paused.names()) == 2 + 162 + 8
    assert paused.names(filter="P[01]") == ["P0", "P1"]
    assert paused.names(filter="P") == []
    links = [f"{arm}_link_{number}" for arm in ("left", "right") for number in (1, 2, 3, 4)]
    robot = EntityCategory(category=EntityCategory.CATEGORY_ROBOT)
    assert paused.names(categories=[robot]) == links
    still = EntityCategory(category=EntityCategory.CATEGORY_STATIC_OBJECT)
    assert len(paused.names(categories=[still])) == 18
    assert paused.names(tags=TagsFilter(tags=["left", "point"])) == ["P0", "P1", *links[:4]]
    both = TagsFilter(tags=["node", "clamped"], filter_mode=TagsFilter.FILTER_MODE_ALL)
    assert len(paused.names(tags=both)) == 18
    corners = [Vector3(x=0.139, y=-1.0, z=0.0), Vector3(x=0.141, y=1.0, z=0.1)]
    box = Bounds(type=Bounds.TYPE_BOX, points=corners)
    found = paused.names(bounds=box)
    assert set(found) == {"P1", "left_link_4", "right_link_4", *(f"node_top_8_{j}" for j in range(9))}
    sphere = Bounds(type=Bounds.TYPE_SPHERE, points=[Vector3(x=0.07), Vector3(x=0.006)])
    assert paused.names(bounds=sphere) == ["P0", "node_bottom_4_4", "node_top_4_4"]


@pytest.mark.parametrize(
    ("filters", "code"),
    [
        ({"filter": "P["}, Result.RESULT_OPERATION_FAILED),
        ({"tags": TagsFilter(filter_mode=9)}, Result.RESULT_OPERATION_FAILED),
        ({"bounds": Bounds(type=Bounds.TYPE_SPHERE)}, Result.RESULT_OPERATION_FAILED),
        ({"bounds": Bounds(type=Bounds.TYPE_CONVEX_HULL)}, Result.RESULT_FEATURE_UNSUPPORTED),
    ],
)
def test_filters_that_mean_nothing_are_refused(user, filters, code):
    assert user.names(**filters) == code


def test_states_are_the_truth_in_the_base_frame(paused):
    paused.listen("/ldcs/truth/P1/pose", "geometry_msgs/PoseStamped")
    paused.until(lambda: paused.node.count_publishers("/ldcs/truth/P1/pose"))
    paused.until(lambda: paused.ask("StepSimulation") and paused.received["/ldcs/truth/P1/pose"])
    paused.spin(0.1)
    truth = paused.received["/ldcs/truth/P1/pose"][-1]
    state = paused.ask("GetEntityState", entity="P1").state
    assert state.header == truth.header
    assert numbers(state.pose) == pytest.approx(numbers(truth.pose), abs=1e-12)
    answer = paused.ask("GetEntitiesStates", filters=EntityFilters(filter="P1|left_link_1"))
    assert answer.entities == ["P1", "left_link_1"]
    assert answer.states[0] == state
    link = answer.states[1]
    assert link.pose.position.y > 0.05
    assert link.twist.angular.x == link.twist.angular.z == 0.0


def numbers(pose):
    """Position and orientation of a pose as a list."""
    parts = [(pose.position, "xyz"), (pose.orientation, "xyzw")]
    return [getattr(part, axis) for part, axes in parts for axis in axes]


def test_an_entity_tells_what_it_is(user):
    info = user.ask("GetEntityInfo", entity="right_link_2").info
    assert info.category.category == EntityCategory.CATEGORY_ROBOT
    assert (info.description, info.tags[0]) == ("link 2 of the right arm, counted from its base", "link")
    for kind in ("GetEntityInfo", "GetEntityState"):
        result = user.ask(kind, entity="P7").result
        assert result.result == Result.RESULT_NOT_FOUND and "GetEntities" in result.error_message


def test_an_entity_cannot_be_put_somewhere(user):
    result = user.ask("SetEntityState", entity="P1", set_pose=True).result
    assert result.result == Result.RESULT_FEATURE_UNSUPPORTED
    assert "external_wrench" in result.error_message


def test_worlds_are_the_scenes_and_are_chosen_by_their_effects(user, tmp_path):
    worlds = user.ask("GetAvailableWorlds").worlds
    assert {"paper", "rig", "hanging_sheet"} <= {world.name for world in worlds}
    assert all(world.world_resource.uri == world.name and world.description for world in worlds)
    both = TagsFilter(tags=["arms", "support"], filter_mode=TagsFilter.FILTER_MODE_ALL)
    assert "rig" in [world.name for world in user.ask("GetAvailableWorlds", filter=both).worlds]
    (tmp_path / "mine.yaml").write_text(HANGING)
    mine = user.ask("GetAvailableWorlds", additional_sources=[str(tmp_path)]).worlds[-1]
    assert (mine.name, mine.world_resource.uri) == ("mine", str(tmp_path / "mine.yaml"))
    missing = user.ask("GetAvailableWorlds", additional_sources=["/no/such/folder"])
    assert missing.result.result == Result.RESULT_OPERATION_FAILED and not missing.worlds
    too_long = user.ask("GetAvailableWorlds", additional_sources=["x" * 5000])
    assert too_long.result.result == Result.RESULT_OPERATION_FAILED and not too_long.worlds
    user.set_state("paused")
    assert user.ask("GetCurrentWorld").world.name == "paper"


def test_a_world_is_loaded_by_name_or_text_and_left_stopped(start, tmp_path):
    (tmp_path / "x.sdf").write_text("<sdf/>")
    node, _ = start(with_user=False, scene="paper", graph_folder=tmp_path)
    user = Operator(node.domain)
    response = srv.LoadWorld.Response
    try:
        user.until(lambda: user.state == "playing", timeout=45.0)
        for resource, code in (
            (Resource(), response.NO_RESOURCE),
            (Resource(uri="no_such_scene"), Result.RESULT_NOT_FOUND),
            (Resource(uri=str(tmp_path / "x.sdf")), response.UNSUPPORTED_FORMAT),
            (Resource(uri=__file__), Result.RESULT_NOT_FOUND),
            (Resource(resource_string="title: nothing\n"), response.RESOURCE_PARSE_ERROR),
        ):
            assert user.ask("LoadWorld", world_resource=resource).result.result == code
        assert user.state == "playing" and user.ask("GetCurrentWorld").world.name == "paper"
        answer = user.ask("LoadWorld", world_resource=Resource(uri="single_spring"))
        assert (answer.result.result, answer.world.name) == (Result.RESULT_OK, "single_spring")
        assert user.state == "stopped" and user.names(filter=".*_link_.*") == []
        assert user.time_of("node_top_1_1") == 0
        answer = user.ask("LoadWorld", world_resource=Resource(resource_string=HANGING))
        assert answer.world.description == "Mine" and answer.world.tags == ["clamp", "gravity", "springs"]
        assert answer.world.world_resource.resource_string == HANGING
        assert len(user.names()) == 18
        assert user.set_state("playing") == Result.RESULT_OK
        user.until(lambda: user.time_of("node_top_1_1") > 0)
    finally:
        user.close()


def test_steps_under_way_end_with_the_node_s_activity_and_do_not_keep_it_alive(start):
    node, _ = start(with_user=False, scene="single_spring")
    user = Operator(node.domain)
    try:
        user.until(lambda: user.set_state("paused") == Result.RESULT_OK, timeout=45.0)
        asked = []

        def deactivate(feedback):
            if not asked:
                asked.append(feedback)
                assert user.change_state(Transition.TRANSITION_DEACTIVATE)
                assert user.change_state(Transition.TRANSITION_CLEANUP)
            return False

        status, result, _ = user.simulate(2**40, enough=deactivate)
        assert (status, result.result) == (GoalStatus.STATUS_ABORTED, Result.RESULT_INCORRECT_STATE)
        assert "steps were taken" in result.error_message
        assert user.change_state(Transition.TRANSITION_CONFIGURE)
        assert user.change_state(Transition.TRANSITION_ACTIVATE)
        assert user.set_state("paused") == Result.RESULT_OK
        user.begin(2**40)
        assert node.stop(signal.SIGINT) == 0
    finally:
        user.close()
    assert "Traceback" not in node.output and "Exception" not in node.output


def test_quitting_closes_the_bag_and_ends_the_process(start, tmp_path):
    node, _ = start(with_user=False, scene="single_spring", record=tmp_path / "bag")
    user = Operator(node.domain)
    try:
        assert user.set_state("quitting") == Result.RESULT_OK
        assert node.process.wait(10.0) == 0
    finally:
        user.close()
    assert (tmp_path / "bag" / "metadata.yaml").is_file()
    assert "Traceback" not in node.output
