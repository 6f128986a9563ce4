"""`ldcs recover`: make a sound bag of what a killed process, a full disk or a power cut left."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

from ldcs_ros.cli.output import Progress, print_json

DESCRIPTION = """\
Mend an MCAP bag in place: every record that is whole is kept, what was cut off is dropped, metadata.yaml is
written. A sound bag is left untouched."""
EXAMPLE = "ldcs recover out/paper"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag folder, or one .mcap file")


def run(arguments: argparse.Namespace) -> int:
    """Mend the bag and say what was kept; exit status 1 if readers refuse it nevertheless."""
    from ldcs_ros.bags import recover

    with Progress(1.0, label=f"recover {arguments.bag.name}", unit="", quiet=arguments.json) as progress:
        report = recover(arguments.bag, progress=progress.show)
    if arguments.json:
        print_json({**dataclasses.asdict(report), "untouched": report.untouched})
    else:
        print(report)
    if report.refusal:
        print(f"ldcs: error: readers refuse it nevertheless: {report.refusal}", file=sys.stderr)
        return 1
    return 0
