"""`ldcs vent`: ramp a rig's set-points to zero, without ROS for Modbus and serial rigs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ldcs_ros.cli.output import print_json

DESCRIPTION = """\
Vent a rig at once and wait until it confirms a set-point of zero. Use it when no bridge is at hand or the last
one did not end in order. Exit status 0: zero is confirmed; 1: it is not, cut the supply."""
EXAMPLE = "ldcs vent my_rig.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("rig", metavar="RIG", help="rig file, or the name of a shipped one")


def run(arguments: argparse.Namespace) -> int:
    """Vent and say what is left; exit status 0 after a confirmed zero, else 1."""
    from ldcs_ros.rig.rig_file import load_rig
    from ldcs_ros.rig.vent import vent_rig

    rig = load_rig(arguments.rig)
    left = vent_rig(rig, show=lambda line: print(line, file=sys.stderr, flush=True))
    if arguments.json:
        print_json({"rig": str(Path(arguments.rig)), "zero_confirmed": not left, "left": left})
    else:
        print(f"{left}; cut the supply" if left else "vented: the rig confirmed a set-point of zero")
    return 1 if left else 0
