"""`ldcs study --accuracy`: real errors against asked and estimated ones, on shipped, random and violent scenes."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from ldcs_ros.cli.output import Progress, print_json

if TYPE_CHECKING:
    from ldcs_ros.study.accuracy.measure import Pair

ACCURACIES = (1e-4, 1e-5, 1e-6)
REFERENCE_SECONDS = {"shipped": 900.0}


def run_accuracy(arguments: argparse.Namespace) -> int:
    """Measure all pairs, write accuracy.csv and accuracy.png, print the figures; status 0.

    References are kept in the folder's `references`; a second run measures the product alone.
    """
    from ldcs_ros.study.accuracy.measure import pairs
    from ldcs_ros.study.accuracy.random_scenes import random_case
    from ldcs_ros.study.accuracy.report import figures, text, write
    from ldcs_ros.study.accuracy.shipped_cases import shipped_cases
    from ldcs_ros.study.accuracy.violent_cases import violent_cases

    first = arguments.first_seed or 0
    drawn = [random_case(seed) for seed in range(first, first + (arguments.scenes or 60))]
    cases = [*shipped_cases(), *violent_cases(), *drawn]
    cases = [case for case in cases if arguments.only in case.name]
    found: list[Pair] = []
    with Progress(len(cases), label="accuracy", unit="", quiet=arguments.json) as progress:
        for count, case in enumerate(cases):
            progress.show(count)
            cache = arguments.output / "references"
            seconds = REFERENCE_SECONDS.get(case.name.partition("_")[0], 60.0)
            found += pairs([case], ACCURACIES, cache=cache, seconds=seconds)
    table, picture = write(found, arguments.output)
    summary = figures(found)
    if arguments.json:
        print_json({**asdict(summary), "table": str(table), "picture": str(picture)})
    else:
        print(text(summary))
        print(f"written                     {table}, {picture}")
    return 0
