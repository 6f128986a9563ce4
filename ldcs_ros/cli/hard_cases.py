"""`ldcs study --hard`: runs the catalogue of hard cases, prints a line each, writes hard_cases.md."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from ldcs_ros.cli.arguments import CommandLineError
from ldcs_ros.cli.output import Progress, print_json

EXIT_WRONG = 1


def run_hard_cases(arguments: argparse.Namespace) -> int:
    """Run the cases; status 0, or 1 if a case is neither right nor stopped with a reason."""
    from ldcs_ros.study.hard.catalogue import CASES
    from ldcs_ros.study.hard.report import as_text, summary, write_page
    from ldcs_ros.study.hard.runner import CaseResult, run_cases
    from ldcs_ros.study.timing import machine

    cases = [case for case in CASES.values() if arguments.only in case.name]
    if not cases:
        raise CommandLineError(f"--only is '{arguments.only}', expected a word in the name of a hard case")
    done = 0
    with Progress(len(cases), label="hard cases", unit="", quiet=arguments.json) as progress:

        def show(result: CaseResult) -> None:
            nonlocal done
            done += 1
            progress.show(done)
            if not arguments.json:
                print(as_text(result), flush=True)

        results = run_cases(cases, jobs=arguments.jobs, on_result=show)
    command = "ldcs study --hard" + (f" --only '{arguments.only}'" if arguments.only else "")
    command += f" --jobs {arguments.jobs}" if arguments.jobs > 1 else ""
    path = write_page(results, arguments.output, machine=machine(), command=command)
    if arguments.json:
        measured = [{**asdict(result), "case": result.case.name} for result in results]
        print_json({"rows": measured, "summary": summary(results), "page": str(path)})
    else:
        print(f"\n{summary(results)}\nwritten  {path}")
    return EXIT_WRONG if any(result.outcome == "wrong" for result in results) else 0
