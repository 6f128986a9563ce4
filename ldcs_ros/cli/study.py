"""`ldcs study`: what accuracy costs in time, measured here: CSV, diagram, report, recommendation."""

from __future__ import annotations

import argparse
import json
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ldcs_ros.cli.arguments import CommandLineError
from ldcs_ros.cli.output import Progress, print_json, print_pairs

if TYPE_CHECKING:
    from ldcs_ros.study.targets import Target

DESCRIPTION = """\
Measure what accuracy costs in time on this machine: every method with several accuracies and fixed steps, on several
scenes and lattices, beside a compiled RKC2 baseline and SciPy's BDF. Also measured: whether the error that was asked
for is kept on every shipped scene, what each effect costs, what commands at a rate and larger lattices cost, and how
far the lattice itself is off.
Writes study.csv, work_precision.png and study.md. Rows that are in study.csv already are not measured again, so an
interrupted study goes on where it stopped."""
EXAMPLE = """\
ldcs study
  ldcs study --targets
  ldcs study --full -o out/full
  ldcs study --full --jobs 8 -o out/full
  ldcs study --full --scheduler tcp://cluster:8786 -o out/full
  ldcs study --hard --only floor
  ldcs study --accuracy --scenes 200 --first-seed 1000"""

EXIT_NOT_KEPT = 1
MOST_JOBS = 256


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    preset = parser.add_mutually_exclusive_group()
    preset.add_argument(
        "--quick", dest="preset", action="store_const", const="quick", help="under two minutes (default)"
    )
    preset.add_argument(
        "--targets",
        dest="preset",
        action="store_const",
        const="targets",
        help="what this project set out to reach: asked, reached, kept or missed; some minutes",
    )
    preset.add_argument(
        "--full",
        dest="preset",
        action="store_const",
        const="full",
        help="everything: half an hour on two cores",
    )
    preset.add_argument(
        "--hard",
        dest="preset",
        action="store_const",
        const="hard",
        help="the hard cases instead: a quarter of an hour",
    )
    preset.add_argument(
        "--accuracy",
        dest="preset",
        action="store_const",
        const="accuracy",
        help="real errors against asked and estimated ones, on random and violent scenes with an independent reference",
    )
    parser.set_defaults(preset="quick")
    parser.add_argument(
        "--only", metavar="WORD", default="", help="with --hard and --accuracy: cases with it in their name"
    )
    parser.add_argument(
        "--scenes", metavar="N", type=int, default=60, help="with --accuracy: random scenes; 60 if not given"
    )
    parser.add_argument(
        "--first-seed",
        metavar="N",
        type=int,
        default=0,
        help="with --accuracy: seed of the first random scene; another one draws fresh scenes",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        type=Path,
        default=Path("out/study"),
        help="folder; out/study if not given",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs", metavar="N", type=_jobs, default=1, help="processes; with more than one, times are noisier"
    )
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on a Dask cluster: its scheduler's address, or 'local' to make one here (needs ldcs_ros[cluster])",
    )
    parser.add_argument(
        "--again",
        action="store_true",
        help="measure all of the preset anew, also what is in study.csv; rows of other presets stay",
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure, write the files, print targets or the recommendation; status 0, or 1 if the promised accuracy (with
    --targets: any target) is not kept."""
    from ldcs_ros.cli.accuracy import run_accuracy
    from ldcs_ros.cli.hard_cases import run_hard_cases
    from ldcs_ros.study.diagram import draw
    from ldcs_ros.study.execute import carry_out, of_other_tasks
    from ldcs_ros.study.plan import PRESETS
    from ldcs_ros.study.recommendation import recommendation
    from ldcs_ros.study.report import promise_is_kept, report
    from ldcs_ros.study.table import Table
    from ldcs_ros.study.targets import targets
    from ldcs_ros.study.tasks import key_of
    from ldcs_ros.study.timing import machine

    if arguments.preset == "hard":
        return run_hard_cases(arguments)
    if arguments.preset == "accuracy":
        return run_accuracy(arguments)
    folder, here = arguments.output, machine()
    path = folder / "study.csv"
    command = f"ldcs study --{arguments.preset}" + (f" --jobs {arguments.jobs}" if arguments.jobs > 1 else "")
    commands = _remember_machine(path, here, command, again=arguments.again)
    table, tasks = Table(path), PRESETS[arguments.preset]()
    if arguments.again:
        table.keep(of_other_tasks(table.rows, tasks))
    had = {key_of(row) for row in table.rows}
    with (
        Progress(
            sum(task.weight for task in tasks), label="study", unit="", quiet=arguments.json
        ) as progress,
        _place(arguments) as submit,
    ):
        carry_out(tasks, table, submit, on_done=progress.show, on_begin=progress.say)
    draw(table.rows, folder / "work_precision.png")
    text = report(table.rows, machine=here, commands=commands, picture="work_precision.png")
    (folder / "study.md").write_text(text, encoding="utf-8")
    failures = [row for row in table.rows if row.failure]
    kept, aims = promise_is_kept(table.rows), targets(table.rows)
    summary: dict[str, Any] = {
        "preset": arguments.preset,
        "rows": len(table.rows),
        "rows_from_before": len(had),
        "without_result": len(failures),
        "accuracy_kept": kept,
        "targets": [{**asdict(aim), "verdict": aim.verdict} for aim in aims],
        "recommendation": recommendation(table.rows),
        "machine": here,
        "table": str(path),
        "diagram": str(folder / "work_precision.png"),
        "report": str(folder / "study.md"),
    }
    if arguments.json:
        print_json(summary)
    else:
        before = f", {len(had)} measured before" if had else ""
        print_pairs(
            [
                ("rows", f"{len(table.rows)}{before}; {len(failures)} without a result, told in the report"),
                ("asked accuracy", "kept on every shipped scene" if kept else "NOT kept, see the report"),
                ("written", f"{summary['report']}, {summary['diagram']}, {summary['table']}"),
            ]
        )
        if arguments.preset == "targets":
            _print_targets(aims)
        else:
            print(f"\n{summary['recommendation']}")
    missed = arguments.preset == "targets" and any(aim.kept is False for aim in aims)
    return 0 if kept and not missed else EXIT_NOT_KEPT


def _print_targets(aims: list[Target]) -> None:
    print()
    for aim in aims:
        print(f"{aim.verdict:<6}  {aim.name}: {aim.asked}".replace("`", ""))
        print(f"        {aim.reached}".replace("`", ""))
        if aim.beside:
            print(f"        {aim.beside}")


def _place(arguments: argparse.Namespace) -> AbstractContextManager[Any]:
    from ldcs_ros.study import execute

    if arguments.scheduler is not None:
        return execute.cluster(arguments.scheduler)
    if arguments.jobs > 1:
        return execute.processes(arguments.jobs)
    return nullcontext(execute.in_this_process)


def _remember_machine(table: Path, here: dict[str, str], command: str, *, again: bool) -> list[str]:
    """Write beside a table what machine it is from and what made it; return all its commands.

    Rows of two machines are not mixed: such a study is refused, or begun anew with `again`.
    """
    path, commands = table.with_name("study_machine.json"), []
    if table.exists() and path.exists():
        there = json.loads(path.read_text(encoding="utf-8"))
        commands = there.pop("commands", [])
        different = sorted(name for name in {*here, *there} if here.get(name) != there.get(name))
        if different and not again:
            name = different[0]
            raise CommandLineError(
                f"{path.parent} holds a study with {name} '{there.get(name)}', here it is '{here.get(name)}': "
                f"times of two "
                f"machines or versions do not compare; choose another --output, or --again to measure anew"
            )
        if different:
            table.unlink()
            commands = []
    commands = [*(made for made in commands if made != command), command]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({**here, "commands": commands}, indent=2) + "\n", encoding="utf-8")
    return commands


def _jobs(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= MOST_JOBS:
        raise argparse.ArgumentTypeError(f"jobs is '{text}', expected a whole number of 1 ... {MOST_JOBS}")
    return int(text)
