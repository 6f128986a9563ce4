"""The commanded pressures of a recording: the schedule of its scene and the commands of its topics, as steps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from ldcs_ros.bags import Recording
from ldcs_ros.physics.effects.arms import Arms
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals.topics import find_topic
from ldcs_ros.signals.tracks import Track, seconds

_PRESSURES, _ARMS = "std_msgs/msg/Float64MultiArray", "ldcs_msgs/msg/ArmCommand"


class _PressureMessage(Protocol):
    data: ArrayLike


class _ArmMessage(Protocol):
    arms: list[str]
    pressures: ArrayLike


def commanded_pressures(recording: Recording, scene: Scene | None, end: float) -> dict[str, Track]:
    """Return the commanded gauge pressures [Pa] by arm, each as the corners of its steps.

    A command that the twin refuses (not finite, over the limit, of a wrong size) makes no step.

    Args:
        recording: A Recording.
        scene: Its scene, whose arms the commands mean; None, or a scene without pressure drive, has no commands.
        end: Time at which the last command ends [s].
    """
    arms = None if scene is None else scene.effect("arms")
    if scene is None or not isinstance(arms, Arms) or arms.drive != "pressure":
        return {}
    placed = arms.placed(scene.lattice)
    names = [arm.name for arm in placed]
    limit = np.array([arm.own.get("pressure_limit", arms.pressure_limit) for arm in placed], dtype=float)
    sent = sorted(_sent(recording, names), key=lambda command: command[0])
    overridden = sent[0][0] if sent else np.inf
    schedule = [
        (entry.time, np.broadcast_to(np.asarray(entry.pressure, dtype=float), len(names)))
        for entry in scene.inputs
        if entry.pressure is not None and entry.time < overridden
    ]
    held = np.zeros(len(names))
    corners: list[tuple[float, np.ndarray]] = [(0.0, held)]
    for time, value in [*schedule, *sent]:
        asked = np.where(np.isnan(value), held, value)
        if time <= end and ((asked >= 0.0) & (asked <= limit)).all():
            corners += [(time, held), (time, asked)]
            held = asked
    corners.append((end, held))
    times = np.array([time for time, _ in corners])
    values = np.array([value for _, value in corners])
    return {name: Track(times, values[:, number]) for number, name in enumerate(names)}


def _sent(recording: Recording, names: list[str]) -> Iterator[tuple[float, np.ndarray]]:
    """Yield time [s] and pressures [Pa] of each command of the right size; NaN keeps an arm's pressure."""
    topic = find_topic(recording, "pressure_command", _PRESSURES)
    if topic is not None:
        channel = recording.channels[topic]
        for time, message in zip(seconds(channel.times, recording.start), channel.messages, strict=True):
            data = np.asarray(cast(_PressureMessage, message).data, dtype=float)
            if data.size in (1, len(names)) and np.isfinite(data).all():
                yield float(time), np.broadcast_to(data, len(names))
    topic = find_topic(recording, "arm_command", _ARMS)
    if topic is not None:
        channel = recording.channels[topic]
        for time, message in zip(seconds(channel.times, recording.start), channel.messages, strict=True):
            command = cast(_ArmMessage, message)
            values = dict(zip(command.arms, np.asarray(command.pressures, dtype=float), strict=False))
            if values and set(values) <= set(names) and np.isfinite(list(values.values())).all():
                yield float(time), np.array([values.get(name, np.nan) for name in names])
