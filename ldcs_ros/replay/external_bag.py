"""The commands of a bag that another recorder wrote: mapped, ordered, converted to the twin's units and counted."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.messages import messages
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals import CommandSource, Mapping, MappingError, fields
from ldcs_ros.signals.channels import ChannelReport, read_channel
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.twin.commands import Commands, Refusal

# A vented rig that commands absolute pressure is off by the weather and its gauge's zero [Pa].
NEAR_ZERO = 3.0e3


def converted(
    message: object,
    message_type: str,
    source: CommandSource,
    simulation: Simulation,
    time_ns: int,
    report: ChannelReport,
    ambient_pressure: float,
) -> tuple[str, bytes] | None:
    """Return topic and message of the twin's command; None if it would change nothing.

    Raises:
        MappingError: The message does not fit the mapping.
    """
    if source.to == "pressure_command":
        return _pressure(message, message_type, source, simulation, report, ambient_pressure)
    if source.to == "torque_command":
        return _torque(message, message_type, source, simulation, time_ns)
    return _wrench(message, source, simulation, time_ns)


def _pressure(
    message: object,
    message_type: str,
    source: CommandSource,
    simulation: Simulation,
    report: ChannelReport,
    ambient: float,
) -> tuple[str, bytes] | None:
    values = fields.numbers(message, source.field, message_type)
    known = simulation.arm_names
    arms = source.arms or known
    if values.size not in (1, len(arms)):
        raise MappingError(f"got {values.size} pressures, expected 1 or {len(arms)} for {arms}")
    offset = fields.default_offset(message_type, ambient) if source.offset is None else source.offset
    gauge = source.scale * values - offset
    below = (gauge < 0.0) & (gauge >= -NEAR_ZERO)
    report.below_zero += bool(below.any())
    gauge = np.where(below, 0.0, gauge)
    present = simulation.inputs.pressure
    if present is None:  # the twin refuses it with a reason
        return source.to, messages.pressure_command(gauge)
    target = present.copy()
    target[[known.index(arm) for arm in arms]] = gauge
    return None if np.array_equal(target, present) else (source.to, messages.pressure_command(target))


def _torque(
    message: object, message_type: str, source: CommandSource, simulation: Simulation, time_ns: int
) -> tuple[str, bytes] | None:
    values = source.scale * fields.numbers(message, source.field, message_type)
    joints = list(source.joints or getattr(message, "name", ()) or simulation.joint_names)
    if len(joints) != values.size:
        raise MappingError(f"got {values.size} torques for the joints {joints}, expected one each")
    present, known = simulation.inputs.torque, list(simulation.joint_names)
    if present is not None and set(joints) <= set(known):
        target = present.copy()
        for joint, value in zip(joints, values, strict=True):
            target.flat[simulation.joint_index[known.index(joint)]] = value
        if np.array_equal(target, present):
            return None
    return source.to, messages.torque_command(time_ns, joints, values)


def _wrench(
    message: object, source: CommandSource, simulation: Simulation, time_ns: int
) -> tuple[str, bytes] | None:
    value = fields.at_path(
        message, source.field or next((name for name in ("wrench", "vector") if hasattr(message, name)), "")
    )
    force, torque = getattr(value, "force", value), getattr(value, "torque", None)
    if not hasattr(force, "x"):
        raise MappingError("there is no force with x, y, z in the message; name its field with 'field:'")
    frame = source.frame or str(fields.at_path(message, "header.frame_id"))
    wrench = Wrench(
        *(
            (0.0, 0.0, 0.0)
            if vector is None
            else tuple(source.scale * getattr(vector, axis) for axis in "xyz")
            for vector in (force, torque)
        )
    )
    if wrench == simulation.inputs.wrenches.get(frame, Wrench()):
        return None
    return source.to, messages.wrench_command(time_ns, frame, wrench.force, wrench.torque)


@dataclass(frozen=True)
class MappedCommand:
    """A command of a rig, converted at its time: one topic may command some of the arms.

    Attributes:
        time: Simulation time at which it acts [ns].
        after: None: the command follows all messages of that time, as it does live.
        source: Description of its topic.
        message: The message object.
        type: Its type.
        report: Counts of its topic.
        ambient_pressure: Pressure of the surrounding air [Pa].
    """

    time: int
    after: int | None
    source: CommandSource
    message: object
    type: str
    report: ChannelReport
    ambient_pressure: float

    def command(self, simulation: Simulation) -> tuple[str, bytes] | None:
        """Return topic and CDR message of the converted command; None for a malformed message, which is counted."""
        try:
            return converted(
                self.message,
                self.type,
                self.source,
                simulation,
                self.time,
                self.report,
                self.ambient_pressure,
            )
        except MappingError as error:
            self.report.malformed += 1
            self.report.problem = self.report.problem or str(error)
            return None

    def refused(self, reason: str) -> None:
        """Count a refusal by its reason."""
        self.report.refused[reason] += 1


def check_arms(mapping: Mapping, known: tuple[str, ...]) -> None:
    """Check that the scene has each arm of a mapping.

    Raises:
        MappingError: It has not.
    """
    for index, source in enumerate(mapping.commands):
        if not set(source.arms) <= set(known):
            raise MappingError(
                f"got {list(source.arms)}, expected arms of the scene {list(known)} @ commands[{index}].arms"
            )


def begun_scene(scene: Scene, mapping: Mapping, commands: Sequence[MappedCommand]) -> Scene:
    """Return the scene at whose rest state, or start, a recording begins: its schedule holds what acts before.

    Args:
        scene: The scene; its own schedule is left out.
        mapping: Its `initial` says how the recording begins.
        commands: The commands by time.
    """
    begun = scene.without_schedule()
    if mapping.initial != "held" or not commands:
        return begun
    simulation = begun.build()
    receiver = Commands(simulation)
    for timed in commands:
        if timed.time > commands[0].time:
            break
        # Counted again when it acts.
        command = replace(timed, report=ChannelReport(timed.source.topic)).command(simulation)
        if command is not None:
            with contextlib.suppress(Refusal):
                receiver.receive(*command)
    inputs = simulation.inputs
    asked = {"pressure": inputs.pressure, "torque": inputs.torque}
    held = {kind: value.tolist() for kind, value in asked.items() if value is not None and value.any()}
    return begun.edited(inputs=[{"time": 0.0, **held}]) if held else begun


def mapped_commands(
    recording: Recording, mapping: Mapping
) -> tuple[list[MappedCommand], list[ChannelReport], int]:
    """Return the commands by time, the report of each topic, and the log time of simulation time zero [ns].

    Simulation time begins with the bag.

    Raises:
        MappingError: A mapped topic is not in the bag, or no command is mapped.
    """
    if not mapping.commands:
        raise MappingError(
            f"no topic of {recording.name} is mapped to a command; name one in a mapping file (--map), "
            f"the bag has {sorted(recording.topics)}"
        )
    origin = recording.start
    commands: list[MappedCommand] = []
    reports: dict[str, ChannelReport] = {}
    for source in mapping.commands:
        # Several sources may read one topic: it is counted once.
        report = ChannelReport(source.topic)
        decoded = read_channel(
            recording, source.topic, report, by=mapping.time or "log", late=mapping.late, gap=mapping.gap
        )
        report = reports.setdefault(source.topic, report)
        message_type = recording.topics[source.topic].type
        commands += [
            MappedCommand(
                max(0, one.time - origin),
                None,
                source,
                one.message,
                message_type,
                report,
                mapping.ambient_pressure,
            )
            for one in decoded
        ]
    return sorted(commands, key=lambda command: command.time), list(reports.values()), origin
