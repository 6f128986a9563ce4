"""A replay from end to end: bag in, bag out, and a report of its commands and of the comparison."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ldcs_ros.bags import Recording, read_bag
from ldcs_ros.errors import DivergenceError, SceneError
from ldcs_ros.replay.announced import announced_commands
from ldcs_ros.replay.drive import Outcome, TimedCommand, drive
from ldcs_ros.replay.external_bag import begun_scene, check_arms, mapped_commands
from ldcs_ros.replay.own_bag import RecordedRun, recorded_run, timeline
from ldcs_ros.replay.span import check_span
from ldcs_ros.replay.verdict import Verdict, compare_runs
from ldcs_ros.scene.scene import Scene
from ldcs_ros.signals import Mapping, guess_mapping
from ldcs_ros.signals.channels import ChannelReport
from ldcs_ros.signals.tables import open_recording
from ldcs_ros.signals.topics import recorded_scene
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

# A scene with a fixed step promises no accuracy; two platforms still round almost alike [m].
FIXED_STEP_ALLOWED = 1e-6


@dataclass(frozen=True)
class Changes:
    """The deviations of a replay from the original.

    Attributes:
        scene: Another scene; None for the recorded one.
        seed: Another seed; None for the recorded one.
        accuracy: Another accuracy [m]; None for the recorded one.
        duration: Time from the start to the end [s]; None for the recorded end.
    """

    scene: Scene | None = None
    seed: int | None = None
    accuracy: float | None = None
    duration: float | None = None

    @property
    def none(self) -> bool:
        """The replay is of the same run."""
        return self == Changes()


@dataclass(frozen=True)
class Replay:
    """The result of a replay.

    Attributes:
        twin: The twin at the end.
        outcome: Counts of the commands.
        reports: Report of each mapped topic; empty for a bag of our own.
        verdict: Comparison with the original; None if it is another run by intent.
        recorder: The bag that was written.
        start: Simulation time at which it began [s].
        notes: Omitted parts of the bag, in words.
    """

    twin: Twin
    outcome: Outcome
    reports: tuple[ChannelReport, ...]
    verdict: Verdict | None
    recorder: Recorder
    start: float
    notes: tuple[str, ...] = ()

    @property
    def took_no_command(self) -> bool:
        """The mapped topics have messages, and each one is malformed or refused."""
        sound = (report.messages - report.malformed - report.refused.total() for report in self.reports)
        return any(report.messages for report in self.reports) and sum(max(0, count) for count in sound) == 0


def replay(
    bag: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    changes: Changes | None = None,
    mapping: Mapping | None = None,
    progress: Callable[[float, float], None] = lambda time, end: None,
    stop: Callable[[], bool] = lambda: False,
) -> Replay:
    """Run the commands of a bag through a twin and write its messages into a new bag.

    A bag of our own is repeated unchanged; with a mapping it is read like a rig's.

    Args:
        bag: The bag, or a table (CSV, Parquet).
        folder: The new bag.
        changes: Deviations from the original.
        mapping: Meaning of a rig's topics or a table's columns; None to go by names and types.
        progress: Called with the simulation time and the end [s].
        stop: Asked at each event; True ends early.

    Raises:
        RecordingError: A bag cannot be read or written.
        SceneError: The bag names no scene and none was given, or it is not sound.
        MappingError: The mapping does not fit the bag.
        DivergenceError: The simulation cannot go on; the bag holds all messages before that.
    """
    changes = changes or Changes()
    recording, mapping = open_recording(bag, mapping)
    if changes.duration is None:
        check_span(recording)
    run = recorded_run(recording) if mapping is None else None
    if run is not None:
        return _replay_own(recording, run, Path(folder), changes, progress, stop)
    return _replay_foreign(
        recording, mapping or guess_mapping(recording), Path(folder), changes, progress, stop
    )


def _replay_own(
    recording: Recording,
    run: RecordedRun,
    folder: Path,
    changes: Changes,
    progress: Callable[[float, float], None],
    stop: Callable[[], bool],
) -> Replay:
    settings = replace(
        run.settings,
        seed=run.settings.seed if changes.seed is None else changes.seed,
        accuracy=changes.accuracy or run.settings.accuracy,
    )
    twin = Twin(changes.scene or run.scene, settings)
    recorded = timeline(recording, namespace=run.namespace, topics=twin.topics)
    start = twin.time
    end, last = recorded.end, recorded.last
    if changes.duration is not None:
        end, last = round((start + changes.duration) * 1e9), None
    if settings.known_commands == "all":
        known = [command for command in recorded.commands if command.time <= end]
        twin.simulation.announce(announced_commands(twin.scene, known, start=start))
    recorder = Recorder(
        folder, twin, namespace=run.namespace, custom_data={"replay_of": Path(recording.name).name}
    )
    outcome = _run(twin, recorded.commands, recorder, end=end, last=last, progress=progress, stop=stop)
    verdict = None
    if changes.none and not outcome.interrupted and recorder.error is None:
        verdict = compare_runs(
            recording,
            read_bag(folder),
            allowed=twin.simulation.accuracy or FIXED_STEP_ALLOWED,
            differing=run.differing_versions,
        )
    return Replay(twin, outcome, (), verdict, recorder, start, recording.notes)


def _replay_foreign(
    recording: Recording,
    mapping: Mapping,
    folder: Path,
    changes: Changes,
    progress: Callable[[float, float], None],
    stop: Callable[[], bool],
) -> Replay:
    scene = changes.scene or recorded_scene(recording)
    if scene is None:
        raise SceneError(
            f"{recording.name} carries no scene; name the scene that describes it, such as --scene rig"
        )
    commands, reports, origin = mapped_commands(recording, mapping)
    settings = RunSettings(
        seed=changes.seed,
        accuracy=changes.accuracy,
        ambient_pressure=mapping.ambient_pressure,
        settled=mapping.initial != "start",
        known_commands="all",
    )
    twin = Twin(begun_scene(scene, mapping, commands), settings)
    check_arms(mapping, twin.simulation.arm_names)
    start = round(twin.time * 1e9)
    # A scene may come to rest only later: the bag begins at that time.
    commands = [replace(command, time=command.time + start) for command in commands]
    end = start + (recording.end - origin if changes.duration is None else round(changes.duration * 1e9))
    # A bag holds the commands that were given: its own replay knows no more of them. Counted again when they act.
    known = [replace(one, report=ChannelReport(one.report.topic)) for one in commands if one.time <= end]
    twin.simulation.announce(announced_commands(twin.scene, known, start=twin.time))
    said = {"replay_of": Path(recording.name).name, "log_time_of_start": str(origin - start)}
    recorder = Recorder(folder, twin, custom_data=said)
    outcome = _run(twin, commands, recorder, end=end, last=None, progress=progress, stop=stop)
    return Replay(twin, outcome, tuple(reports), None, recorder, start / 1e9, recording.notes)


def _run(
    twin: Twin,
    commands: Sequence[TimedCommand],
    recorder: Recorder,
    *,
    end: int,
    last: int | None,
    progress: Callable[[float, float], None],
    stop: Callable[[], bool],
) -> Outcome:
    twin.sinks.append(recorder)
    try:
        return drive(
            twin, commands, end=end, last=last, progress=lambda time: progress(time, end / 1e9), stop=stop
        )
    except DivergenceError as error:
        recorder.close()
        raise DivergenceError(
            f"{error}; the bag {recorder.folder} holds the run up to {twin.time:.3f} s"
        ) from error
    except BaseException:
        recorder.close()
        if twin.simulation.statistics.steps == 0:
            shutil.rmtree(recorder.folder)  # made by this run: the recorder refuses a folder that exists
        raise
    finally:
        recorder.close()
