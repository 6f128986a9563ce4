"""A bag that this project did not write: other names, millibar and millimetres, a wall clock, unstated noise."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from ldcs_ros.errors import LdcsError
from ldcs_ros.identify.experiments import Experiment, read_experiment
from ldcs_ros.identify.identify import identify
from ldcs_ros.identify.parameters import parse_parameter
from ldcs_ros.identify.prediction import predict
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.signals.mapping import parse_mapping

from .conftest import small_scene

START = 1_790_000_000_000_000_000  # ns, a wall clock
STORE = get_typestore(Stores.ROS2_HUMBLE)
MAPPING = {
    "commands": [{"topic": "/valves", "to": "pressure_command", "unit": "mbar"}],
    "measurements": [
        {"topic": "/probes", "to": "P0", "child": "trakstar0", "unit": "mm"},
        {"topic": "/probes", "to": "P1", "child": "trakstar1", "unit": "mm"},
    ],
}
STEPS = ((0.0, 0.0), (0.1, 1.2e5), (0.45, 0.6e5))  # s, Pa
NOISE = 1.0e-4  # m


def build(kind, **fields):
    return STORE.types[kind](**fields)


def valves(pressure):
    layout = build("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    return build("std_msgs/msg/Float64MultiArray", layout=layout, data=np.array([pressure / 100.0]))


def probe(time, child, place):
    stamp = build("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
    x, y, z = (float(part) for part in 1e3 * place)
    return build(
        "geometry_msgs/msg/TransformStamped",
        header=build("std_msgs/msg/Header", stamp=stamp, frame_id="trakstar_base"),
        child_frame_id=child,
        transform=build(
            "geometry_msgs/msg/Transform",
            translation=build("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        ),
    )


@pytest.fixture(scope="module")
def rig_bag(tmp_path_factory):
    """A rig whose gain is 0.9e-6 N m/Pa, recorded from rest."""
    folder = tmp_path_factory.mktemp("rig") / "bag"
    time = np.arange(72) / 80.0
    commands = tuple((at, "pressure_command", pressure_command(np.array([p, p]))) for at, p in STEPS)
    nothing = np.zeros((len(time), 2, 3))
    real = Experiment("real", commands, True, (), ("P0", "P1"), time, nothing, 1.0, "none")
    places = predict(small_scene([], gain=0.9e-6), real)
    places = places + np.random.default_rng(8).normal(0.0, NOISE, places.shape)
    messages = [(START + round(at * 1e9), "/valves", valves(pressure)) for at, pressure in STEPS]
    for at, row in zip(time, places, strict=True):
        now = START + round(at * 1e9)
        messages += [(now, "/probes", probe(now, f"trakstar{k}", row[k])) for k in range(2)]
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        kinds = {topic: message.__msgtype__ for _, topic, message in messages}
        connections = {
            topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in kinds.items()
        }
        for now, topic, message in sorted(messages, key=lambda item: item[0]):
            writer.write(connections[topic], now, STORE.serialize_cdr(message, message.__msgtype__))
    return folder


def test_a_rigs_gain_is_found_with_noise_estimated_from_its_own_data(rig_bag, guess):
    experiment = read_experiment(rig_bag, guess, mapping=parse_mapping(MAPPING))
    assert experiment.settled and experiment.schedule == ()
    assert "estimated" in experiment.noise_origin
    assert experiment.noise == pytest.approx(NOISE, rel=0.25)
    parameter = parse_parameter("effects.arms.pressure_gain", guess.content)
    found = identify(guess, [experiment], [parameter], starts=2, processes=1)
    (gain,) = found.estimates
    assert gain.low < 0.9e-6 < gain.high
    assert not found.misfit.found


def test_a_bag_without_positions_of_the_scenes_points_is_refused(rig_bag, guess):
    mapping = {**MAPPING, "measurements": [{**MAPPING["measurements"][0], "to": "elsewhere"}]}
    with pytest.raises(LdcsError, match="no tracker positions of the points"):
        read_experiment(rig_bag, guess, mapping=parse_mapping(mapping))
