"""`ldcs sensitivity`: how points of a scene move at rest with its commands and numbers."""

from __future__ import annotations

import argparse
import sys

from ldcs_ros.cli.arguments import picture
from ldcs_ros.cli.output import print_json
from ldcs_ros.cli.scene_argument import add_set, scene_with
from ldcs_ros.errors import SceneError

DESCRIPTION = """\
Print how points move at rest with commands and numbers of a scene, in metres per SI unit, by one linear solve at the
equilibrium. -o draws a bar for each
number. An unstable equilibrium is said on the error output."""
EXAMPLE = """\
ldcs sensitivity rig --of P1 --to pressure.left pressure.right effects.payload.mass
  ldcs sensitivity paper --of P0 P1 --to torque.left wrench.P1.force effects.arms.joint_stiffness -o tornado.png
  ldcs sensitivity three_arms --of P1 --to pressure.middle effects.arms.arms.middle.pressure_gain --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("scene", metavar="SCENE", help="a shipped scene (see `ldcs scenes`) or a YAML file")
    parser.add_argument(
        "--of", metavar="POINT", nargs="+", required=True, help="points, or node_<layer>_<i>_<j>"
    )
    parser.add_argument(
        "--to",
        metavar="NUMBER",
        nargs="+",
        required=True,
        help="pressure.ARM, torque.ARM, torque.JOINT, wrench.POINT.force, or a path such as effects.payload.mass",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=picture, help="picture of the values (png, pdf, svg)"
    )
    add_set(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the derivatives; exit status 0."""
    scene = scene_with(arguments.scene, arguments.overrides)
    simulation = scene.build()
    simulation.settle()
    try:
        found = simulation.sensitivity(arguments.of, arguments.to)
    except ValueError as error:
        raise SceneError(f"{scene.name}: {error}") from error
    if found.warning:
        print(f"ldcs: warning: {found.warning}", file=sys.stderr)
    if arguments.output is not None:
        from ldcs_ros.plotting.rest_state import sensitivity_figure
        from ldcs_ros.plotting.style import save_figure

        save_figure(sensitivity_figure(found, scene.name), arguments.output)
    if arguments.json:
        print_json(
            {
                "scene": scene.name,
                "rows": list(found.rows),
                "columns": list(found.to),
                "units": [f"m/({unit})" if unit else "m" for unit in found.units],
                "values": found.values.tolist(),
                "lowest_eigenvalue": found.lowest_eigenvalue,
                "warning": found.warning,
            }
        )
        return 0
    width = max(len(name) for name in found.to)
    print(f"{'':{width}}  {'unit':>12}" + "".join(f"{row:>13}" for row in found.rows))
    for name, unit, column in zip(found.to, found.units, found.values.T, strict=True):
        print(
            f"{name:{width}}  {f'm/({unit})' if unit else 'm':>12}" + "".join(f"{v:>13.4g}" for v in column)
        )
    return 0
