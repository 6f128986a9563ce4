"""A bag again, exactly or on a live twin: `ros2 launch ldcs_ros replay.launch.py bag:=out/paper live:=true`."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessIO
from launch.events.process import ProcessIO
from launch_ros.substitutions import ExecutableInPackage

from ldcs_ros.bags import read_bag
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.replay.own_bag import RecordedRun, recorded_run
from ldcs_ros.ros.common.launching import PACKAGE, argument, node, process
from ldcs_ros.ros.sim.runner import RunMode

# The player starts when the twin's time has run for two seconds, and takes a moment.
LEAD = 3.0


def generate_launch_description() -> LaunchDescription:
    """`ldcs replay` on the bag, to the same bytes; or its commands by `ros2 bag play` to a twin of the same scene."""
    output = time.strftime("out/replay-%Y%m%d-%H%M%S")
    live = "true: `ros2 bag play` commands a live twin; false: `ldcs replay`, exact and as fast as possible."
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="Folder of a bag that a twin recorded; must be given."),
            DeclareLaunchArgument("live", default_value="false", choices=["true", "false"], description=live),
            argument("output", output, "Folder of the new bag."),
            OpaqueFunction(function=_replay),
        ]
    )


def _replay(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    given = context.launch_configurations
    if given["live"] == "false":
        command = [ExecutableInPackage("ldcs", PACKAGE), "replay", given["bag"], "--bag", given["output"]]
        return [process(command)]
    recording = read_bag(given["bag"])
    run = recorded_run(recording)
    if run is None:
        raise RecordingError(f"{given['bag']} is no bag of a twin; expected one that ldcs recorded")
    commands = [f"{run.namespace}/{name}" for name, topic in TOPICS.items() if topic.direction == "in"]
    held = [name for name in commands if name in recording.channels and len(recording.channels[name].times)]
    if not held:
        raise RecordingError(f"{given['bag']} holds no commands; expected messages on one of {commands}")
    values = {**_parameters(run), "record": given["output"], "duration": recording.end / 1e9 + LEAD}
    twin = node(context, "sim", values, namespace=run.namespace)
    player = ["ros2", "bag", "play", given["bag"], "--topics", *held]
    players = [process(player)]

    def play(event: ProcessIO) -> ExecuteProcess | None:
        # The twin's first line about its time; before, it compiles, and would miss the first commands.
        return players.pop() if players and RunMode.RUNNING.value.encode() in event.text else None

    settled = (
        [LogInfo(msg="The bag began at rest; this twin begins at the start of the scene.")]
        if run.settings.settled
        else []
    )
    return [*settled, RegisterEventHandler(OnProcessIO(target_action=twin, on_stderr=play)), twin]


def _parameters(run: RecordedRun) -> dict[str, Any]:
    scene = Path(tempfile.mkdtemp(prefix="ldcs_replay_"), f"{run.scene.name}.yaml")
    scene.write_text(run.scene.text, encoding="utf-8")
    settings = run.settings
    return {
        "scene": str(scene),
        "seed": -1 if settings.seed is None else settings.seed,
        "accuracy": settings.accuracy or 0.0,
        "verify": settings.verify,
        "publish_rate": settings.publish_rate,
        "tracker_rate": settings.tracker_rate or 0.0,
        "ambient_pressure": settings.ambient_pressure,
        "publish_tf": settings.publish_tf,
        "frame_prefix": settings.frame_prefix,
        "record_detail": settings.full_precision,
    }
