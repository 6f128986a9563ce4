"""The reports of a twin: each outgoing message built from the state and handed on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import nanoseconds
from ldcs_ros.messages.display.markers import MARKER_TOPICS, DrawableState, Markers
from ldcs_ros.messages.display.robot_model import RobotModel
from ldcs_ros.messages.frames import Frames
from ldcs_ros.messages.lattice import NodeCloud, lattice_state
from ldcs_ros.messages.topics import TOPICS, Topic, expand
from ldcs_ros.physics.state import State
from ldcs_ros.sensors import Measurement, PressureSensorParameters, TrackerParameters
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.twin.settings import RunSettings

Emit = Callable[[Topic, bytes, int], None]


class Reports:
    """A builder of the outgoing messages of one simulation.

    Args:
        simulation: The simulation that is reported.
        emit: Receiver of each message: topic, CDR bytes, time [ns].
        settings: The settings of the run.
        has_subscribers: Returns by name whether a topic that is built on demand has subscribers.
        tracker: Parameters of the tracker; None for none.
        pressure: Parameters of the pressure sensors; None for none.
        frames: Names of the frames.

    Attributes:
        topics: Every topic that may be emitted, by name.
    """

    def __init__(
        self,
        simulation: Simulation,
        emit: Emit,
        settings: RunSettings,
        *,
        has_subscribers: Callable[[str], bool],
        tracker: TrackerParameters | None,
        pressure: PressureSensorParameters | None,
        frames: Frames,
    ) -> None:
        self._simulation = simulation
        self._emit = emit
        self._settings = settings
        self._has_subscribers = has_subscribers
        self._cloud = NodeCloud(
            simulation.lattice.nodes, frames.base, is_dense=not simulation.lattice.missing.size
        )
        self._markers = Markers(simulation.scene, frames.base)
        self._truth = {point: f"truth/{point}/pose" for point in simulation.points}
        self._variance = 0.0 if pressure is None else pressure.noise**2
        self._frames = frames
        self.topics = {name: TOPICS[name] for name in ("nodes", *MARKER_TOPICS)}
        for name in ("lattice_state", "solver_status"):
            self.topics[name] = replace(TOPICS[name], recorded=settings.full_precision)
        self.topics |= expand("truth/{point}/pose", simulation.points)
        if simulation.arm_names:
            self.topics |= {name: TOPICS[name] for name in ("joint_states", "robot_description")}
        if tracker is not None:
            self.topics |= expand("{point}/pose", tracker.points)
            self.topics |= {name: TOPICS[name] for name in ("trakstar_msg", "trakstar_raw_msg")}
        if pressure is not None:
            self.topics |= expand("{arm}/pressure", simulation.arm_names)
        if settings.publish_clock:
            self.topics["/clock"] = TOPICS["/clock"]
        if settings.publish_tf:
            self.topics |= {name: TOPICS[name] for name in ("/tf", "/tf_static")}

    @cached_property
    def _robot(self) -> RobotModel:
        simulation = self._simulation
        return RobotModel(simulation.lattice, simulation.points, simulation.scene.effects)

    def report_static(self, time: float) -> None:
        """Report the fixed transform of the tracker's base at a time [s], and the URDF of the arms."""
        if self._settings.publish_tf:
            identity = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
            base = messages.transform(nanoseconds(time), self._frames.base, self._frames.tracker, *identity)
            self._send("/tf_static", messages.transforms([base]), nanoseconds(time))
        if self._simulation.arm_names:
            self._send("robot_description", messages.text(self._robot.description()), nanoseconds(time))

    def report_clock(self, time: float, state: State) -> None:
        """Report the simulation time [s] on /clock."""
        self._send("/clock", messages.clock(nanoseconds(time)), nanoseconds(time))

    def report_transforms(self, time: float, state: State) -> None:
        """Report the frames of the points and of the arms' links at a time [s] on /tf."""
        now, base, named = nanoseconds(time), self._frames.base, self._frames.named
        stamped = [
            messages.transform(now, base, named(point), *self._simulation.points[point].pose(state.position))
            for point in self._truth
        ]
        if self._simulation.arm_names and self._settings.link_frames:
            links = self._robot.link_poses(state.link_angle)
            stamped += [messages.transform(now, base, named(link), *pose) for link, pose in links.items()]
        self._send("/tf", messages.transforms(stamped), now)

    def report_state(self, time: float, state: State) -> None:
        """Report a state at its time [s]: nodes, true poses, joints, and markers with subscribers."""
        simulation, now, base = self._simulation, nanoseconds(time), self._frames.base
        self._send("nodes", self._cloud.build(now, state.position, state.velocity), now)
        poses = {name: simulation.points[name].pose(state.position) for name in self._truth}
        for point, topic in self._truth.items():
            self._send(topic, messages.pose(now, *poses[point], frame=base), now)
        if simulation.arm_names:
            values = (state.joint_angle, state.joint_rate, simulation.joint_torque)
            joints = (value.ravel()[simulation.joint_index] for value in values)
            self._send("joint_states", messages.joint_states(now, simulation.joint_names, *joints), now)
        if self._settings.full_precision or self._has_subscribers("lattice_state"):
            message = lattice_state(now, base, simulation.lattice, simulation.arm_names, state)
            self._send("lattice_state", message, now)
        self._report_markers(now, state, {point: position for point, (position, _) in poses.items()})

    def _report_markers(self, now: int, state: State, places: Mapping[str, np.ndarray]) -> None:
        self._markers.follow(now, places)
        subscribed = [name for name in MARKER_TOPICS if self._has_subscribers(name)]
        if subscribed:
            shown = DrawableState(state.position, state.link_angle, self._simulation.inputs.wrenches)
            for name in subscribed:
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

    def report_pressure(self, time: float, gauge: np.ndarray) -> None:
        """Report measured gauge pressures [Pa], shape (n_arms,), at a time [s] as absolute ones."""
        now = nanoseconds(time)
        for arm, value in zip(self._simulation.arm_names, gauge.tolist(), strict=True):
            absolute = value + self._settings.ambient_pressure
            message = messages.fluid_pressure(now, self._frames.base, absolute, self._variance)
            self._send(f"{arm}/pressure", message, now)

    def _send(self, topic: str, cdr: bytes, time_ns: int) -> None:
        self._emit(self.topics[topic], cdr, time_ns)
