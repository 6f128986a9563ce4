"""`ldcs compare`: the difference of two recordings in numbers and pictures, with limits for machines to check."""

from __future__ import annotations

import argparse
from pathlib import Path

from ldcs_ros.cli.arguments import add_picture_arguments, metres
from ldcs_ros.cli.output import open_bag_or_table, print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_map, given_mapping

DESCRIPTION = """\
Compare two recordings: two runs of the twin, or a run with a rig's bag. A constant offset of the clocks is estimated
from the motion and reported (two runs in simulation time are taken as they are). Differences are A minus B: RMS, 95th
percentile, maximum, also over the side length. Writes compare.md, compare.png, and surface_error.png where both
recorded the nodes. With a tolerance file the exit status is 1 when a limit is broken."""
EXAMPLE = """\
ldcs compare out/paper out/lighter
  ldcs compare out/twin_of_rig rig_bag --map-b rig_topics.yaml --relative -o report
  ldcs compare out/today bags/paper --tolerances limits.yaml --json

tolerance file (SI; figures rms, p95, max, mean, end, normalised_rms):
  P1: {max: 1.0e-3, rms: 5.0e-4}
  P1.z: {end: 2.0e-4}
  surface: {max: 2.0e-5}"""

EXIT_CHECK_FAILED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("a", metavar="A", type=Path, help="bag folder, .mcap, .db3, .csv or .parquet file")
    parser.add_argument("b", metavar="B", type=Path, help="the one that A is compared with")
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="folder for the report; A_vs_B beside A"
    )
    for side in ("a", "b"):
        add_map(parser, side)
    add_picture_arguments(parser)
    parser.add_argument("--tolerances", metavar="FILE", type=Path, help="limits to check (YAML)")
    parser.add_argument(
        "--offset",
        metavar="S",
        default="auto",
        help="offset of B's clock ahead of A's [s]; auto (default); estimate: also for two simulations",
    )
    parser.add_argument(
        "--measured", action="store_true", help="take what a twin's tracker reports, not the truth"
    )
    parser.add_argument(
        "--relative", action="store_true", help="compare what changed since the first common time"
    )
    parser.add_argument(
        "--side-length", metavar="M", type=metres, help="length of the sheet, if no scene says [m]"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare, write the report, print a summary; status 0, or 1 if a limit is broken."""
    from ldcs_ros.compare.comparison import Options, compare
    from ldcs_ros.compare.report import as_dict, summary, write_report
    from ldcs_ros.compare.tolerances import load_tolerances
    from ldcs_ros.plotting.comparison import draw_comparison
    from ldcs_ros.plotting.style import STYLES

    offset, estimate = _offset(arguments.offset)
    (recording_a, mapping_a), (recording_b, mapping_b) = (
        open_bag_or_table(path, given_mapping(arguments, side))
        for path, side in ((arguments.a, "a"), (arguments.b, "b"))
    )
    options = Options(
        mappings=(mapping_a, mapping_b),
        offset=offset,
        estimate=estimate,
        measured=arguments.measured,
        relative=arguments.relative,
        side_length=arguments.side_length,
        tolerances=None if arguments.tolerances is None else load_tolerances(arguments.tolerances),
    )
    comparison = compare(recording_a, recording_b, options)
    folder = arguments.output or arguments.a.with_name(f"{arguments.a.stem}_vs_{arguments.b.stem}")
    folder.mkdir(parents=True, exist_ok=True)
    pictures = draw_comparison(comparison, folder, kind=arguments.format, style=STYLES[arguments.width])
    files = [write_report(comparison, folder, pictures), *pictures]
    if arguments.json:
        print_json(as_dict(comparison, [str(path) for path in files]))
    else:
        print_pairs(summary(comparison))
        for path in files:
            print(path)
    return 0 if comparison.passed else EXIT_CHECK_FAILED


def _offset(text: str) -> tuple[float | None, bool]:
    from ldcs_ros.cli.arguments import CommandLineError, number

    if text in ("auto", "estimate"):
        return None, text == "estimate"
    try:
        return number(text, what="offset", unit="s"), False
    except argparse.ArgumentTypeError as error:
        raise CommandLineError(f"--offset: {error}, or 'auto', or 'estimate'") from error
