"""`ldcs reach`: the commands under which points of a scene rest at their targets."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ldcs_ros.cli.arguments import CommandLineError, metres, seed
from ldcs_ros.cli.output import print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_set, scene_with
from ldcs_ros.errors import SceneError

if TYPE_CHECKING:
    from ldcs_ros.reach import Reached, TargetCoordinate, Variable
    from ldcs_ros.scene.scene import Scene

DESCRIPTION = """\
Find commands within bounds whose rest state comes nearest to the targets, by the full model. Targets are coordinates in
ldcs_base [m]. Prints the commands, what is reached, the distance that remains and the sensitivities there. The exit
status is 1 if a target stays farther away than --tolerance; the commands are then those of the nearest point."""
EXAMPLE = """\
ldcs reach rig --target P1.z=0.050 --vary pressure.left=0..190e3 --vary pressure.right=0..190e3
  ldcs reach three_arms --target P1.z=0.04 --target P0.z=0.012 --vary pressure.left=0..150e3 \\
      --vary pressure.middle=0..150e3 --vary pressure.right=0..150e3 --starts 8 -o reached.png --json"""

EXIT_NOT_REACHED = 1
_TARGET = re.compile(r"^(\w+)\.([xyz])=([^*]+)(?:\*(.+))?$")
_VARIABLE = re.compile(r"^([\w.]+)=(.+)\.\.(.+)$")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", metavar="SCENE", help="a shipped scene (see `ldcs scenes`) or a YAML file")
    parser.add_argument(
        "--target",
        metavar="POINT.AXIS=M[*WEIGHT]",
        action="append",
        required=True,
        dest="targets",
        help="coordinate in ldcs_base that a point shall have [m]; repeatable",
    )
    parser.add_argument(
        "--vary",
        metavar="COMMAND=LOW..HIGH",
        action="append",
        required=True,
        help="pressure.ARM [Pa], torque.ARM, torque.JOINT [N m] or wrench.POINT.force.AXIS [N]; repeatable",
    )
    parser.add_argument(
        "--starts", metavar="N", type=int, default=1, help="starting points; each may find another solution"
    )
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="seed of the starting points")
    parser.add_argument(
        "--tolerance", metavar="M", type=metres, default=1e-5, help="distance that counts as reached [m]"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=Path, help="picture of the rest state (png, pdf, svg)"
    )
    add_set(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the solutions; exit status 0, or 1 if the nearest one is not near enough."""
    from ldcs_ros.reach import reach

    if not 1 <= arguments.starts <= 1000:
        raise CommandLineError(f"--starts: got {arguments.starts}, expected 1 ... 1000")
    targets = [_target(text) for text in arguments.targets]
    variables = [_variable(text) for text in arguments.vary]
    scene = scene_with(arguments.scene, arguments.overrides)
    simulation = scene.build()
    simulation.settle()
    try:
        found = reach(simulation, targets, variables, starts=arguments.starts, seed=arguments.seed)
    except ValueError as error:
        raise SceneError(f"{scene.name}: {error}") from error
    best = found[0]
    reached = best.distance <= arguments.tolerance
    if arguments.output is not None:
        _draw(scene, best, arguments.output)
    if arguments.json:
        print_json(
            {
                "scene": scene.name,
                "reached": reached,
                **_as_dict(best),
                "solutions": list(map(_as_dict, found)),
            }
        )
    else:
        _print(found, targets, variables)
    if not best.stable:
        print("ldcs: warning: the rest state is unstable; a disturbance leaves it", file=sys.stderr)
    return 0 if reached else EXIT_NOT_REACHED


def _target(text: str) -> TargetCoordinate:
    from ldcs_ros.reach import TargetCoordinate

    match = _TARGET.match(text)
    try:
        if match is None:
            raise ValueError
        return TargetCoordinate(match[1], match[2], float(match[3]), float(match[4] or 1.0))
    except ValueError:
        raise CommandLineError(
            f"--target: got '{text}', expected POINT.AXIS=METRES such as P1.z=0.050"
        ) from None


def _variable(text: str) -> Variable:
    from ldcs_ros.reach import Variable

    match = _VARIABLE.match(text)
    try:
        if match is None:
            raise ValueError
        return Variable(match[1], float(match[2]), float(match[3]))
    except ValueError:
        raise CommandLineError(
            f"--vary: got '{text}', expected COMMAND=LOW..HIGH such as pressure.left=0..190e3"
        ) from None


def _as_dict(one: Reached) -> dict[str, object]:
    return {
        "commands": one.commands,
        "coordinates": one.reached,
        "distance": one.distance,
        "optimality": one.optimality,
        "at_bounds": list(one.at_bounds),
        "sensitivity": one.sensitivity.tolist(),
        "stable": one.stable,
        "steps": one.steps,
    }


def _print(found: list[Reached], targets: list[TargetCoordinate], variables: list[Variable]) -> None:
    for number, one in enumerate(found):
        if number:
            print()
        lines = [(name, f"{value:.6g}") for name, value in one.commands.items()]
        for target, slopes in zip(targets, one.sensitivity, strict=True):
            by = ", ".join(
                f"{1e3 * slope:.3g} mm by {variable.name}"
                for slope, variable in zip(slopes, variables, strict=True)
            )
            place = one.reached[target.name]
            lines.append(
                (target.name, f"{1e3 * place:.4f} mm, asked {1e3 * target.value:.4f} mm; per unit {by}")
            )
        bounds = f", held by bounds: {', '.join(one.at_bounds)}" if one.at_bounds else ""
        lines.append(("distance", f"{1e3 * one.distance:.3g} mm{bounds}"))
        branch = "stable" if one.stable else "unstable"
        lines.append(("rest state", f"{branch}; optimality {one.optimality:.1e} m after {one.steps} steps"))
        print_pairs(lines)


def _draw(scene: Scene, best: Reached, path: Path) -> None:
    from ldcs_ros.plotting.annotations import annotations_of_scene
    from ldcs_ros.plotting.style import save_figure
    from ldcs_ros.plotting.surface import surface_figure

    nodes = best.coordinates[: 3 * scene.lattice.n_nodes].reshape(-1, 3).copy()
    nodes[scene.lattice.missing] = float("nan")
    sheet = nodes.reshape(2, *scene.lattice.nodes, 3)
    title = ", ".join(f"{name} = {value:.4g}" for name, value in best.commands.items())
    save_figure(surface_figure([sheet], [0.0], annotations_of_scene(scene, title=title)), path)
