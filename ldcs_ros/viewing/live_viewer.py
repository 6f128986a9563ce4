"""A live view of a running twin from its messages, of any transport."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.display.marker import specs_of
from ldcs_ros.messages.message_types import StampedMessage
from ldcs_ros.schema.units import STANDARD_ATMOSPHERE
from ldcs_ros.signals.tracks import CLOUD, JOINTS, POSE, PRESSURE, cloud_nodes, cloud_positions
from ldcs_ros.viewing.blueprint import blueprint
from ldcs_ros.viewing.rerun_package import Stream
from ldcs_ros.viewing.rerun_scene import ARMS, LOADS, RerunScene

MARKERS = "visualization_msgs/msg/MarkerArray"
MM, KPA = 1e3, 1e-3
# Each piece of a curve costs a kilobyte, so that curves are drawn in every fifth call.
_CURVES_EVERY = 5
_BACK = 1e-6  # s: a larger step back restarts the view


def is_shown(topic: str, message_type: str) -> bool:
    """Return whether a view shows a topic, by its name in the twin's namespace."""
    last = topic.split("/")[-1]
    return (last, message_type) in {
        ("nodes", CLOUD),
        ("pose", POSE),
        ("joint_states", JOINTS),
        ("pressure", PRESSURE),
        (ARMS, MARKERS),
        (LOADS, MARKERS),
    } and not topic.startswith(("estimate/", "rig/"))


class LiveViewer:
    """A collector of messages; `draw` shows the latest surfaces and markers, and all points of the curves.

    A reset of the twin, which sets the time back, starts a new recording.

    Args:
        new_stream: Function that returns an empty rerun stream to the viewer.

    Attributes:
        ambient_pressure: Absolute pressure of the twin's air [Pa]; gauge pressures are drawn above it.
    """

    def __init__(self, new_stream: Callable[[], Stream]) -> None:
        self.ambient_pressure = STANDARD_ATMOSPHERE
        self._new_stream = new_stream
        self._latest: dict[str, tuple[str, bytes]] = {}
        self._rows: dict[str, list[tuple[float, np.ndarray]]] = {}
        self._joint_names: tuple[str, ...] = ()
        self._time = -np.inf
        self._surfaces = 0
        self._begin()

    def receive(self, topic: str, message_type: str, cdr: bytes) -> None:
        """Add one message of a shown topic; the topic's name is relative to the twin's namespace."""
        if message_type in (CLOUD, MARKERS):
            self._latest[topic] = (message_type, cdr)
            return
        message = decode(message_type, cdr)
        time = _stamp(message)
        if message_type == POSE:
            place = message.pose.position
            self._add(topic, time, [place.x, place.y, place.z])
        elif message_type == PRESSURE:
            self._add(topic, time, [message.fluid_pressure])
        else:
            self._joint_names = tuple(message.name)
            self._add(topic, time, [*message.effort, *message.position])

    def draw(self) -> int:
        """Draw the messages since the last call; return the number of surfaces so far."""
        latest, self._latest = self._latest, {}
        rows, self._rows = self._rows, {}
        decoded = {topic: decode(*taken) for topic, taken in latest.items()}
        times = [_stamp(one) for one in decoded.values() if hasattr(one, "header")]
        times += [row[0][0] for row in rows.values()]
        if times and max(times) < self._time - _BACK:
            self.close()
            self._begin()
        self._time = max([self._time, *times])
        for topic, message in decoded.items():
            if topic == "nodes":
                self._surfaces += 1
                self._rerun_scene.sheet(_stamp(message), cloud_nodes(message), cloud_positions(message))
            elif len(message.markers) > 0:
                entity = ARMS if topic == ARMS else LOADS
                self._rerun_scene.specs(entity, _stamp(message.markers[0]), specs_of(message))
        for topic, row in rows.items():
            times_of, values = np.array([time for time, _ in row]), np.array([value for _, value in row])
            parts = topic.split("/")
            if parts[0] == "truth":
                self._rerun_scene.points(times_of, {parts[-2]: values})
            self._waiting.setdefault(topic, []).append((times_of, values))
        self._draws += 1
        if self._draws % _CURVES_EVERY == 0:
            self._draw_curves()
        self._lay_out()
        return self._surfaces

    def close(self) -> None:
        """End the recording; it holds all received messages."""
        self._draw_curves()
        self._stream.disconnect()

    def _begin(self) -> None:
        self._stream = self._new_stream()
        self._rerun_scene = RerunScene(self._stream)
        self._time = -np.inf
        self._surfaces = 0
        self._draws = 0
        self._waiting: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        self._origins: dict[str, np.ndarray] = {}
        self._laid_out: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())

    def _add(self, topic: str, time: float, values: list[float]) -> None:
        self._rows.setdefault(topic, []).append((time, np.array(values)))

    def _draw_curves(self) -> None:
        waiting, self._waiting = self._waiting, {}
        for topic, rows in waiting.items():
            times, values = (np.concatenate(part) for part in zip(*rows, strict=True))
            self._draw_curve(topic, times, values)

    def _draw_curve(self, topic: str, times: np.ndarray, values: np.ndarray) -> None:
        parts = topic.split("/")
        if parts[-1] == "pose":
            name, truth = parts[-2], parts[0] == "truth"
            origin = self._origins.setdefault(topic, values[0])
            title = f"{name} {'state' if truth else 'tracker'}: displacement from the first pose [mm]"
            self._rerun_scene.curves(title, "xyz", times, MM * (values - origin), dots=not truth)
        elif parts[-1] == "pressure":
            self._rerun_scene.curves(
                "gauge pressure [kPa]", [parts[-2]], times, KPA * (values - self.ambient_pressure)
            )
        else:
            half = values.shape[1] // 2
            self._rerun_scene.curves("drive torque [N m]", self._joint_names, times, values[:, :half])
            angle = np.rad2deg(values[:, half:])
            self._rerun_scene.curves("joint angle [deg]", self._joint_names, times, angle)

    def _lay_out(self) -> None:
        there = (tuple(self._rerun_scene.point_names), tuple(self._rerun_scene.plots))
        if there != self._laid_out and self._surfaces > 0:
            self._laid_out = there
            self._stream.send_blueprint(
                blueprint(
                    self._rerun_scene.point_names,
                    dict(sorted(self._rerun_scene.plots.items())),
                    play="following",
                )
            )


def _stamp(message: StampedMessage) -> float:
    """Return the time of a message with a header [s]."""
    stamp = message.header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec)
