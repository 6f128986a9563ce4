"""`ldcs study --accuracy`: real errors against asked and estimated ones, on random and violent scenes."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from ldcs_ros.cli.output import Progress, print_json

if TYPE_CHECKING:
    from ldcs_ros.study.accuracy.measure import Pair

ACCURACIES = (1e-4, 1e-5, 1e-6)
REFERENCE_SECONDS = 60.0


def run_accuracy(arguments: argparse.Namespace) -> int:
    """Measure all pairs, write accuracy.csv and accuracy.png, print the figures; status 0.

    References are kept in the folder's `references`; a second run measures the product alone.
    """
    from ldcs_ros.study.accuracy.measure import pairs
    from ldcs_ros.study.accuracy.random_scenes import random_case
    from ldcs_ros.study.accuracy.report import figures, text, write
    from ldcs_ros.study.accuracy.violent_cases import violent_cases

    first = arguments.first_seed
    cases = [*violent_cases(), *(random_case(seed) for seed in range(first, first + arguments.scenes))]
    cases = [case for case in cases if arguments.only in case.name]
    found: list[Pair] = []
    with Progress(len(cases), label="accuracy", unit="", quiet=arguments.json) as progress:
        for count, case in enumerate(cases):
            progress.show(count)
            cache = arguments.output / "references"
            found += pairs([case], ACCURACIES, cache=cache, seconds=REFERENCE_SECONDS)
    table, picture = write(found, arguments.output)
    summary = figures(found)
    if arguments.json:
        print_json({**asdict(summary), "table": str(table), "picture": str(picture)})
    else:
        print(text(summary))
        print(f"written                     {table}, {picture}")
    return 0
