"""What the twin reports: builds each message from the simulation and hands it on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import nanoseconds
from ldcs_ros.messages.display.markers import MARKER_TOPICS, Markers, Shown
from ldcs_ros.messages.frames import Frames
from ldcs_ros.messages.solver_status import lattice_state
from ldcs_ros.messages.surface import NodeCloud
from ldcs_ros.messages.topics import TOPICS, Topic, expand
from ldcs_ros.sensors import Measurement, PressureSensorParameters, TrackerParameters

Emit = Callable[[Topic, bytes, int], None]


class Outputs:
    """Builds the outgoing messages of one simulation.

    Args:
        simulation: What is reported.
        emit: Takes each message: topic, CDR bytes, time [ns].
        wanted: Tells by name whether somebody listens to a topic that is built on demand.
        tracker: The tracker, if the scene has one.
        pressure_sensor: The pressure sensors, if the scene has them.
        ambient_pressure: Absolute pressure of the surrounding air [Pa].
        publish_clock: Report /clock.
        publish_tf: Report /tf and /tf_static.
        frames: Names of the frames.
        detail: Report `lattice_state` also when nobody wants it; bags hold it then, and `solver_status`.

    Attributes:
        topics: Every topic that may come, by name.
    """

    def __init__(
        self,
        simulation: Any,
        emit: Emit,
        *,
        wanted: Callable[[str], bool],
        tracker: TrackerParameters | None,
        pressure_sensor: PressureSensorParameters | None,
        ambient_pressure: float,
        publish_clock: bool,
        publish_tf: bool,
        frames: Frames,
        detail: bool,
    ) -> None:
        self._simulation = simulation
        self._emit = emit
        self._wanted = wanted
        self._ambient_pressure = ambient_pressure
        self._cloud = NodeCloud(simulation.lattice.nodes, frames.base)
        self._markers = Markers(simulation.scene, frames.base)
        self._truth = {point: f"truth/{point}/pose" for point in simulation.points}
        self._variance = 0.0 if pressure_sensor is None else pressure_sensor.noise**2
        self._publish_clock = publish_clock
        self._publish_tf = publish_tf
        self._frames = frames
        self._detail = detail
        self.topics = {name: TOPICS[name] for name in ("nodes", *MARKER_TOPICS)}
        for name in ("lattice_state", "solver_status"):
            self.topics[name] = replace(TOPICS[name], recorded=detail)
        self.topics |= expand("truth/{point}/pose", simulation.points)
        if simulation.arm_names:
            self.topics["joint_states"] = TOPICS["joint_states"]
        if tracker is not None:
            self.topics |= expand("{point}/pose", tracker.points)
            self.topics |= {name: TOPICS[name] for name in ("trakstar_msg", "trakstar_raw_msg")}
        if pressure_sensor is not None:
            self.topics |= expand("{arm}/pressure", simulation.arm_names)
        if publish_clock:
            self.topics["/clock"] = TOPICS["/clock"]
        if publish_tf:
            self.topics |= {name: TOPICS[name] for name in ("/tf", "/tf_static")}

    def report_static(self, time: float) -> None:
        """Report what never changes: where the tracker's base stands."""
        if self._publish_tf:
            still = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
            base = messages.transform(nanoseconds(time), self._frames.base, self._frames.tracker, *still)
            self._send("/tf_static", messages.transforms([base]), nanoseconds(time))

    def report_state(self) -> None:
        """Report the present state: clock, nodes, true poses, joints, tf, and the markers that are wanted."""
        simulation, state = self._simulation, self._simulation.state
        now, base = nanoseconds(simulation.time), self._frames.base
        if self._publish_clock:
            self._send("/clock", messages.clock(now), now)
        self._send("nodes", self._cloud.build(now, state.position, state.velocity), now)
        poses = {point: simulation.pose(point) for point in self._truth}
        for point, topic in self._truth.items():
            self._send(topic, messages.pose(now, *poses[point], frame=base), now)
        if simulation.arm_names:
            joints = (state.joint_angle, state.joint_rate, simulation.joint_torque)
            self._send("joint_states", messages.joint_states(now, simulation.joint_names, *joints), now)
        if self._publish_tf:
            named = self._frames.named
            stamped = [messages.transform(now, base, named(point), *pose) for point, pose in poses.items()]
            self._send("/tf", messages.transforms(stamped), now)
        if self._detail or self._wanted("lattice_state"):
            self._send("lattice_state", lattice_state(now, base, simulation), now)
        self._report_markers(now, state, {point: position for point, (position, _) in poses.items()})

    def _report_markers(self, now: int, state: Any, places: Mapping[str, np.ndarray]) -> None:
        self._markers.follow(now, places)
        wanted = [name for name in MARKER_TOPICS if self._wanted(name)]
        if wanted:
            shown = Shown(state.position, state.link_angle, self._simulation.inputs.wrenches)
            for name in wanted:
                self._send(name, self._markers.build(name, now, shown), now)

    def report_tracker(self, measured: Iterable[Measurement]) -> None:
        """Report delivered measurements: poses stamped when measured, driver messages when delivered."""
        for one in measured:
            delivered = nanoseconds(one.delivered)
            pose = messages.pose(
                nanoseconds(one.time), one.position, one.orientation, frame=self._frames.base
            )
            self._send(f"{one.point}/pose", pose, delivered)
            self._send("trakstar_msg", messages.trakstar(delivered, one, self._frames), delivered)
            self._send("trakstar_raw_msg", messages.trakstar_raw(delivered, one, self._frames), delivered)

    def report_pressure(self, gauge: np.ndarray) -> None:
        """Report measured gauge pressures [Pa], shape (n_arms,), as absolute ones."""
        now = nanoseconds(self._simulation.time)
        for arm, value in zip(self._simulation.arm_names, gauge.tolist(), strict=True):
            absolute = value + self._ambient_pressure
            message = messages.fluid_pressure(now, self._frames.base, absolute, self._variance)
            self._send(f"{arm}/pressure", message, now)

    def _send(self, topic: str, cdr: bytes, time_ns: int) -> None:
        self._emit(self.topics[topic], cdr, time_ns)
