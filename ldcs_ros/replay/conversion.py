"""A rig's command as one of the twin's: units, arms and frames converted, whatever message carried it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ldcs_ros.messages import messages
from ldcs_ros.signals import CommandSource, MappingError, fields
from ldcs_ros.signals.intake import Intake

# A vented rig that commands absolute pressure is off by the weather and its gauge's zero [Pa].
NEAR_ZERO = 3.0e3


def converted(
    message: Any,
    message_type: str,
    source: CommandSource,
    simulation: Any,
    time_ns: int,
    intake: Intake,
    ambient_pressure: float,
) -> tuple[str, bytes] | None:
    """Return topic and message of the twin's command; None if it would change nothing.

    Raises:
        MappingError: The message is not what the mapping says.
    """
    if source.to == "pressure_command":
        return _pressure(message, message_type, source, simulation, intake, ambient_pressure)
    if source.to == "torque_command":
        return _torque(message, message_type, source, simulation, time_ns)
    return _wrench(message, source, simulation, time_ns)


def _pressure(
    message: Any, message_type: str, source: CommandSource, simulation: Any, intake: Intake, ambient: float
) -> tuple[str, bytes] | None:
    values = fields.numbers(message, source.field, message_type)
    if values.size not in (1, len(source.arms)):
        raise MappingError(f"got {values.size} pressures, expected 1 or {len(source.arms)} for {source.arms}")
    offset = fields.usual_offset(message_type, ambient) if source.offset is None else source.offset
    gauge = source.scale * values - offset
    below = (gauge < 0.0) & (gauge >= -NEAR_ZERO)
    intake.below_zero += bool(below.any())
    gauge = np.where(below, 0.0, gauge)
    present = simulation.inputs.pressure
    if present is None:  # the twin will say why it refuses
        return source.to, messages.pressure_command(gauge)
    target = present.copy()
    target[[simulation.arm_names.index(arm) for arm in source.arms]] = gauge
    return None if np.array_equal(target, present) else (source.to, messages.pressure_command(target))


def _torque(
    message: Any, message_type: str, source: CommandSource, simulation: Any, time_ns: int
) -> tuple[str, bytes] | None:
    values = source.scale * fields.numbers(message, source.field, message_type)
    joints = list(source.joints or getattr(message, "name", ()) or simulation.joint_names)
    if len(joints) != values.size:
        raise MappingError(f"got {values.size} torques for the joints {joints}, expected one each")
    present, known = simulation.inputs.torque, list(simulation.joint_names)
    if present is not None and set(joints) <= set(known):
        target = present.copy()
        for joint, value in zip(joints, values, strict=True):
            target.flat[known.index(joint)] = value
        if np.array_equal(target, present):
            return None
    return source.to, messages.torque_command(time_ns, joints, values)


def _wrench(message: Any, source: CommandSource, simulation: Any, time_ns: int) -> tuple[str, bytes] | None:
    value = fields.at_path(
        message, source.field or next((name for name in ("wrench", "vector") if hasattr(message, name)), "")
    )
    force, torque = (value.force, value.torque) if hasattr(value, "force") else (value, None)
    if not hasattr(force, "x"):
        raise MappingError("there is no force with x, y, z in the message; say where it is with 'field:'")
    frame = source.frame or message.header.frame_id
    push = tuple(source.scale * part for part in (force.x, force.y, force.z))
    turn = (0.0, 0.0, 0.0)
    if torque is not None:
        turn = (source.scale * torque.x, source.scale * torque.y, source.scale * torque.z)
    held = simulation.inputs.wrenches.get(frame)
    unchanged = (held is None and not any(push + turn)) or (
        held is not None and tuple(held.force) == push and tuple(held.torque) == turn
    )
    return None if unchanged else (source.to, messages.wrench_command(time_ns, frame, push, turn))
