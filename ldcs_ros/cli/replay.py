"""`ldcs replay`: feed the commands of a bag to the twin again, and say whether the same came out."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ldcs_ros.cli.arguments import metres, seconds, seed
from ldcs_ros.cli.interruption import Interruption
from ldcs_ros.cli.output import Progress, print_json, print_notes, print_pairs
from ldcs_ros.cli.scene_argument import add_map, add_set, given_mapping, scene_of

if TYPE_CHECKING:
    from ldcs_ros.replay.session import Replay

DESCRIPTION = """\
Feed the commands of a bag to the twin in log order, in this process, and write a new bag. A bag of ldcs is run as it
was (scene, seed, accuracy are in it) and compared with the original: the same bytes, or within the accuracy on
another platform; if not, the exit status is 1. --scene, --set, --seed, --accuracy, --duration make another run of it.
A rig's bag (MCAP or sqlite3) needs --scene, and a mapping file where its topics have other names or units."""
EXAMPLE = """\
ldcs replay out/paper --bag out/again
  ldcs replay out/paper --bag out/lighter --set effects.payload.mass=0.02
  ldcs replay rig_bag --scene rig --map rig_topics.yaml --bag out/twin_of_rig"""

EXIT_CHECK_FAILED = 1
EXIT_INTERRUPTED = 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "source", metavar="BAG", type=Path, help="bag folder, .mcap, .db3, .csv or .parquet file"
    )
    parser.add_argument("--bag", metavar="DIR", type=Path, required=True, help="new bag folder")
    add_map(parser)
    parser.add_argument("--scene", metavar="SCENE", help="another scene than the recorded one")
    add_set(parser)
    parser.add_argument(
        "--accuracy", metavar="M", type=metres, help="largest node position error accepted [m]"
    )
    parser.add_argument("--seed", metavar="N", type=seed, help="seed of the sensors' noise")
    parser.add_argument("--duration", metavar="S", type=seconds, help="end earlier or later than the bag [s]")


def run(arguments: argparse.Namespace) -> int:
    """Replay, print what came out; status 0, 1 if the check failed or the recording stopped, 130 if interrupted."""
    from ldcs_ros.replay.session import Changes, replay

    mapping = given_mapping(arguments)
    changed = arguments.scene is not None or arguments.overrides
    scene = scene_of(arguments.source, arguments) if changed else None
    changes = Changes(scene, arguments.seed, arguments.accuracy, arguments.duration)
    label = f"replay {arguments.source.name}"
    with Interruption() as interruption, Progress(1.0, label=label, unit="", quiet=arguments.json) as bar:
        done = replay(
            arguments.source,
            arguments.bag,
            changes=changes,
            mapping=mapping,
            progress=lambda time, end: bar.show(time / end if end > 0.0 else 1.0),
            stop=lambda: interruption.requested,
        )
    print_notes(arguments.source, done.notes)
    if arguments.json:
        print_json(_report(done))
    else:
        print_pairs(_lines(done))
    return _status(done)


def _status(done: Replay) -> int:
    if done.recorder.error is not None:
        print(f"ldcs: error: {done.recorder.error}", file=sys.stderr)
        return EXIT_CHECK_FAILED
    if done.outcome.interrupted:
        print(f"ldcs: interrupted at t = {done.twin.time:.3f} s; the bag is closed", file=sys.stderr)
        return EXIT_INTERRUPTED
    if done.took_no_command:
        print("ldcs: error: no command was taken: all are malformed or refused", file=sys.stderr)
        return EXIT_CHECK_FAILED
    return 0 if done.verdict is None or done.verdict.passed else EXIT_CHECK_FAILED


def _report(done: Replay) -> dict[str, Any]:
    verdict, outcome, simulation = done.verdict, done.outcome, done.twin.simulation
    return {
        "scene": done.twin.scene.name,
        "start": done.start,
        "time": done.twin.time,
        "settled": done.twin.settings.settled,
        "interrupted": outcome.interrupted,
        "commands": {
            "applied": outcome.applied,
            "unchanged": outcome.unchanged,
            "refused": dict(outcome.refused),
            "not_reached": outcome.not_reached,
            "last_refusal": outcome.last_refusal or None,
        },
        "topics": [report.as_dict() for report in done.reports],
        "verdict": None
        if verdict is None
        else {
            "passed": verdict.passed,
            "same_bytes": verdict.same_bytes,
            "messages": verdict.messages,
            "first_difference": verdict.first_difference or None,
            "largest_difference": verdict.largest,
            "allowed": verdict.allowed,
            "differing": list(verdict.differing),
        },
        "statistics": simulation.statistics.as_dict(),
        "bag": str(done.recorder.folder),
        "messages": done.recorder.count,
        "recording_error": done.recorder.error,
        "notes": list(done.notes),
    }


def _lines(done: Replay) -> list[tuple[str, str]]:
    outcome, scene = done.outcome, done.twin.scene
    refused = sum(outcome.refused.values())
    commands = f"{outcome.applied} applied, {outcome.unchanged} unchanged, {refused} refused"
    if outcome.not_reached:
        commands += f", {outcome.not_reached} after the end"
    rest = " from the rest state" if done.twin.settings.settled else ""
    lines = [
        ("scene", f"{scene.name} - {scene.title}"),
        ("simulated", f"{done.twin.time - done.start:.3f} s{rest}"),
        ("commands", commands),
    ]
    if outcome.last_refusal:
        lines.append(("last refused", outcome.last_refusal))
    for report in done.reports:
        warnings = ", ".join(report.warnings()) or "all sound and in order"
        lines.append((report.topic, f"{report.messages} messages: {warnings}"))
    lines.append(("bag", f"{done.recorder.folder} ({done.recorder.count} messages)"))
    if done.verdict is not None:
        lines += _verdict_lines(done)
    return lines


def _verdict_lines(done: Replay) -> list[tuple[str, str]]:
    verdict = done.verdict
    assert verdict is not None
    if verdict.same_bytes:
        return [("verdict", f"the same bytes as the original, all {verdict.messages} messages")]
    if verdict.largest is None:
        apart = "there are no node positions in common to compare"
    elif math.isinf(verdict.largest):
        apart = "the replay lacks surfaces of the original"
    else:
        apart = f"nodes at most {verdict.largest:.1e} m apart, {verdict.allowed:.1e} m allowed"
    differing = (
        "; ".join(verdict.differing)
        or "versions and platform are the same; the cause is not established (another processor, or changed code)"
    )
    return [
        ("verdict", f"{'passed' if verdict.passed else 'FAILED'}: not the same bytes, {apart}"),
        ("first difference", verdict.first_difference),
        ("ran on", differing),
    ]
