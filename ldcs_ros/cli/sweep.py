"""`ldcs sweep`: a scene at many values of its numbers and commands."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ldcs_ros.cli.arguments import CommandLineError, add_picture_arguments, count, only_with, seconds, seed
from ldcs_ros.cli.output import Progress, print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_set, scene_with

if TYPE_CHECKING:
    from ldcs_ros.sweep import SobolIndices, Sweep, SweepResult

DESCRIPTION = """\
Evaluate a scene at many values of its numbers and commands: on a grid, a Latin hypercube, or Saltelli's design on a
Sobol sequence, which gives the first and total Sobol indices. Writes a table (CSV, one row a sample), a JSON file
beside it that says which sweep it is of, and a picture. Rows that are in the table are not evaluated again, so an
interrupted sweep continues. The exit status is 1 if no sample has a value, or indices lack one."""
EXAMPLE = """\
ldcs sweep rig --over effects.payload.mass=0..0.08:9 --over pressure.left=0..120e3:7 --measure P1.z --settle -o t.csv
  ldcs sweep rig --over effects.payload.mass=0..0.08 --over effects.springs.stiffness=60..120 --sampling sobol \\
      --samples 128 --measure P1.z --measure radius --settle -o sobol.csv
  ldcs sweep paper --over effects.payload.mass=0..0.08:9 --measure P1.z --duration 2 --scheduler local -o p.csv"""

EXIT_NO_VALUES = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", metavar="SCENE", help="a shipped scene (see `ldcs scenes`) or a YAML file")
    parser.add_argument(
        "--over",
        metavar="PATH=LOW..HIGH[:LEVELS]",
        action="append",
        required=True,
        help="number of the scene, or pressure.ARM [Pa], torque.ARM, torque.JOINT [N m], wrench.FRAME.force.AXIS [N]; "
        "LEVELS for a grid; repeatable",
    )
    parser.add_argument(
        "--measure",
        metavar="NAME",
        action="append",
        required=True,
        dest="measures",
        help="POINT.x, .y or .z in ldcs_base [m], or radius of the actuated edges [m]; repeatable",
    )
    when = parser.add_mutually_exclusive_group(required=True)
    when.add_argument("--settle", action="store_true", help="measure at rest")
    when.add_argument(
        "--duration", metavar="S", type=seconds, help="simulate from the start and measure at its end [s]"
    )
    parser.add_argument("--sampling", choices=("grid", "latin", "sobol"), default="grid", help="grid")
    parser.add_argument(
        "--samples",
        metavar="N",
        type=count,
        help="latin: samples; sobol: base samples, a power of 2, of which N (factors + 2) are evaluated; 64",
    )
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="seed of drawn samples; 0")
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument("--jobs", metavar="N", type=count, help="processes; one a core")
    workers.add_argument(
        "--scheduler", metavar="ADDRESS", help="Dask scheduler, or 'local'; needs the extra [cluster]"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE.csv", type=Path, required=True, help="table; continued"
    )
    add_set(parser)
    add_picture_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the sweep, write table and picture; status 0, or 1 if values are missing that were needed."""
    from ldcs_ros.simulation.threads import core_count
    from ldcs_ros.sweep import Design, Sweep, run_sweep, sobol_indices
    from ldcs_ros.sweep.design import parse_factor

    if arguments.output.suffix != ".csv":
        raise CommandLineError(f"got {arguments.output}, expected a file that ends in .csv @ -o")
    if arguments.sampling == "grid":
        only_with("--sampling latin or sobol", {"--samples": arguments.samples})
    factors = tuple(map(parse_factor, arguments.over))
    design = Design(factors, arguments.sampling, arguments.samples or 64, arguments.seed)
    scene = scene_with(arguments.scene, arguments.overrides)
    sweep = Sweep(scene, design, tuple(arguments.measures), arguments.duration)
    with Progress(1.0, label=f"sweep {scene.name}", unit="", quiet=arguments.json) as bar:
        result = run_sweep(
            sweep,
            arguments.output,
            jobs=arguments.jobs or core_count(),
            scheduler=arguments.scheduler,
            progress=bar.show,
        )
    values = len(result.rows) - len(result.failures)
    indices: dict[str, SobolIndices] = {}
    if design.sampling == "sobol" and not result.failures:
        indices = {
            name: sobol_indices(design, result.measured[:, k]) for k, name in enumerate(sweep.measures)
        }
    picture = _draw(sweep, result, indices, arguments) if values else None
    if arguments.json:
        print_json(_as_dict(sweep, result, indices, arguments.output, picture))
    else:
        print_pairs(_lines(sweep, result, indices, arguments.output, picture))
    return 0 if values and (design.sampling != "sobol" or indices) else EXIT_NO_VALUES


def _draw(
    sweep: Sweep, result: SweepResult, indices: dict[str, SobolIndices], arguments: argparse.Namespace
) -> Path:
    from ldcs_ros.plotting.style import STYLES, save_figure
    from ldcs_ros.plotting.sweep import sweep_figure

    style = STYLES[arguments.width]
    figure = sweep_figure(
        [factor.path for factor in sweep.design.factors],
        sweep.measures,
        result.samples,
        result.measured,
        title=f"{sweep.scene.name}: {len(result.rows)} samples",
        indices=[(one.first, one.total) for one in indices.values()],
        style=style,
    )
    return save_figure(figure, arguments.output.with_suffix(f".{arguments.format}"), style)


def _as_dict(
    sweep: Sweep, result: SweepResult, indices: dict[str, SobolIndices], table: Path, picture: Path | None
) -> dict[str, object]:
    paths = [factor.path for factor in sweep.design.factors]
    return {
        "scene": sweep.scene.name,
        "samples": len(result.rows),
        "continued": result.continued,
        "failures": [{"sample": row.index, "reason": row.failure} for row in result.failures],
        "unstable": sum(row.stable is False for row in result.rows),
        "indices": {
            measure: {
                path: {
                    "first": one.first[k],
                    "first_interval": one.first_interval[:, k],
                    "total": one.total[k],
                    "total_interval": one.total_interval[:, k],
                }
                for k, path in enumerate(paths)
            }
            for measure, one in indices.items()
        },
        "table": table,
        "picture": picture,
    }


def _lines(
    sweep: Sweep, result: SweepResult, indices: dict[str, SobolIndices], table: Path, picture: Path | None
) -> list[tuple[str, str]]:
    before = f", {result.continued} of them from before" if result.continued else ""
    lines = [("samples", f"{len(result.rows)}{before}")]
    for k, measure in enumerate(sweep.measures):
        values = 1e3 * result.measured[:, k]
        known = values[values == values]
        if len(known):
            lines.append((measure, f"{known.min():.4f} ... {known.max():.4f} mm"))
    for measure, one in indices.items():
        for k, factor in enumerate(sweep.design.factors):
            first = f"first {one.first[k]:.3f} ({one.first_interval[0, k]:.3f} ... {one.first_interval[1, k]:.3f})"
            total = f"total {one.total[k]:.3f} ({one.total_interval[0, k]:.3f} ... {one.total_interval[1, k]:.3f})"
            lines.append((f"Sobol indices of {measure}", f"{factor.path}: {first}, {total}"))
    unstable = sum(row.stable is False for row in result.rows)
    if unstable:
        lines.append(("unstable", f"{unstable} rest states; the column 'stable' has them"))
    if result.failures:
        lines.append(("failed", f"{len(result.failures)} samples, the first: {result.failures[0].failure}"))
    if sweep.design.sampling == "sobol" and not indices:
        lines.append(("Sobol indices", "none, as samples failed; narrow the bounds"))
    return [*lines, ("table", str(table)), ("picture", "none" if picture is None else str(picture))]
