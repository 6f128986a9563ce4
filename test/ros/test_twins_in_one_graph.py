"""Two twins in one graph: topics, services, frames and clock of each its own; quality of service as overridden."""

from __future__ import annotations

import signal
from collections import defaultdict

import pytest
from live import LiveNode, PlainUser, own_domain, stamp
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from ldcs_ros.bags import read_bag
from ldcs_ros.bags.schemas import Schemas
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.ros.common.optional import installed

OVERRIDES = {
    "qos_overrides./twin1/joint_states.publisher.reliability": "best_effort",
    "qos_overrides./twin1/joint_states.publisher.depth": 3,
    "qos_overrides./twin1/truth/P1/pose.publisher.durability": "transient_local",
    "qos_overrides./twin1/pressure_command.subscription.history": "keep_all",
    "qos_overrides./twin1/noodles.publisher.depth": 3,
}


class Twins:
    """Two live twins and a plain user beside them."""

    def __init__(self, folder):
        self.domain = own_domain()
        self.folder = folder
        self.nodes = []
        self.one = self.start("twin1", publish_clock=True, record=folder / "bag", **OVERRIDES)
        self.two = self.start("twin2", use_sim_time=False)
        self.user = PlainUser(self.domain)

    def start(self, name, **parameters):
        parameters = {"scene": "rig", "publish_tf": True, "frame_prefix": f"{name}/"} | parameters
        node = LiveNode(
            self.folder / f"{name}.log", self.domain, arguments=["-r", f"__ns:=/{name}"], **parameters
        )
        self.nodes.append(node)
        return node

    def close(self):
        for node in self.nodes:
            node.end()
        self.user.close()

    def status(self, name, entry):
        """The next entry of a twin's diagnostics: level, message, values."""
        received = self.user.received["/diagnostics"]
        received.clear()
        full = f"/{name}/ldcs_sim: {entry}"
        one = self.user.until(lambda: next((s for m in received for s in m.status if s.name == full), None))
        return ord(one.level), one.message, {pair.key: pair.value for pair in one.values}


@pytest.fixture(scope="module")
def twins(tmp_path_factory):
    running = Twins(tmp_path_factory.mktemp("twins"))
    for name in ("twin1", "twin2"):
        running.user.listen(f"/{name}/nodes", "sensor_msgs/PointCloud2")
        running.user.listen(f"/{name}/left/pressure", "sensor_msgs/FluidPressure")
    running.user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    # The first is the clock: best effort is what nodes with use_sim_time ask for.
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    running.user.node.create_subscription(
        Clock, "/clock", running.user.received["/clock"].append, best_effort
    )
    seen = [running.user.received[f"/{name}/nodes"] for name in ("twin1", "twin2")]
    try:
        running.user.until(lambda: all(seen), 30.0)
        yield running
    finally:
        running.close()


@pytest.fixture
def user(twins):
    return twins.user


def publishers(user, topic):
    return user.node.get_publishers_info_by_topic(topic)


def test_a_command_to_one_twin_reaches_no_other(twins, user):
    sender = user.publisher("/twin1/pressure_command", Float64MultiArray)
    # Both follow their scene's schedule, to 140 kPa, until the first command.
    user.until(lambda: user.next("/twin2/left/pressure").fluid_pressure > 181325.0)
    sender.publish(Float64MultiArray(data=[2.0e4]))
    user.until(lambda: user.next("/twin1/left/pressure").fluid_pressure < 131325.0)
    assert user.next("/twin2/left/pressure").fluid_pressure > 181325.0
    assert twins.status("twin1", "commands")[2]["accepted"] == "1"
    assert twins.status("twin2", "commands")[2]["accepted"] == "0"


def test_pausing_one_twin_leaves_the_other_running(user):
    assert user.call("/twin1/ldcs_sim/pause").success
    user.spin(0.2)
    user.received["/twin1/nodes"].clear()
    user.next("/twin2/nodes")
    user.next("/twin2/nodes")
    assert not user.received["/twin1/nodes"]
    assert user.call("/twin1/ldcs_sim/resume").success


def test_frames_of_two_twins_hang_in_two_trees(user):
    if not installed()["tf2_msgs"]:
        pytest.skip("tf2_msgs is not installed")
    from tf2_msgs.msg import TFMessage

    parents = defaultdict(set)

    def take(message):
        for one in message.transforms:
            parents[one.child_frame_id].add(one.header.frame_id)

    late = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    user.node.create_subscription(TFMessage, "/tf", take, 100)
    user.node.create_subscription(TFMessage, "/tf_static", take, late)
    children = [f"{twin}/{child}" for twin in ("twin1", "twin2") for child in ("P0", "P1", "trakstar_base")]
    user.until(lambda: set(children) <= set(parents))
    for twin in ("twin1", "twin2"):
        assert user.next(f"/{twin}/nodes").header.frame_id == f"{twin}/ldcs_base"
        for child in ("P0", "P1", "trakstar_base"):
            assert parents[f"{twin}/{child}"] == {f"{twin}/ldcs_base"}


def test_every_topic_has_the_type_hash_that_our_bags_hold(user):
    schemas, compared = Schemas(), set()
    ours = {topic.type for topic in TOPICS.values() if topic.direction == "out"}
    ours = {kind for kind in ours if installed().get(kind.split("/")[0], True)}
    for topic, (kind, *_) in user.node.get_topic_names_and_types():
        for info in publishers(user, topic) if kind in ours else ():
            assert str(info.topic_type_hash) == schemas[kind].type_hash, topic
            compared.add(kind)
    assert compared == ours


def test_quality_of_service_is_what_the_overrides_say(twins, user):
    (joints,), (pose,) = publishers(user, "/twin1/joint_states"), publishers(user, "/twin1/truth/P1/pose")
    (plain,) = publishers(user, "/twin2/joint_states")
    assert joints.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT
    assert plain.qos_profile.reliability is ReliabilityPolicy.RELIABLE
    assert pose.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
    assert "names no topic of this node. Did you mean '/twin1/nodes'?" in twins.one.output


def test_the_clock_is_the_first_twins_time(twins, user):
    user.received["/clock"].clear()
    clock = user.until(lambda: user.received["/clock"] and user.received["/clock"][-1]).clock
    ahead = stamp(user.next("/twin1/nodes")) - (clock.sec * 10**9 + clock.nanosec)
    assert abs(ahead) < 10**9
    assert twins.status("twin1", "clock")[:2] == (0, "the clock of this graph")


def test_a_node_that_uses_sim_time_has_the_twins_time_and_waits_with_it(user):
    follower = user.follower()
    user.until(lambda: follower.get_clock().now().nanoseconds > 0)
    assert abs(stamp(user.next("/twin1/nodes")) - follower.get_clock().now().nanoseconds) < 10**9
    assert user.call("/twin1/ldcs_sim/pause").success
    user.spin(0.2)
    stood = follower.get_clock().now()
    user.spin(0.3)
    assert follower.get_clock().now() == stood
    assert user.call("/twin1/ldcs_sim/resume").success
    user.until(lambda: follower.get_clock().now() > stood)


def test_a_second_clock_is_refused_in_one_line(twins, user):
    third = twins.start("twin3", publish_clock=True)
    assert third.process.wait(30.0) == 2
    (line,) = [line for line in third.output.splitlines() if line.startswith("sim: ")]
    assert line.startswith("sim: /clock is published already, by /twin1/ldcs_sim; a graph has one clock")
    assert "Traceback" not in third.output


def test_a_second_clock_that_comes_later_is_told_once_and_stands_in_the_diagnostics(twins, user):
    intruder = user.node.create_publisher(Clock, "/clock", 1)
    user.until(lambda: twins.status("twin1", "clock")[0] == 2)
    assert "/plain_user" in twins.status("twin1", "clock")[1]
    assert twins.one.output.count("a second clock") == 1
    user.node.destroy_publisher(intruder)
    user.until(lambda: twins.status("twin1", "clock")[0] == 0)


def test_a_twin_that_is_no_clock_follows_none(twins, user):
    answer = user.set_parameters(node="/twin2/ldcs_sim", use_sim_time=True).results[0]
    assert not answer.successful and "publish_clock" in answer.reason
    assert user.set_parameters(node="/twin1/ldcs_sim", use_sim_time=True).results[0].successful
    fourth = twins.start("twin4", use_sim_time=True)
    assert fourth.process.wait(30.0) == 2
    (line,) = [line for line in fourth.output.splitlines() if line.startswith("sim: ")]
    assert line.startswith("sim: use_sim_time is true, but the twin keeps its own time")


def test_the_bag_says_what_was_offered(twins, user):
    assert twins.one.stop(signal.SIGINT) == 0
    bag = read_bag(twins.folder / "bag")
    joints, pose = (bag.topics[f"/twin1/{name}"].qos for name in ("joint_states", "truth/P1/pose"))
    assert (joints.reliability, joints.depth, pose.durability) == ("best_effort", 3, "transient_local")
    assert bag.topics["/twin1/pressure_command"].qos.history == "keep_all"


def test_an_override_that_cannot_be_is_one_line_and_exit_2(start):
    node, _ = start(with_user=False, **{"qos_overrides./ldcs/nodes.publisher.reliability": "relable"})
    assert node.process.wait(30.0) == 2
    (line,) = [line for line in node.output.splitlines() if line.startswith("sim: ")]
    assert "'qos_overrides./ldcs/nodes.publisher.reliability' is 'relable', expected one of reliable" in line
    assert "Traceback" not in node.output
