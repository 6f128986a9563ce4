"""`ldcs plot`: pictures of a bag, or of the natural modes of a scene."""

from __future__ import annotations

import argparse
from pathlib import Path

from ldcs_ros.cli.arguments import CommandLineError, add_picture_arguments, instant
from ldcs_ros.cli.output import Progress, open_bag, print_json
from ldcs_ros.cli.scene_argument import add_set, scene_with

DESCRIPTION = """\
Draw a bag: surface.png (the sheet in 3D at chosen times), points.png (displacement of P0, P1, ... against
time), drives.png (pressures, torques, joint angles) where there are arms, and with --animate the motion.
With --modes, draw modes.png of a scene instead: the natural modes around its rest state, and their damping."""
EXAMPLE = """\
ldcs plot out/paper
  ldcs plot out/paper --times 0 0.2 3 -o pictures --animate gif
  ldcs plot out/paper --format pdf --width column
  ldcs plot rig --modes -o pictures"""

MODES = 24


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "bag",
        metavar="BAG",
        help="bag folder, .mcap or .db3 file; with --modes a shipped scene or a YAML file",
    )
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="folder for the pictures; BAG_plots if not given"
    )
    parser.add_argument(
        "--modes", action="store_true", help="natural modes, frequencies and damping of a scene at rest"
    )
    parser.add_argument(
        "--times",
        metavar="T",
        type=instant,
        nargs="+",
        help="times of the surfaces [s]; chosen by the motion if not given",
    )
    add_picture_arguments(parser)
    parser.add_argument("--animate", choices=("gif", "mp4"), help="draw the motion too (mp4 needs ffmpeg)")
    add_set(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the pictures and print their paths; exit status 0."""
    from ldcs_ros.plotting.pictures import draw
    from ldcs_ros.plotting.style import STYLES

    if arguments.modes:
        return _draw_modes(arguments)
    if arguments.overrides:
        raise CommandLineError("--set changes a scene: it goes with --modes, not with a bag")
    bag = Path(arguments.bag)
    recording = open_bag(bag)
    folder = arguments.output or bag.with_name(f"{bag.stem}_plots")
    with Progress(1.0, label="motion", unit="", quiet=arguments.json or arguments.animate is None) as bar:
        written = draw(
            recording,
            folder,
            times=arguments.times,
            animate=arguments.animate,
            kind=arguments.format,
            style=STYLES[arguments.width],
            progress=lambda done, total: bar.show(done / total),
        )
    if arguments.json:
        print_json({"bag": str(bag), "files": [str(path) for path in written]})
    else:
        for path in written:
            print(path)
    return 0


def _draw_modes(arguments: argparse.Namespace) -> int:
    import numpy as np

    from ldcs_ros.plotting.annotations import annotations_of_scene
    from ldcs_ros.plotting.rest_state import modes_figure
    from ldcs_ros.plotting.style import STYLES, save_figure

    if arguments.times or arguments.animate:
        raise CommandLineError("--times and --animate draw a bag: they do not go with --modes")
    scene = scene_with(arguments.bag, arguments.overrides)
    simulation = scene.build()
    simulation.settle()
    linear = simulation.linearize(MODES)
    rest = np.array(simulation.state.position)
    rest[scene.lattice.missing] = np.nan
    annotations = annotations_of_scene(scene, title=scene.title or scene.name)
    style = STYLES[arguments.width]
    figure = modes_figure(linear, rest.reshape(2, *scene.lattice.nodes, 3), annotations, style)
    folder = arguments.output or Path(f"{scene.name}_plots")
    folder.mkdir(parents=True, exist_ok=True)
    path = save_figure(figure, folder / f"modes.{arguments.format}", style)
    if arguments.json:
        print_json(
            {
                "scene": scene.name,
                "frequencies": linear.frequencies.tolist(),
                "damping": linear.damping.tolist(),
                "files": [str(path)],
            }
        )
        return 0
    print(f"{'mode':>4} {'frequency [Hz]':>15} {'damping ratio':>14}")
    for number, (frequency, damping) in enumerate(zip(linear.frequencies, linear.damping, strict=True), 1):
        print(f"{number:>4} {frequency:>15.4g} {damping:>14.3g}")
    print(path)
    return 0
