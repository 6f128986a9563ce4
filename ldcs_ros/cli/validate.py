"""`ldcs validate`: the paper's test against its experiment, and what the calibrated twin rests on."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ldcs_ros.cli.arguments import add_format_argument
from ldcs_ros.cli.output import Progress, print_json

if TYPE_CHECKING:
    from ldcs_ros.validate.cases import ComparedModel
    from ldcs_ros.validate.identifiability import Sensitivity
    from ldcs_ros.validate.transient import Transient

Block = tuple[str, list[list[str]]]
"""A heading and the rows of a table."""
DESCRIPTION = """\
Repeat the paper's test and print Table I (ours, the paper's model, the experiment): as printed under each spring
law, and with the calibrated scene. Exit status 1 if an error of the calibrated scene has grown by 0.05 mm."""
EXAMPLE = """\
ldcs validate
  ldcs validate -o out/validation --calibrate --damping
  ldcs validate --mechanics
  ldcs validate --markdown"""

EXIT_GROWN = 1
RADIUS_ORIGIN = "the 115 mm are of the paper's simulation, not of its experiment"
PROFILE = (0.20, 0.23, 0.25, 0.27, 0.30)  # N m/rad


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="write the pictures into this folder"
    )
    add_format_argument(parser)
    parser.add_argument(
        "--calibrate",
        action="store_true",
        help="fit again, compare structures, say what the data determine (a minute)",
    )
    parser.add_argument(
        "--damping", action="store_true", help="run other damping, show settling, cost and accuracy"
    )
    parser.add_argument(
        "--mechanics",
        action="store_true",
        help="compare the material with classical strips and plates and with finite elements, and print nothing else",
    )
    parser.add_argument(
        "--markdown", action="store_true", help="print the tables of the README and nothing else"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the tables, write the pictures; status 1 if an error has grown."""
    from ldcs_ros import load_scene
    from ldcs_ros.validate import calibration, paper, tables, transient
    from ldcs_ros.validate.cases import all_cases
    from ldcs_ros.validate.identifiability import STRUCTURES
    from ldcs_ros.validate.measure import RADIUS_METHOD
    from ldcs_ros.validate.parameters import CALIBRATED

    if arguments.mechanics:
        return _mechanics(arguments)
    quiet = arguments.json or arguments.markdown
    with Progress(1.0, label="cases", unit="", quiet=quiet) as bar:
        cases = all_cases(bar.show)
    calibrated = cases[-1]
    grown = paper.grown(calibrated.rest.displacement)
    blocks: list[Block] = [
        ("Table I [mm]: the calibrated twin", tables.table_one(calibrated)),
        ("errors against the experiment [mm], each model at rest", tables.comparison(cases)),
    ]
    if arguments.markdown:
        print("\n\n".join(tables.as_markdown(rows) for _, rows in blocks))
        return EXIT_GROWN if grown else 0
    content = calibration.calibrated_content()
    held_out = _held_out(content, quiet=quiet)
    motion = transient.simulate(load_scene(CALIBRATED))
    result = {**_plain(cases), "grown": grown, "radius_method": RADIUS_METHOD}
    result["held_out_error_mm"] = held_out
    result["structures_compared"] = len(STRUCTURES)
    result["radius_origin"] = RADIUS_ORIGIN
    result["course"] = {
        "settled_after_s": motion.settling,
        "overshoot_mm": motion.overshoot,
        "time_constant_c_over_k_s": transient.time_constant(content),
    }
    figures = {}
    if arguments.output is not None:
        from ldcs_ros.validate import pictures

        figures["shape"] = pictures.shape_figure(calibrated.rest, "The calibrated twin at rest")
        figures["course"] = pictures.transient_figure(motion, "P0 and P1 of the calibrated twin in time")
    if arguments.calibrate:
        found, extra = _calibrate(content, quiet=quiet, result=result)
        blocks += found
        if arguments.output is not None:
            figures["sensitivity"] = pictures.tornado_figure(extra, "Sensitivity of P0 and P1")
    if arguments.damping:
        with Progress(1.0, label="damping", unit="", quiet=quiet) as progress:
            runs = []
            for number, damped in enumerate(transient.sweep(content), start=1):
                runs.append(damped)
                progress.show(number / len(transient.DAMPINGS))
        blocks.append(
            ("damping: all dampers of sheet and arms scaled with c; cost against c = 5", tables.damping(runs))
        )
        result["damping"] = _records(tables.damping(runs))
        if arguments.output is not None:
            figures["damping"] = pictures.damping_figure(runs, "P1 under other damping")
    if arguments.output is not None:
        result["files"] = [str(path) for path in pictures.write(figures, arguments.output, arguments.format)]
    if arguments.json:
        print_json(result)
    else:
        _print(blocks, result, motion, RADIUS_METHOD)
    for line in grown:
        print(f"ldcs: error: the calibrated twin got worse: {line}", file=sys.stderr)
    return EXIT_GROWN if grown else 0


def _held_out(content: dict[str, Any], *, quiet: bool) -> dict[str, float]:
    from ldcs_ros.validate import calibration

    done = 0
    with Progress(len(calibration.OBSERVATIONS), label="held out", unit="", quiet=quiet) as bar:

        def step(name: str) -> None:
            nonlocal done
            bar.show(done)
            done += 1

        return calibration.held_out_errors(content, step)


def _mechanics(arguments: argparse.Namespace) -> int:
    from ldcs_ros.validate import tables
    from ldcs_ros.validate.benchmark import LIMITS
    from ldcs_ros.validate.mechanics import benchmarks
    from ldcs_ros.validate.small_displacements import small_displacements

    found = []
    with Progress(1.0, label="mechanics", unit="", quiet=arguments.json) as bar:
        for one in chain(benchmarks(), small_displacements()):
            found.append(one)
            bar.show(min(len(found) / 26.0, 1.0))
    files = []
    if arguments.output is not None:
        from ldcs_ros.validate import pictures
        from ldcs_ros.validate.mechanics_picture import mechanics_figure

        files = pictures.write({"mechanics": mechanics_figure(found)}, arguments.output, arguments.format)
    if arguments.json:
        records = [
            {"name": one.name, "reference": one.reference, "values": one.values, "limit": one.limit}
            for one in found
        ]
        print_json({"mechanics": records, "limits": LIMITS, "files": [str(path) for path in files]})
        return 0
    print(tables.as_markdown(tables.mechanics(found)))
    for name, words in LIMITS.items():
        print(f"\n{name}: {words}.")
    for path in files:
        print(path)
    return 0


def _calibrate(
    content: dict[str, Any], *, quiet: bool, result: dict[str, Any]
) -> tuple[list[Block], list[Sensitivity]]:
    from ldcs_ros.validate import calibration, identifiability, tables
    from ldcs_ros.validate.parameters import PARAMETERS

    total = 4 + len(identifiability.STRUCTURES) + len(PROFILE)
    done = 0

    with Progress(1.0, label="calibration", unit="", quiet=quiet) as bar:

        def step() -> None:
            nonlocal done
            done += 1
            bar.show(min(done / total, 1.0))

        again = calibration.fit(content)
        step()
        confidence = identifiability.confidence(again.content, again.seen)
        step()
        directions = identifiability.directions(content)
        step()
        moved = identifiability.sensitivities(content)
        step()
        rivals = []
        for rival in identifiability.compare_structures(content, bar.say):
            rivals.append(rival)
            step()
        held = []
        stiffness = PARAMETERS[0]
        for pair in identifiability.profile(content, stiffness.path, list(PROFILE)):
            held.append(pair)
            step()
    fitted = tables.fitted(again.values, PARAMETERS, confidence)
    blocks = [
        (f"fitted again: chi2 {confidence.misfit:.1f} for {confidence.freedom} degrees of freedom", fitted),
        ("directions of the parameters", tables.directions(directions)),
        ("sensitivity [mm]: change when a parameter grows by its plausible range", tables.sensitivity(moved)),
        ("structures, each with its best fit (errors in mm)", tables.structures(rivals)),
        ("profile: the other numbers fitted again (errors in mm)", tables.profiled(stiffness, held)),
    ]
    names = ("fitted", "directions", "sensitivity", "structures", "profile")
    result["calibration"] = {name: _records(rows) for name, (_, rows) in zip(names, blocks, strict=True)}
    return blocks, moved


def _plain(cases: Sequence[ComparedModel]) -> dict[str, Any]:
    from ldcs_ros.validate import paper

    return {
        "experiment_mm": paper.EXPERIMENT,
        "paper_model_mm": paper.MODEL,
        "committed_errors_mm": paper.COMMITTED._asdict(),
        "cases": {
            case.name: {
                "title": case.title,
                "fitted": case.fitted,
                "torque": case.torque,
                "displacement_mm": {name: case.rest.displacement[name] for name in paper.POINTS},
                "error_mm": paper.errors(case.rest.displacement),
                "worst_mm": paper.worst(case.rest.displacement),
                "radius": case.rest.radius,
                "roundness": case.rest.roundness,
            }
            for case in cases
        },
    }


def _records(rows: list[list[str]]) -> list[dict[str, str]]:
    return [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]


def _print(blocks: Sequence[Block], result: dict[str, Any], motion: Transient, method: str) -> None:
    from ldcs_ros.validate import tables

    for title, rows in blocks:
        print(f"{title}\n{tables.as_text(rows)}\n")
    held_out = ", ".join(f"{name} {tables.signed(e, 2)}" for name, e in result["held_out_error_mm"].items())
    print(f"held out: errors when a fit to the other four numbers predicts a number [mm]: {held_out}")
    print(
        f"structures compared before the fit: {result['structures_compared']} (--calibrate fits them again)"
    )
    print(f"radius: {result['radius_origin']}; {method}")
    constant = result["course"]["time_constant_c_over_k_s"]
    print(
        f"time course: within 0.1 mm of rest after {motion.settling:.2f} s, {motion.overshoot:.1f} mm beyond it on the "
        f"way; c / k = {1e3 * constant:.0f} ms"
    )
    for path in result.get("files", ()):
        print(path)
