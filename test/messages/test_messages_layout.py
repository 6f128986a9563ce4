"""The content of the messages, bit by bit: clouds, meshes, arrows, the tracker's axes."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import MessageTemplate, decode, header, message_class, placeholder
from ldcs_ros.messages.diagnostics import ERROR, Status, diagnostic_array
from ldcs_ros.messages.display.loads import Load, load_specs, rotate
from ldcs_ros.messages.display.marker import marker_array, specs_of
from ldcs_ros.messages.display.surface import SurfaceMesh, triangles
from ldcs_ros.messages.lattice import NodeCloud
from ldcs_ros.messages.topics import TOPICS, expand
from ldcs_ros.sensors import Measurement

RANDOM = np.random.default_rng(5)


@pytest.mark.parametrize("nodes", [(2, 2), (9, 9), (5, 3), (65, 65)])
def test_the_cloud_is_organised_by_layer_and_x_then_y(nodes):
    nx, ny = nodes
    position, velocity = RANDOM.normal(size=(2, 2 * nx * ny, 3))
    cloud = NodeCloud(nodes)
    cloud.build(1, -position, -velocity)
    message = decode("sensor_msgs/msg/PointCloud2", cloud.build(12_000_000_034, position, velocity))
    assert (message.height, message.width) == (2 * nx, ny)
    assert (message.point_step, message.row_step, message.is_bigendian) == (24, 24 * ny, False)
    assert [(f.name, f.offset, f.datatype, f.count) for f in message.fields][3] == ("vx", 12, 7, 1)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 34)
    assert message.header.frame_id == "ldcs_base"
    numbers = message.data.view("<f4").reshape(2, nx, ny, 6)
    assert np.array_equal(numbers[1, nx - 1, 0, :3], position[nx * ny + (nx - 1) * ny].astype("f4"))
    assert np.array_equal(numbers[..., 3:].reshape(-1, 3), velocity.astype("f4"))


@pytest.mark.parametrize("nodes", [(2, 2), (4, 3), (9, 9)])
def test_the_mesh_is_closed_and_seen_from_outside(nodes):
    nx, ny = nodes
    grid = np.meshgrid([0.0, 1.0], np.arange(nx), np.arange(ny), indexing="ij")
    position = np.stack([grid[1], grid[2], grid[0]], axis=-1).reshape(-1, 3)
    corners = position[triangles(nodes)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2.0
    assert np.allclose(normals.sum(axis=0), 0.0)
    volume = np.einsum("ij,ij->", corners.mean(axis=1), normals) / 3.0
    assert volume == pytest.approx((nx - 1) * (ny - 1))


def test_the_mesh_marker_holds_the_corners_in_full_precision():
    position = RANDOM.normal(size=(18, 3))
    message = decode("visualization_msgs/msg/Marker", SurfaceMesh((3, 3), 0.14).build(7, position))
    corners = np.array([[p.x, p.y, p.z] for p in message.points])
    assert np.array_equal(corners, position[triangles((3, 3)).ravel()])
    assert (message.type, message.action, message.pose.orientation.w, message.scale.x) == (11, 0, 1.0, 1.0)
    assert message.header.stamp.nanosec == 7


def test_load_arrows_replace_what_was_shown():
    load = Load("P1", np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, -0.4]))
    specs = load_specs([load])
    message = decode("visualization_msgs/msg/MarkerArray", marker_array(0, "ldcs_base", specs))
    markers = message.markers
    assert [one.action for one in markers] == [3, 0, 0]
    assert markers[1].points[1].z == pytest.approx(3.0 - 0.04)
    assert markers[2].text == "0.4 N"
    assert [one.namespace for one in specs_of(message)] == [one.namespace for one in specs]


def test_rotating_by_a_quarter_turn_about_z_takes_x_to_y():
    quarter = np.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    assert np.allclose(rotate(quarter, (1.0, 0.0, 0.0)), [0.0, 1.0, 0.0])


def test_raw_tracker_data_are_in_the_transmitters_axes():
    position, tilt = np.array([0.1, 0.2, 0.3]), 0.3
    orientation = np.array([0.0, np.sin(tilt / 2), 0.0, np.cos(tilt / 2)])
    measured = Measurement(1, "P1", 0.0, 0.0, position, orientation)
    raw = decode("geometry_msgs/msg/TransformStamped", messages.trakstar_raw(0, measured)).transform
    assert [raw.translation.x, raw.translation.y, raw.translation.z] == [-0.1, 0.2, -0.3]
    turned = np.array([raw.rotation.x, raw.rotation.y, raw.rotation.z, raw.rotation.w])
    for axis in np.eye(3):
        expected = np.array([-1.0, 1.0, -1.0]) * rotate(orientation, axis)
        assert np.allclose(rotate(turned, axis), expected)


def test_diagnostics_carry_level_and_values():
    array = decode("diagnostic_msgs/msg/DiagnosticArray", diagnostic_array(3, "/ldcs/ldcs_sim", [
        Status("recorder", ERROR, "disk full", {"messages": 5, "rate [Hz]": 0.1 + 0.2}),
    ]))  # fmt: skip
    (status,) = array.status
    assert (int(status.level), status.name, status.message) == (2, "/ldcs/ldcs_sim: recorder", "disk full")
    assert [(pair.key, pair.value) for pair in status.values] == [("messages", "5"), ("rate [Hz]", "0.3")]


def test_every_topic_has_a_type_that_is_known_and_a_meaning():
    for topic in TOPICS.values():
        assert message_class(topic.type).__msgtype__ == topic.type
        assert topic.meaning and topic.direction in ("in", "out")
    assert list(expand("truth/{point}/pose", ["P0", "tip"])) == ["truth/P0/pose", "truth/tip/pose"]


def test_a_message_without_the_block_cannot_be_patched():
    message = message_class("geometry_msgs/msg/WrenchStamped")(
        header=header(0, ""), wrench=decode("geometry_msgs/msg/Wrench", b"\x00\x01\x00\x00" + bytes(48))
    )
    with pytest.raises(ValueError, match="block of 8 bytes"):
        MessageTemplate(message, placeholder(8).size)
