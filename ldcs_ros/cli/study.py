"""`ldcs study`: the cost of accuracy in time, measured here: CSV, diagram, report, recommendation."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ldcs_ros.cli.arguments import CommandLineError, count, only_with, seed
from ldcs_ros.cli.output import Progress, print_json, print_pairs

if TYPE_CHECKING:
    from ldcs_ros.study.targets import Target

DESCRIPTION = """\
Measure what accuracy costs in time on this machine: every method with several accuracies and fixed steps, on several
scenes and lattices, beside a compiled RKC2 baseline and SciPy's BDF. Also measured: the real error against the asked
one on every shipped scene, and the cost of each effect, of commands at a rate and of larger lattices, and the
lattice's own error.
Writes study.csv, study.md, work_precision.png (two panels) and work_precision_all.png. Rows that are in study.csv
already are not measured again, so an interrupted study continues."""
EXAMPLE = """\
ldcs study
  ldcs study --targets
  ldcs study --full -o out/full
  ldcs study --full --jobs 8 -o out/full
  ldcs study --full --scheduler tcp://cluster:8786 -o out/full
  ldcs study --hard --only floor
  ldcs study --accuracy --scenes 200 --first-seed 1000"""

EXIT_MISSED = 1
ALL_PANELS = "work_precision_all.png"
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
        help="each performance target: asked, reached, met or missed; some minutes",
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
        help="the hard cases instead: a quarter of an hour of processor time",
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
        "--scenes", metavar="N", type=count, help="with --accuracy: random scenes; 60 if not given"
    )
    parser.add_argument(
        "--first-seed",
        metavar="N",
        type=seed,
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
    parser.add_argument(
        "--against",
        metavar="CHECKOUT",
        type=Path,
        help="with --targets: folder of another checkout of this project; runs take turns with the same runs there",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs", metavar="N", type=_jobs, default=1, help="processes; with more than one, times are noisier"
    )
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run on a Dask cluster: its scheduler's address, or 'local' to make one here (needs the extra [cluster])",
    )
    parser.add_argument(
        "--again",
        action="store_true",
        help="measure the whole preset again; rows of other presets stay",
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure, write the files, print targets or the recommendation.

    The status is 0, or 1 if the accuracy check (with --targets: any target) is missed.
    """
    from ldcs_ros.cli.accuracy import run_accuracy
    from ldcs_ros.cli.hard_cases import run_hard_cases
    from ldcs_ros.study.accuracy_check import accuracy_summary
    from ldcs_ros.study.diagram import draw, draw_summary
    from ldcs_ros.study.execute import run_tasks, workers
    from ldcs_ros.study.plan import PRESETS, paired
    from ldcs_ros.study.recommendation import recommendation
    from ldcs_ros.study.report import report
    from ldcs_ros.study.rows import Table
    from ldcs_ros.study.targets import targets
    from ldcs_ros.study.timing import machine

    if arguments.preset != "accuracy":
        only_with("--accuracy", {"--scenes": arguments.scenes, "--first-seed": arguments.first_seed})
    if arguments.preset not in ("hard", "accuracy"):
        only_with("--hard or --accuracy", {"--only": arguments.only})
    if arguments.preset != "targets":
        only_with("--targets", {"--against": arguments.against})
    if arguments.preset == "hard":
        return run_hard_cases(arguments)
    if arguments.preset == "accuracy":
        return run_accuracy(arguments)
    folder, here = arguments.output, machine()
    path = folder / "study.csv"
    command = f"ldcs study --{arguments.preset}" + (f" --jobs {arguments.jobs}" if arguments.jobs > 1 else "")
    if arguments.against is not None:
        command += " --against CHECKOUT"
    commands = _remember_machine(path, here, command, again=arguments.again)
    table, tasks = Table(path), PRESETS[arguments.preset]()
    if arguments.against is not None:
        tasks += paired(str(_checkout(arguments.against)))
    if arguments.again:
        table.remove(tasks)
    had = {row.key for row in table.rows}
    with (
        Progress(
            sum(task.weight for task in tasks), label="study", unit="", quiet=arguments.json
        ) as progress,
        workers(arguments.jobs, arguments.scheduler) as submit,
    ):
        run_tasks(tasks, table, submit, on_done=progress.show, on_begin=progress.say)
    draw_summary(table.rows, folder / "work_precision.png")
    draw(table.rows, folder / ALL_PANELS)
    text = report(table.rows, machine=here, commands=commands, picture=ALL_PANELS)
    (folder / "study.md").write_text(text, encoding="utf-8")
    failures = [row for row in table.rows if row.failure]
    accuracy, aims = accuracy_summary(table.rows), targets(table.rows)
    summary: dict[str, Any] = {
        "preset": arguments.preset,
        "rows": len(table.rows),
        "rows_from_before": len(had),
        "without_result": len(failures),
        "accuracy_met": accuracy.met,
        "targets": [{**asdict(aim), "verdict": aim.verdict} for aim in aims],
        "recommendation": recommendation(table.rows),
        "machine": here,
        "table": str(path),
        "summary": str(folder / "work_precision.png"),
        "diagram": str(folder / ALL_PANELS),
        "report": str(folder / "study.md"),
    }
    if arguments.json:
        print_json(summary)
    else:
        before = f", {len(had)} measured before" if had else ""
        print_pairs(
            [
                (
                    "rows",
                    f"{len(table.rows)}{before}; {len(failures)} without a result, listed in the report",
                ),
                (
                    "asked accuracy",
                    "met on every shipped scene" if accuracy.met else "MISSED, see the report",
                ),
                ("written", f"{summary['report']}, {summary['diagram']}, {summary['table']}"),
            ]
        )
        if arguments.preset == "targets":
            _print_targets(aims)
        else:
            print(f"\n{summary['recommendation']}")
    missed = arguments.preset == "targets" and any(aim.met is False for aim in aims)
    return 0 if accuracy.met and not missed else EXIT_MISSED


def _checkout(folder: Path) -> Path:
    if not (folder / "ldcs_ros" / "__init__.py").is_file():
        raise CommandLineError(
            f"--against {folder}: no checkout of this project, its ldcs_ros/__init__.py is missing; "
            f"make one with `git worktree add {folder} COMMIT`"
        )
    return folder.resolve()


def _print_targets(aims: list[Target]) -> None:
    print()
    for aim in aims:
        print(f"{aim.verdict:<6}  {aim.name}: {aim.asked}".replace("`", ""))
        print(f"        {aim.reached}".replace("`", ""))
        if aim.others:
            print(f"        {aim.others}")


def _remember_machine(table: Path, here: dict[str, str], command: str, *, again: bool) -> list[str]:
    """Write the machine and the commands of a table into a file beside it; return all its commands.

    Rows of two machines are not mixed: such a study is refused, or restarted with `again`.
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
                f"machines or versions do not compare; choose another --output, or --again to measure again"
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
