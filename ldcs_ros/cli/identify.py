"""`ldcs identify`: named numbers of a scene fitted to recordings."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ldcs_ros.cli.arguments import CommandLineError, count, metres, seed
from ldcs_ros.cli.output import Progress, print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_map, add_set, given_mapping, scene_of

if TYPE_CHECKING:
    from ldcs_ros.identify.experiments import Experiment
    from ldcs_ros.identify.identify import Identification

DESCRIPTION = """\
Fit numbers of a scene to bags: the commands of each bag are fed to the scene, and the numbers are found for which
its points go where the tracker saw them. Prints each number with its 95 % interval, and whether the scene's
structure fits at all; if not, the exit status is 1. -o writes the fitted scene; its header names the numbers and
the bags."""
EXAMPLE = """\
ldcs identify out/a out/b --hold-out out/c --fit effects.arms.pressure_gain=1e-7..5e-6 -o fitted.yaml
  ldcs identify rig_bag --scene rig --map rig_topics.yaml --fit effects.springs.stiffness -o mine.yaml"""

EXIT_MISFIT = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("bags", metavar="BAG", type=Path, nargs="+", help="bags to fit")
    parser.add_argument(
        "--fit",
        metavar="PATH[=LOW..HIGH]",
        action="append",
        default=[],
        help="a number of the scene to find, and where; a quarter to four times its value if not said; repeatable",
    )
    parser.add_argument(
        "--hold-out", metavar="BAG", type=Path, action="append", default=[], help="bag to predict, not to fit"
    )
    parser.add_argument("--scene", metavar="SCENE", help="scene to start from; the first bag's if not given")
    add_set(parser)
    add_map(parser)
    parser.add_argument(
        "--noise",
        metavar="M",
        type=metres,
        help="tracker's standard deviation [m]; else the bag's, or estimated",
    )
    parser.add_argument(
        "--in-motion", action="store_true", help="the bags begin in motion: fit the start of each, too"
    )
    parser.add_argument("--starts", metavar="N", type=count, default=8, help="start values to screen (8)")
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="seed of the start values (0)")
    parser.add_argument(
        "--processes", metavar="N", type=count, help="worker processes; one a core if not given"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=Path, help="write the fitted scene into a new file"
    )


def run(arguments: argparse.Namespace) -> int:
    """Fit, print, write the scene; status 0, 1 if the structure does not fit."""
    if arguments.in_motion and arguments.hold_out:
        raise CommandLineError("--hold-out predicts from a known start, and with --in-motion none is known")
    if not arguments.fit:
        raise CommandLineError("identify needs --fit PATH, such as --fit effects.arms.joint_stiffness")
    if arguments.output is not None and arguments.output.exists():
        raise CommandLineError(f"{arguments.output} exists; name another file with -o")
    from ldcs_ros.identify.experiments import read_experiment
    from ldcs_ros.identify.identify import identify
    from ldcs_ros.identify.parameters import parse_parameter
    from ldcs_ros.identify.scene_file import as_dict, scene_text, write_scene

    scene = scene_of(arguments.bags[0], arguments)
    mapping = given_mapping(arguments)
    content = scene.content
    parameters = [parse_parameter(text, content) for text in arguments.fit]
    read = [
        read_experiment(bag, scene, mapping=mapping, noise=arguments.noise, in_motion=arguments.in_motion)
        for bag in (*arguments.bags, *arguments.hold_out)
    ]
    fitted, unseen = read[: len(arguments.bags)], read[len(arguments.bags) :]
    with Progress(1.0, label="identify", unit="", quiet=arguments.json) as bar:

        def tell(fraction: float, what: str) -> None:
            bar.show(fraction)
            bar.say(what)

        found = identify(
            scene,
            fitted,
            parameters,
            held_out=unseen,
            starts=arguments.starts,
            seed=arguments.seed,
            processes=arguments.processes,
            progress=tell,
        )
    if arguments.output is not None:
        write_scene(arguments.output, scene_text(found, fitted, origin=scene.name))
    if arguments.json:
        file = None if arguments.output is None else str(arguments.output)
        noise = {experiment.name: experiment.noise for experiment in read}
        warnings = {experiment.name: list(experiment.warnings) for experiment in read}
        print_json({"scene": scene.name, **as_dict(found), "noise": noise, "remarks": warnings, "file": file})
    else:
        _print(found, read, arguments.output)
    if found.misfit.found:
        print(f"ldcs: error: misfit: {found.misfit.words}", file=sys.stderr)
        return EXIT_MISFIT
    return 0


def _print(found: Identification, read: Sequence[Experiment], output: Path | None) -> None:
    from ldcs_ros.identify.scene_file import estimate_words, score_words

    lines = [("fitted" if k == 0 else "", estimate_words(item)) for k, item in enumerate(found.estimates)]
    names = [item.parameter.path.rpartition(".")[2] for item in found.estimates]
    for row in range(len(names)):
        for column in range(row):
            if abs(found.correlation[row, column]) > 0.9:
                value = f"{found.correlation[row, column]:+.3f}"
                lines.append(("correlated", f"{names[column]} and {names[row]}: {value}"))
    for label, items in (("fit", found.fitted), ("held out", found.held_out)):
        lines += [(label, score_words(item)) for item in items]
    noises = {f"{1e3 * one.noise:.3g} mm ({one.noise_origin})" for one in read}
    lines.append(("noise", ", ".join(sorted(noises))))
    lines += [("in the bag", f"{one.name}: {warning}") for one in read for warning in one.warnings]
    best = found.minima[0]
    ended = "" if best.converged else "; the search was stopped before it ended by itself"
    lines.append(
        ("search", f"{found.evaluations} parameter sets, {len(found.minima)} different minima{ended}")
    )
    lines.append(("slopes", found.slopes))
    lines.append(("structure", "MISFIT" if found.misfit.found else found.misfit.words))
    if output is not None:
        lines.append(("scene", str(output)))
    print_pairs(lines)
