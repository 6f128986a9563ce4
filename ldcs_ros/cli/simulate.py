"""`ldcs simulate`: run a scene as fast as it can, without ROS, and record what the live node would record."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ldcs_ros.cli.arguments import CommandLineError, metres, only_with, seconds, seed
from ldcs_ros.cli.interruption import Interruption
from ldcs_ros.cli.output import Progress, print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_set, scene_with
from ldcs_ros.errors import DivergenceError

if TYPE_CHECKING:
    from ldcs_ros.physics.lattice import Lattice
    from ldcs_ros.twin.recorder import Recorder
    from ldcs_ros.twin.twin import Twin

DESCRIPTION = """\
Run a scene as fast as it can, without ROS. The bag holds what the live node would record: nodes, poses, joint
states, pressures, diagnostics. `ros2 bag`, RViz and Foxglove open it."""
EXAMPLE = """\
ldcs simulate paper --duration 3 --bag out/paper
  ldcs simulate paper --settle --bag out/rest --set effects.payload.mass=0.02
  ldcs simulate arc --duration 3 --set "solver={integrator: trbdf2, dt: 0.001}"
  ldcs simulate my_scene.yaml --duration 10 --accuracy 1e-6 --bag out/mine --json"""

# Error of a lattice with so many cells along the sheet, as a fraction of its length: the difference of P0 and P1 from
# 65 x 65 nodes on `arc_material`, as `ldcs study` measures it (docs/study.md, "The lattice's own error").
LATTICE_ERRORS = ((4, 8.2e-3), (8, 7.2e-3), (16, 4.2e-3), (32, 1.9e-3))
EXIT_NOT_RECORDED = 1
EXIT_INTERRUPTED = 130


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", metavar="SCENE", help="a shipped scene (see `ldcs scenes`) or a YAML file")
    parser.add_argument("--duration", metavar="S", type=seconds, help="simulation time to run [s]")
    parser.add_argument(
        "--bag", metavar="DIR", type=Path, help="new bag folder; without it nothing is recorded"
    )
    parser.add_argument(
        "--detail",
        action="store_true",
        help="record lattice_state (the whole state in full precision) and solver_status too: a bag about three "
        "times as large",
    )
    parser.add_argument(
        "--settle",
        action="store_true",
        help="start from the rest state; without --duration record that state alone",
    )
    parser.add_argument(
        "--accuracy", metavar="M", type=metres, help="largest node position error accepted [m]"
    )
    parser.add_argument(
        "--verify",
        action="store_true",
        help="run a second solution at a tenth of the accuracy and report the measured error; three times the cost",
    )
    parser.add_argument(
        "--seed", metavar="N", type=seed, help="seed of the sensors' noise; the scene's if not given"
    )
    add_set(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the scene, print what came out; status 0, 1 if the recording stopped early, 130 if interrupted."""
    if arguments.duration is None and not arguments.settle:
        raise CommandLineError(
            "simulate needs --duration S (how long to run, in seconds), or --settle, or both"
        )
    if arguments.bag is None:
        only_with("--bag", {"--detail": arguments.detail})
    from ldcs_ros.twin.settings import RunSettings
    from ldcs_ros.twin.twin import Twin

    scene = scene_with(arguments.scene, arguments.overrides)
    began = time.perf_counter()
    settings = RunSettings(
        seed=arguments.seed,
        accuracy=arguments.accuracy,
        full_precision=arguments.detail,
        verify=arguments.verify,
    )
    twin = Twin(scene, settings)
    recorder = None
    if arguments.bag is not None:
        # Readers and writers of bags take 0.25 s to load.
        from ldcs_ros.twin.recorder import Recorder

        recorder = Recorder(arguments.bag, twin, custom_data={"settled": str(arguments.settle).lower()})
        twin.sinks.append(recorder)
    try:
        _warm_up(twin)
        outcome = _advance(twin, arguments, prepared_in=time.perf_counter() - began)
    except BaseException as error:
        kept = _give_up(twin, recorder)
        if kept and isinstance(error, DivergenceError):
            raise DivergenceError(f"{error}; {kept}") from error
        raise
    if recorder is not None:
        recorder.close()
    _print(_report(twin, arguments, outcome, recorder), as_json=arguments.json)
    if recorder is not None and recorder.error is not None:
        print(f"ldcs: error: {recorder.error}", file=sys.stderr)
        return EXIT_NOT_RECORDED
    if outcome.interrupted:
        kept = f"; the bag {arguments.bag} is closed and holds all until then" if recorder is not None else ""
        print(f"ldcs: interrupted at t = {twin.time:.3f} s{kept}", file=sys.stderr)
        return EXIT_INTERRUPTED
    return 0


@dataclass(frozen=True)
class RunSummary:
    """The outcome of a run.

    Attributes:
        preparation: Wall time before the run: building, and compiling or loading kernels [s].
        wall_time: Wall time of the run with messages and recording [s].
        simulated: Simulation time that went by [s].
        interrupted: Somebody asked it to end early.
    """

    preparation: float
    wall_time: float
    simulated: float
    interrupted: bool


def _advance(twin: Twin, arguments: argparse.Namespace, *, prepared_in: float) -> RunSummary:
    began = time.perf_counter()
    if arguments.settle:
        twin.settle()
    start = twin.time
    end = start + (arguments.duration or 0.0)
    quiet = arguments.json or arguments.duration is None
    with Interruption() as interruption, Progress(end, label=str(twin.scene.name), quiet=quiet) as progress:
        while twin.next_time <= end and not interruption.requested:
            twin.advance_to_next()
            progress.show(twin.time)
        if not interruption.requested:
            twin.advance_to(end)
    return RunSummary(prepared_in, time.perf_counter() - began, twin.time - start, interruption.requested)


def _warm_up(twin: Twin) -> None:
    from ldcs_ros.physics.compiled import kernels_wait_for_compilation
    from ldcs_ros.twin.warm_up import warm_up

    # Numba compiles a kernel when it is first called and keeps it on disk; a step of a throw-away simulation
    # takes that out of the run's own time.
    if kernels_wait_for_compilation():
        print(
            "ldcs: compiling kernels for this computer, once; some ten seconds", file=sys.stderr, flush=True
        )
    warm_up(twin.scene)


def _give_up(twin: Twin, recorder: Recorder | None) -> str:
    """Close the bag of a run that failed, remove it if no step was made; return what is left, in words."""
    if recorder is None:
        return ""
    recorder.close()
    if twin.simulation.statistics.steps > 0:
        return f"the bag {recorder.folder} holds the run up to t = {twin.time:.3f} s"
    shutil.rmtree(recorder.folder)  # made by this run: the recorder refuses a folder that exists
    return ""


def _report(
    twin: Twin, arguments: argparse.Namespace, outcome: RunSummary, recorder: Recorder | None
) -> dict[str, Any]:
    simulation, scene = twin.simulation, twin.scene
    statistics = simulation.statistics
    rest = simulation.lattice.reference_position
    moved = {
        name: 1e3 * (point.position(simulation.state.position) - point.position(rest))
        for name, point in simulation.points.items()
    }
    ran = outcome.simulated > 0.0
    return {
        "scene": scene.name,
        "title": scene.title,
        "effects": list(simulation.effects),
        "integrator": simulation.integrator.name,
        "accuracy": simulation.accuracy,
        "error_estimate": statistics.error_estimate,
        "verified": twin.settings.verify,
        "lattice_error": _lattice_error(simulation.lattice),
        "settled": arguments.settle,
        "time": twin.time,
        "simulated": outcome.simulated,
        "interrupted": outcome.interrupted,
        "statistics": statistics.as_dict(),
        "preparation_time": outcome.preparation,
        "wall_time": outcome.wall_time,
        "real_time_factor": outcome.simulated / outcome.wall_time if ran else None,
        "solver_real_time_factor": outcome.simulated / statistics.wall_time if ran else None,
        "displacement_mm": moved,
        "bag": None if recorder is None else str(recorder.folder),
        "messages": None if recorder is None else recorder.count,
        "recording_error": None if recorder is None else recorder.error,
    }


def _lattice_error(lattice: Lattice) -> float:
    """Return the order of the error [m] that a lattice of this size and number of nodes has by itself."""
    cells = max(lattice.nodes) - 1
    fraction = next(
        (error for known, error in reversed(LATTICE_ERRORS) if cells >= known), LATTICE_ERRORS[0][1]
    )
    return fraction * max(lattice.size[:2])


def _print(report: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_json(report)
        return
    name = f"{report['scene']} - {report['title']}" if report["title"] else str(report["scene"])
    accuracy = report["accuracy"]
    asked = "fixed step" if accuracy is None else f"accuracy asked {accuracy:.1e} m"
    lines = [
        ("scene", name),
        ("effects", ", ".join(report["effects"])),
        ("integrator", f"{report['integrator']}, {asked}"),
        *(
            _run_lines(report)
            if report["simulated"] > 0.0
            else [("rest state", f"found in {report['wall_time']:.3f} s")]
        ),
        (
            "before that",
            f"{report['preparation_time']:.2f} s to build, and to compile (on first use) or load",
        ),
    ]
    for point, (x, y, z) in report["displacement_mm"].items():
        # Adding 0 turns a rounded -0.0 into 0.0.
        moved = "   ".join(f"{axis} {round(d, 2) + 0.0:+.2f}" for axis, d in (("x", x), ("y", y), ("z", z)))
        lines.append((point, f"{moved} mm from rest"))
    if report["bag"] is not None:
        lines.append(("bag", f"{report['bag']} ({report['messages']} messages)"))
    print_pairs(lines)


def _run_lines(report: dict[str, Any]) -> list[tuple[str, str]]:
    counts = report["statistics"]
    rest = " from the rest state" if report["settled"] else ""
    steps = f"{counts['steps']} steps ({counts['rejected_steps']} rejected)"
    whole, alone = report["real_time_factor"], report["solver_real_time_factor"]
    return [
        (
            "measured error" if report["verified"] else "estimated error",
            f"{report['error_estimate']:.1e} m in time; the lattice's own: about {report['lattice_error']:.0e} m",
        ),
        ("simulated", f"{report['simulated']:.3f} s{rest} in {steps}"),
        ("wall time", f"{report['wall_time']:.3f} s, {whole:.3g} times real time"),
        ("solver alone", f"{counts['wall_time']:.3f} s, {alone:.3g} times real time"),
    ]
