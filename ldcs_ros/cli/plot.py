"""`ldcs plot`: pictures of a bag."""

from __future__ import annotations

import argparse
from pathlib import Path

from ldcs_ros.cli.arguments import add_picture_arguments, instant
from ldcs_ros.cli.output import Progress, open_bag, print_json

DESCRIPTION = """\
Draw a bag: surface.png (the sheet in 3D at chosen times), points.png (displacement of P0, P1, ... against
time), drives.png (pressures, torques, joint angles) where there are arms, and with --animate the motion."""
EXAMPLE = """\
ldcs plot out/paper
  ldcs plot out/paper --times 0 0.2 3 -o pictures --animate gif
  ldcs plot out/paper --format pdf --width column"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag folder, .mcap or .db3 file")
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="folder for the pictures; BAG_plots if not given"
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


def run(arguments: argparse.Namespace) -> int:
    """Write the pictures and print their paths; exit status 0."""
    from ldcs_ros.plotting.pictures import draw
    from ldcs_ros.plotting.style import STYLES

    recording = open_bag(arguments.bag)
    folder = arguments.output or arguments.bag.with_name(f"{arguments.bag.stem}_plots")
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
        print_json({"bag": str(arguments.bag), "files": [str(path) for path in written]})
    else:
        for path in written:
            print(path)
    return 0
