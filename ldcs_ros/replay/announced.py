"""The commands of the arms that a replay knows beforehand, as a simulation takes announcements."""

from __future__ import annotations

from collections.abc import Sequence

from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.replay.drive import TimedCommand
from ldcs_ros.scene.scene import Scene
from ldcs_ros.twin.commands import Commands, Refusal
from ldcs_ros.twin.twin import ARM_COMMANDS


def announced_commands(
    scene: Scene, commands: Sequence[TimedCommand], *, start: float
) -> list[ScheduledCommand]:
    """Return the commands of the arms that a twin of a scene will apply, by time.

    They are tried on inputs of their own, so that those without an effect and those that are refused are left out.

    Args:
        scene: The scene of the twin.
        commands: All commands, by time.
        start: Simulation time at which the twin begins [s].
    """
    simulation = scene.build()
    receiver, inputs = Commands(simulation), simulation.inputs
    kind = "pressure" if inputs.pressure is not None else "torque"
    found: list[ScheduledCommand] = []
    for timed in commands:
        given = timed.command(simulation)
        if given is None or given[0] not in ARM_COMMANDS:
            continue
        try:
            receiver.receive(*given)
        except Refusal:
            continue
        value = getattr(inputs, kind)
        found.append(ScheduledCommand(max(timed.time / 1e9, start), **{kind: value.tolist()}))
    return found
