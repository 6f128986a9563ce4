"""`ldcs study --hard`: runs the catalogue of hard cases, prints a line each, writes hard_cases.md."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from ldcs_ros.cli.arguments import CommandLineError
from ldcs_ros.cli.output import Progress, print_json

EXIT_MISSED = 1


def run_hard_cases(arguments: argparse.Namespace) -> int:
    """Run the cases; status 0, or 1 if one is missed."""
    from ldcs_ros.study.hard.catalogue import CASES
    from ldcs_ros.study.hard.report import as_text, summary, write_page
    from ldcs_ros.study.hard.results import read_results, write_results
    from ldcs_ros.study.hard.runner import CaseResult, run_cases
    from ldcs_ros.study.timing import machine

    cases = [case for case in CASES.values() if arguments.only in case.name]
    chosen = {case.name for case in cases}
    kept = [
        result
        for result in read_results(arguments.output)
        if not (arguments.again and result.case.name in chosen)
    ]
    measured_before = {result.case.name for result in kept}
    if not cases:
        raise CommandLineError(f"--only is '{arguments.only}', expected a word in the name of a hard case")
    cases = [case for case in cases if case.name not in measured_before]
    done = 0
    with Progress(max(1, len(cases)), label="hard cases", unit="", quiet=arguments.json) as progress:

        def show(result: CaseResult) -> None:
            nonlocal done
            done += 1
            progress.show(done)
            kept.append(result)
            write_results(kept, arguments.output)
            if not arguments.json:
                print(as_text(result), flush=True)

        run_cases(cases, jobs=arguments.jobs, on_result=show)
    order = {name: place for place, name in enumerate(CASES)}
    results = sorted(kept, key=lambda result: order[result.case.name])
    command = "ldcs study --hard" + (f" --only '{arguments.only}'" if arguments.only else "")
    command += f" --jobs {arguments.jobs}" if arguments.jobs > 1 else ""
    path = write_page(results, arguments.output, machine=machine(), command=command)
    if arguments.json:
        measured = [{**asdict(result), "case": result.case.name} for result in results]
        print_json({"rows": measured, "summary": summary(results), "page": str(path)})
    else:
        print(f"\n{summary(results)}\nwritten  {path}")
    return EXIT_MISSED if any(result.outcome == "missed" for result in results) else 0
