"""Commands from CDR bytes to the simulation's inputs: taken whole or refused whole, and counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol

import numpy as np

from ldcs_ros.errors import CommandError
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.frames import PLAIN, Frames
from ldcs_ros.messages.message_types import (
    ArrayMessage,
    JointStateMessage,
    RosMessage,
    VectorMessage,
    WrenchStampedMessage,
)
from ldcs_ros.messages.topics import BASE_FRAME, TOPICS
from ldcs_ros.physics.effects.wrench import ALIGNED
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.twin.wrench_profile import WrenchProfile

REASONS = (
    "malformed",
    "wrong size",
    "not a number",
    "infinite",
    "over limit",
    "wrong time",
    "unknown frame",
    "unknown joint",
    "unknown arm",
    "out of order",
    "effect absent",
    "vented",
    "failed",
    "inactive",
)

_NO_PRESSURE_DRIVE = "the arms of this scene are not driven by pressure; load one with drive: pressure"
_NO_TORQUE_DRIVE = "the arms of this scene are not driven by torque; load one with drive: torque"


class ArmCommandMessage(RosMessage, Protocol):
    """An ldcs_msgs/ArmCommand."""

    sequence: int
    arms: Sequence[str]
    pressures: np.ndarray
    torques: np.ndarray


class Refusal(CommandError):
    """A refused command.

    Attributes:
        reason: One of REASONS, under which it is counted.
    """

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason


class Commands:
    """Applies commands to a simulation.

    Args:
        simulation: Its `inputs` take the commands.
        frames: Names of the frames that commands may name.

    Attributes:
        accepted: Number of commands applied, by topic.
        refused: Number of commands refused, by reason.
        last_refusal: The latest refusal in words; '' while there was none.
    """

    def __init__(self, simulation: Simulation, frames: Frames = PLAIN) -> None:
        self._simulation = simulation
        self._frames = frames
        self._apply: dict[str, Callable[..., None]] = {
            "pressure_command": self._pressure,
            "torque_command": self._torque,
            "external_wrench": self._wrench,
            "arm_command": self._arms,
        }
        self._last_sequence = -1
        self.accepted: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.last_refusal = ""

    def receive(self, topic: str, cdr: bytes) -> str:
        """Apply a command message and return the frame of its header; '' for a message without one.

        Raises:
            Refusal: Nothing changed; the refusal has been counted.
            KeyError: `topic` is not one that takes commands.
        """
        apply = self._apply[topic]
        try:
            message = _decode(topic, cdr)
            apply(message)
        except Refusal as refusal:
            self.refuse(refusal, topic)
            raise
        except Exception as error:  # unexpected: the sender is answered and the twin goes on
            failure = Refusal("failed", repr(error))
            self.refuse(failure, topic)
            raise failure from error
        self.accepted[topic] += 1
        return self._frames.local(message.header.frame_id) if hasattr(message, "header") else ""

    def count_on(self, earlier: Commands) -> None:
        """Continue the counters of the twin that this one replaces."""
        self.accepted, self.refused = earlier.accepted.copy(), earlier.refused.copy()
        self.last_refusal = earlier.last_refusal

    def refuse(self, refusal: Refusal, topic: str) -> None:
        """Count a refusal; also for those that are decided outside, such as the watchdog's."""
        self.refused[refusal.reason] += 1
        self.last_refusal = f"{topic} refused, {refusal}"

    def _pressure(self, message: ArrayMessage) -> None:
        inputs, arms = self._simulation.inputs, self._simulation.arm_names
        if inputs.pressure is None:
            raise Refusal("effect absent", _NO_PRESSURE_DRIVE)
        values = np.asarray(message.data, dtype=float)
        if values.size not in (1, len(arms)):
            expected = f"1 or {len(arms)} ({', '.join(arms)}) [Pa]"
            raise Refusal("wrong size", f"got {values.size} pressures, expected {expected}")
        _check_finite(values, "pressure [Pa]")
        _within_limits(inputs.set_pressure, float(values[0]) if values.size == 1 else tuple(values.tolist()))

    def _torque(self, message: JointStateMessage) -> None:
        inputs, known = self._simulation.inputs, list(self._simulation.joint_names)
        if inputs.torque is None:
            raise Refusal("effect absent", _NO_TORQUE_DRIVE)
        names, values = list(message.name), np.asarray(message.effort, dtype=float)
        if not names or len(names) != values.size:
            raise Refusal(
                "wrong size", f"got {values.size} efforts [N m] for {len(names)} names, expected one each"
            )
        strange = [name for name in names if name not in known]
        if strange:
            raise Refusal("unknown joint", f"got {strange[0]!r}, expected names out of {known}")
        if len(set(names)) != len(names):
            raise Refusal("wrong size", f"got a joint twice in {names}, expected each once")
        _check_finite(values, "effort [N m]")
        torque = np.array(inputs.torque, dtype=float)
        for name, value in zip(names, values, strict=True):
            torque.flat[self._simulation.joint_index[known.index(name)]] = value
        _within_limits(inputs.set_torque, torque)

    def _arms(self, message: ArmCommandMessage) -> None:
        inputs, known = self._simulation.inputs, list(self._simulation.arm_names)
        names = list(message.arms)
        if message.sequence <= self._last_sequence:
            raise Refusal("out of order", f"got number {message.sequence} after {self._last_sequence}")
        if any(name not in known for name in names):
            raise Refusal("unknown arm", f"got {names}, expected names out of {known}")
        if not names or len(set(names)) != len(names):
            raise Refusal("wrong size", f"got arms {names}, expected one or more, each once")
        if bool(message.pressures.size) == bool(message.torques.size):
            raise Refusal("wrong size", "got both or neither of pressures and torques, expected one of them")
        rows = [known.index(name) for name in names]
        if message.pressures.size:
            if inputs.pressure is None:
                raise Refusal("effect absent", _NO_PRESSURE_DRIVE)
            _check_finite(message.pressures, "pressures [Pa]")
            _within_limits(inputs.set_pressure, _replaced(inputs.pressure, rows, message.pressures))
        else:
            if inputs.torque is None:
                raise Refusal("effect absent", _NO_TORQUE_DRIVE)
            _check_finite(message.torques, "torques [N m]")
            _within_limits(inputs.set_torque, _replaced(inputs.torque, rows, message.torques))
        self._last_sequence = message.sequence

    def reset_sequence(self) -> None:
        """Take numbered commands from any number on, as after a reset or `rearm`."""
        self._last_sequence = -1

    def wrench_profile(
        self,
        *,
        point: str,
        frame_id: str,
        force: Sequence[float],
        torque: Sequence[float],
        duration: float,
        ramp: float,
        start: float,
    ) -> WrenchProfile:
        """Return the profile of a wrench that acts for a while, checked whole; nothing acts yet.

        Args:
            point: Point or node of the scene at which it acts.
            frame_id: Frame of the axes of force and torque: the base frame, or the point itself.
            force: Force at its full height [N].
            torque: Torque at its full height [N m].
            duration: Duration, ramps included [s]; 0 for until it is replaced.
            ramp: Duration of its rise, and of its fall [s].
            start: Time of its begin [s].

        Raises:
            Refusal: It has been counted.
        """
        try:
            frame = self._frames.local(point)
            self._check_wrench_at(frame, force, torque)
            if self._frames.local(frame_id) == BASE_FRAME:
                frame += ALIGNED
            elif self._frames.local(frame_id) != frame:
                expected = f"{self._frames.base!r}, or {point!r} for the axes that turn with the point"
                raise Refusal("unknown frame", f"got frame_id {frame_id!r}, expected {expected}")
            if not (duration >= 0.0 and ramp >= 0.0 and (duration == 0.0 or 2.0 * ramp <= duration)):
                expected = "times of at least 0 s, and a duration of at least two ramps, or 0 for no end"
                raise Refusal(
                    "wrong time", f"got duration {duration:g} s, ramp {ramp:g} s, expected {expected}"
                )
            _within_limits(self._simulation.inputs.check_wrench, frame, force=force, torque=torque)
        except Refusal as refusal:
            self.refuse(refusal, "apply_wrench")
            raise
        self.accepted["apply_wrench"] += 1
        return WrenchProfile.of(frame, force, torque, start=start, duration=duration, ramp=ramp)

    def hold_wrench(self, frame: str, force: Sequence[float], torque: Sequence[float]) -> None:
        """Hold a checked wrench; a zero wrench is cleared."""
        inputs = self._simulation.inputs
        if any(force) or any(torque):
            _within_limits(inputs.set_wrench, frame, force=force, torque=torque)
        else:
            inputs.clear_wrench(frame)

    def _wrench(self, message: WrenchStampedMessage) -> None:
        frame = self._frames.local(message.header.frame_id)
        force, torque = (_components(part) for part in (message.wrench.force, message.wrench.torque))
        self._check_wrench_at(frame.removesuffix(ALIGNED), force, torque)
        self.hold_wrench(frame, force, torque)

    def _check_wrench_at(self, point: str, force: Sequence[float], torque: Sequence[float]) -> None:
        if "wrench" not in self._simulation.effects:
            raise Refusal("effect absent", "the scene has no effect 'wrench'; add {type: wrench}")
        _check_finite(force, "force [N]")
        _check_finite(torque, "torque [N m]")
        try:
            self._simulation.pose(point)
        except (ValueError, KeyError) as error:
            raise Refusal("unknown frame", str(error)) from error


def _decode(topic: str, cdr: bytes) -> Any:  # as `decode`
    try:
        return decode(TOPICS[topic].type, cdr)
    except Exception as error:  # foreign bytes: the decoder fails in as many ways as there are bytes
        raise Refusal("malformed", f"not a {TOPICS[topic].type} ({error!r})") from error


def _replaced(present: np.ndarray, rows: list[int], values: np.ndarray) -> np.ndarray:
    # One value an arm, or one a joint, arm after arm; arms that are not named keep what they have.
    changed = np.array(present, dtype=float)
    if values.size == len(rows):
        changed[rows] = values.reshape(len(rows), *(1,) * (changed.ndim - 1))
    elif values.size == changed[rows].size:
        changed[rows] = values.reshape(changed[rows].shape)
    else:
        expected = f"{len(rows)} or {changed[rows].size}" if changed.ndim > 1 else f"{len(rows)}"
        raise Refusal("wrong size", f"got {values.size} values for {len(rows)} arms, expected {expected}")
    return changed


def _components(vector: VectorMessage) -> tuple[float, float, float]:
    return (float(vector.x), float(vector.y), float(vector.z))


def _check_finite(values: Iterable[float], what: str) -> None:
    array = np.asarray(tuple(values), dtype=float)
    if np.isnan(array).any():
        raise Refusal("not a number", f"got {array.tolist()}, expected finite numbers for {what}")
    if np.isinf(array).any():
        raise Refusal("infinite", f"got {array.tolist()}, expected finite numbers for {what}")


def _within_limits(setter: Callable[..., object], *arguments: object, **keywords: object) -> None:
    # Size, numbers and names have been checked: the simulation can refuse the amount only.
    try:
        setter(*arguments, **keywords)
    except CommandError as error:
        raise Refusal("over limit", str(error)) from error
