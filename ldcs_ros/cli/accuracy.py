"""`ldcs study --accuracy`: real errors against asked and estimated ones, on shipped, random and violent scenes."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from ldcs_ros.cli.output import Progress, print_json

ACCURACIES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
SCENES = 60
# Processor time that a reference may take; a finer run takes its place above it [s].
REFERENCE_SECONDS = 2.0


def run_accuracy(arguments: argparse.Namespace) -> int:
    """Measure all pairs, write accuracy.csv, .md and .png, print the figures; status 0.

    Pairs that accuracy.csv has are not measured again; references are kept in the folder's `references`.
    """
    from ldcs_ros.study.accuracy.measure import pairs
    from ldcs_ros.study.accuracy.random_scenes import random_case
    from ldcs_ros.study.accuracy.report import draw, figures, page, read_pairs, text, write_pairs
    from ldcs_ros.study.accuracy.shipped_cases import shipped_cases
    from ldcs_ros.study.accuracy.violent_cases import violent_cases

    first, scenes, folder = arguments.first_seed or 0, arguments.scenes or SCENES, arguments.output
    drawn = [random_case(seed) for seed in range(first, first + scenes)]
    cases = [case for case in [*drawn, *violent_cases(), *shipped_cases()] if arguments.only in case.name]
    found = [] if arguments.again else read_pairs(folder)
    known = {pair.case for pair in found}
    with Progress(len(cases), label="accuracy", unit="", quiet=arguments.json) as progress:
        for count, case in enumerate(cases):
            progress.show(count)
            if case.name not in known:
                found += pairs(case, ACCURACIES, cache=folder / "references", seconds=REFERENCE_SECONDS)
                write_pairs(found, folder)
    draw(found, folder / "accuracy.png")
    command = f"ldcs study --accuracy --first-seed {first} --scenes {scenes}"
    command += f" --only {arguments.only}" if arguments.only else ""
    (folder / "accuracy.md").write_text(page(found, command), encoding="utf-8")
    summary = figures(found)
    if arguments.json:
        print_json({**asdict(summary), "folder": str(folder)})
    else:
        print(text(summary))
        print(f"written                     {folder}/accuracy.md, accuracy.csv, accuracy.png")
    return 0
