"""`ldcs reach`: the commands under which points of a scene, or its whole shape, rest at their targets."""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ldcs_ros.cli.arguments import CommandLineError, count, hertz, metres, only_with, picture, seconds, seed
from ldcs_ros.cli.output import print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_set, scene_with
from ldcs_ros.errors import RecordingError, SceneError, one_line

if TYPE_CHECKING:
    from ldcs_ros.reach import Reached, ShapeTarget, TargetCoordinate, Variable
    from ldcs_ros.scene.scene import Scene
    from ldcs_ros.simulation.simulation import Simulation

DESCRIPTION = """\
Find commands within bounds whose rest state comes nearest to the targets, by the full model. Targets are coordinates in
ldcs_base [m], or a shape of the whole sheet, whose RMS counts. Prints the commands, what is reached, the distance that
remains and the sensitivities there. The exit status is 1 if more than --tolerance remains; the commands are then those
of the nearest rest state. --workspace draws where a point rests under commands all over their bounds instead.

Shapes: sphere:radius=0.5, cylinder:radius=0.5,axis=y, saddle:radius=0.5, sine:amplitude=0.01,length=0.2,axis=x, each
with x=, y= (its middle) and z= (its height, free without it); a positive radius is a dome. A CSV file has columns x,y,z
(points of a surface [m]) or i,j,z (heights of nodes [m]), and weight where wanted; :z=free frees its height.

--trajectory follows coordinates over time instead: a CSV file with columns time,P1.y,P1.z or the like [s, m]. The run
begins at the rest state of the scene. The result is a piecewise linear course of commands; --tolerance is its RMS."""
EXAMPLE = """\
ldcs reach rig --target P1.z=0.050 --vary pressure.left=0..190e3 --vary pressure.right=0..190e3
  ldcs reach three_arms --target P1.z=0.04 --target P0.z=0.012 --vary pressure.left=0..150e3 \\
      --vary pressure.middle=0..150e3 --vary pressure.right=0..150e3 --starts 8 -o reached.png --bag out/reached
  ldcs reach mould --shape sphere:radius=0.5 --vary 'pressure.*=0..150e3' --bound -o dome.png
  ldcs reach rig --workspace P1 --vary 'pressure.*=0..190e3' -o workspace.png
  ldcs reach rig --at 2.0 --trajectory circle.csv --vary 'pressure.*=0..200e3' --slew 'pressure.*=400e3' \
      --vary wrench.P1_aligned.force.y=-5..5 --tolerance 2e-4 --course course.csv -o course.png"""

EXIT_NOT_REACHED = 1
# Rest states whose coordinates differ by less are one [m, rad].
SAME_PLACE = 1e-6
_TARGET = re.compile(r"^(\w+)\.([xyz])=([^*]+)(?:\*(.+))?$")
_VARIABLE = re.compile(r"^([\w.]+\*?)=(.+)\.\.(.+)$")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", metavar="SCENE", help="a shipped scene (see `ldcs scenes`) or a YAML file")
    parser.add_argument(
        "--target",
        metavar="POINT.AXIS=M[*WEIGHT]",
        action="append",
        default=[],
        dest="targets",
        help="coordinate in ldcs_base that a point shall have [m]; repeatable",
    )
    parser.add_argument(
        "--shape", metavar="SHAPE", help="shape of the whole sheet, or a CSV file of one; see above"
    )
    parser.add_argument(
        "--bound",
        action="store_true",
        help="also print what would remain if every joint of the arms had a torque of its own",
    )
    parser.add_argument(
        "--workspace", metavar="POINT", help="draw where a point rests under commands all over their bounds"
    )
    parser.add_argument(
        "--trajectory", metavar="FILE", type=Path, help="CSV file of coordinates over time; see above"
    )
    parser.add_argument("--at", metavar="S", type=seconds, help="end of the course [s]; the file's last time")
    parser.add_argument(
        "--slew",
        metavar="COMMAND=RATE",
        action="append",
        default=[],
        help="fastest change of a command [1/s]",
    )
    parser.add_argument(
        "--interval", metavar="S", type=seconds, help="time between the knots of a course [s]; 0.1"
    )
    parser.add_argument("--rate", metavar="HZ", type=hertz, help="rate of the commands of a course [1/s]; 50")
    parser.add_argument("--course", metavar="FILE", type=Path, help="CSV file to write the course to")
    parser.add_argument(
        "--vary",
        metavar="COMMAND=LOW..HIGH",
        action="append",
        required=True,
        help="pressure.ARM [Pa], torque.ARM, torque.JOINT [N m] or wrench.POINT.force.AXIS [N]; repeatable. "
        "pressure.* means the pressure of every arm",
    )
    parser.add_argument(
        "--starts", metavar="N", type=count, default=1, help="starting points; each may find another solution"
    )
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="seed of the starting points")
    parser.add_argument(
        "--tolerance", metavar="M", type=metres, default=1e-5, help="distance that counts as reached [m]"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=picture, help="picture of the rest state (png, pdf, svg)"
    )
    parser.add_argument(
        "--bag",
        metavar="DIR",
        type=Path,
        help="new bag folder for the rest state, as `ldcs simulate --settle` records",
    )
    add_set(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the solutions; exit status 0, or 1 if the nearest one is not near enough."""
    if arguments.starts > 1000:
        raise CommandLineError(f"--starts: got {arguments.starts}, expected 1 ... 1000")
    aims = bool(arguments.targets) or arguments.shape is not None
    if aims + (arguments.workspace is not None) + (arguments.trajectory is not None) != 1:
        raise CommandLineError(
            "reach needs --target, --shape or both, or else --workspace POINT or --trajectory FILE alone"
        )
    if arguments.trajectory is None:
        names = ("at", "slew", "interval", "rate", "course")
        only_with("--trajectory", {f"--{name}": getattr(arguments, name) for name in names})
    if not aims:
        only_with("--target or --shape", {"--bag": arguments.bag, "--bound": arguments.bound})
    targets = [_target(text) for text in arguments.targets]
    scene = scene_with(arguments.scene, arguments.overrides)
    simulation = scene.build()
    variables = [one for text in arguments.vary for one in _variables(text, simulation.arm_names)]
    try:
        if arguments.trajectory is not None:
            return _follow(arguments, scene, _slewed(arguments.slew, variables))
        simulation.settle()
        if arguments.workspace is not None:
            return _workspace(arguments, scene, simulation, variables)
        return _reach(arguments, scene, simulation, targets, variables)
    except ValueError as error:
        raise SceneError(f"{scene.name}: {error}") from error
    except RecordingError:
        raise
    except OSError as error:
        raise SceneError(f"{error.filename or arguments.trajectory}: {one_line(error)}") from error


def _follow(arguments: argparse.Namespace, scene: Scene, variables: list[Variable]) -> int:
    from ldcs_ros.reach import find_course, read_trajectory

    trajectory = read_trajectory(arguments.trajectory)
    if arguments.at is not None:
        trajectory = trajectory.until(arguments.at)
    found = find_course(
        scene,
        trajectory,
        variables,
        interval=arguments.interval or 0.1,
        rate=arguments.rate or 50.0,
        tolerance=arguments.tolerance,
        progress=lambda text: print(f"ldcs: {text}", file=sys.stderr),
    )
    reached = found.rms <= arguments.tolerance
    if arguments.course is not None:
        table = [found.time, *found.commands.values()]
        lines = [",".join(["time", *found.commands])]
        lines += [",".join(f"{value:.9g}" for value in row) for row in zip(*table, strict=True)]
        arguments.course.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if arguments.output is not None:
        from ldcs_ros.plotting.reach import course_figure
        from ldcs_ros.plotting.style import save_figure

        save_figure(course_figure(found, trajectory, scene.name), arguments.output)
    if arguments.json:
        print_json(
            {
                "scene": scene.name,
                "reached": reached,
                "rms": found.rms,
                "largest": found.largest,
                "at_limits": list(found.at_limits),
                "steps": found.steps,
                "time": found.time.tolist(),
                "commands": {name: values.tolist() for name, values in found.commands.items()},
            }
        )
        return 0 if reached else EXIT_NOT_REACHED
    ranges = [(name, f"{values.min():.6g} to {values.max():.6g}") for name, values in found.commands.items()]
    held = f"; held by limits: {', '.join(found.at_limits)}" if found.at_limits else ""
    print_pairs(
        [
            *ranges,
            ("distance", f"RMS {1e3 * found.rms:.3g} mm, largest {1e3 * found.largest:.3g} mm{held}"),
            ("course", f"{len(found.time)} knots, {found.steps} Gauss-Newton steps"),
        ]
    )
    return 0 if reached else EXIT_NOT_REACHED


def _slewed(texts: list[str], variables: list[Variable]) -> list[Variable]:
    for text in texts:
        name, _, rate = text.partition("=")
        kind = name.removesuffix("*")
        try:
            slew = float(rate)
        except ValueError:
            slew = 0.0
        named = [one for one in variables if one.name == name or (kind != name and one.name.startswith(kind))]
        if not slew > 0.0 or not named:
            raise CommandLineError(
                f"--slew: got '{text}', expected a varied command and its rate, pressure.*=400e3"
            )
        variables = [replace(one, slew=slew) if one in named else one for one in variables]
    return variables


def _reach(
    arguments: argparse.Namespace,
    scene: Scene,
    simulation: Simulation,
    targets: list[TargetCoordinate],
    variables: list[Variable],
) -> int:
    from ldcs_ros.reach import free_arms, reach, shape_target

    shape = None if arguments.shape is None else shape_target(arguments.shape, scene.lattice)
    options = {"starts": arguments.starts, "seed": arguments.seed}
    found = reach(simulation, targets, variables, shape=shape, **options)
    best = found[0]
    bound = (
        free_arms(simulation, targets, variables, found, shape=shape, **options) if arguments.bound else None
    )
    reached = best.distance <= arguments.tolerance
    if arguments.output is not None:
        _draw(scene, best, shape, arguments.output)
    if arguments.bag is not None:
        _record(scene, best, arguments.bag)
    if arguments.json:
        print_json(
            {
                "scene": scene.name,
                "reached": reached,
                **_as_dict(best),
                "bound": None if bound is None else bound.distance,
                "solutions": list(map(_as_dict, found)),
            }
        )
    else:
        _print(found, targets, variables)
        if bound is not None:
            print_pairs([("free joints", f"{1e3 * bound.distance:.4g} mm would remain")])
    if not best.stable:
        print("ldcs: warning: the rest state is unstable; a disturbance leaves it", file=sys.stderr)
    return 0 if reached else EXIT_NOT_REACHED


def _workspace(
    arguments: argparse.Namespace, scene: Scene, simulation: Simulation, variables: list[Variable]
) -> int:
    from ldcs_ros.reach import workspace

    found = workspace(simulation, arguments.workspace, variables)
    low, high = found.extent
    if arguments.output is not None:
        from ldcs_ros.physics.points import point_at
        from ldcs_ros.plotting.reach import workspace_figure
        from ldcs_ros.plotting.style import save_figure

        point = point_at(scene.lattice, found.place, scene.points)
        flat = point.position(scene.lattice.reference_position)
        save_figure(workspace_figure(found, flat, scene.name), arguments.output)
    if arguments.json:
        flat_positions = found.position.reshape(-1, 3)
        print_json(
            {
                "scene": scene.name,
                "place": found.place,
                "levels": found.levels,
                "without_rest_state": found.failed,
                "low": low.tolist(),
                "high": high.tolist(),
                "positions": [None if row[0] != row[0] else row for row in flat_positions.tolist()],
            }
        )
        return 0
    spans = [
        (f"{found.place}.{axis}", f"{1e3 * a:.3f} to {1e3 * b:.3f} mm")
        for axis, a, b in zip("xyz", low, high, strict=True)
    ]
    failed = f"; {found.failed} without a rest state" if found.failed else ""
    count = found.levels ** len(variables)
    print_pairs([*spans, ("rest states", f"{count}, {found.levels} values of each command{failed}")])
    return 0


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


def _variables(text: str, arms: tuple[str, ...]) -> list[Variable]:
    from ldcs_ros.reach import Variable

    match = _VARIABLE.match(text)
    try:
        if match is None:
            raise ValueError
        names = [match[1]]
        if match[1] in ("pressure.*", "torque.*"):
            names = [match[1].replace("*", arm) for arm in arms]
        return [Variable(name, float(match[2]), float(match[3])) for name in names]
    except ValueError:
        raise CommandLineError(
            f"--vary: got '{text}', expected COMMAND=LOW..HIGH such as pressure.left=0..190e3"
        ) from None


def _as_dict(one: Reached) -> dict[str, object]:
    return {
        "commands": one.commands,
        "coordinates": one.reached,
        "distance": one.distance,
        "largest_shape_error": float(abs(one.shape_error).max()) if len(one.shape_error) else None,
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
        if len(one.shape_error):
            rms, largest = one.shape_rms, abs(one.shape_error).max()
            lines.append(("shape", f"RMS {1e3 * rms:.4g} mm, largest error of a node {1e3 * largest:.4g} mm"))
        lines.append(("distance", f"{1e3 * one.distance:.4g} mm{bounds}"))
        branch = "stable" if one.stable else "unstable"
        lines.append(("rest state", f"{branch}; optimality {one.optimality:.1e} m after {one.steps} steps"))
        print_pairs(lines)


def _record(scene: Scene, best: Reached, folder: Path) -> None:
    from ldcs_ros.twin.recorder import Recorder
    from ldcs_ros.twin.settings import RunSettings
    from ldcs_ros.twin.twin import Twin

    twin = Twin(scene.edited(inputs=list(best.schedule)), RunSettings())
    recorder = Recorder(folder, twin, custom_data={"settled": "true"})
    twin.sinks.append(recorder)
    twin.settle()
    simulation, nodes = twin.simulation, 3 * scene.lattice.n_nodes
    if abs(simulation.motion().q - best.coordinates).max() > SAME_PLACE:
        print(
            "ldcs: warning: by itself the scene rests elsewhere under these commands; a replay of the bag goes there",
            file=sys.stderr,
        )
        arms = simulation.model.arms
        simulation.start_from(
            best.coordinates[:nodes].reshape(-1, 3),
            link_angle=None if arms is None else arms.angles(best.coordinates),
        )
        twin.settle()
    end = twin.time
    while twin.next_time <= end:
        twin.advance_to_next()
    recorder.close()
    if recorder.error is not None:
        raise SceneError(f"{folder}: {recorder.error}")


def _draw(scene: Scene, best: Reached, shape: ShapeTarget | None, path: Path) -> None:
    import numpy as np

    from ldcs_ros.plotting.annotations import annotations_of_scene
    from ldcs_ros.plotting.style import save_figure

    nodes = best.coordinates[: 3 * scene.lattice.n_nodes].reshape(-1, 3).copy()
    nodes[scene.lattice.missing] = np.nan
    sheet = nodes.reshape(2, *scene.lattice.nodes, 3)
    title = ", ".join(f"{name} = {value:.4g}" for name, value in best.commands.items())
    if shape is None:
        from ldcs_ros.plotting.surface import surface_figure

        save_figure(surface_figure([sheet], [0.0], annotations_of_scene(scene, title=title)), path)
        return
    from ldcs_ros.plotting.reach import shape_error_figure

    error = np.full(scene.lattice.nodes, np.nan)
    error.flat[shape.nodes[:, 0]] = best.shape_error
    note = f"{shape.name}: RMS {1e3 * best.shape_rms:.3g} mm"
    annotations = annotations_of_scene(scene, title=scene.title or scene.name)
    save_figure(shape_error_figure(sheet, error, annotations, note), path)
