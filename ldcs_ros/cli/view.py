"""`ldcs view`: a bag, or a running twin, in a browser."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ldcs_ros.cli.arguments import CommandLineError, instant, only_with
from ldcs_ros.cli.output import Progress, open_bag, print_json

if TYPE_CHECKING:
    from ldcs_ros.bags import Recording
    from ldcs_ros.viewing.from_bag import Written

DESCRIPTION = """\
Show a bag in a browser: the surface with a time slider, arms, loads, the ways of P0 and P1, and the courses of
points, pressures, torques and angles. --live shows a running twin as it moves. The viewer (Rerun) comes with
`make viewer` or the extra [view] and needs no network; the page is on 127.0.0.1 alone (from elsewhere: ssh -L) and
may contact no other host. Ctrl-C ends it. --markers writes the bag again with what RViz and Foxglove draw."""
EXAMPLE = """\
ldcs view out/paper
  ldcs view out/paper --until 0.5 --screenshot half_a_second.png
  ldcs view --live --save session.rrd
  ldcs view --live --panel
  ldcs view out/paper --markers out/paper_for_rviz"""

DEFAULT_PORT = 9090
DEFAULT_NAMESPACE = "/ldcs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("bag", metavar="BAG", type=Path, nargs="?", help="bag folder, .mcap or .db3 file")
    parser.add_argument(
        "--live",
        metavar="NAMESPACE",
        nargs="?",
        const=DEFAULT_NAMESPACE,
        help=f"show the twin that runs in this namespace, {DEFAULT_NAMESPACE} if not given; needs ROS",
    )
    parser.add_argument(
        "--port", metavar="N", type=_port, default=DEFAULT_PORT, help="port of the page; 0 for any free one"
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address, open nothing")
    parser.add_argument(
        "--panel",
        action="store_true",
        help="with --live: sliders for the arms, pushes at a clicked node, pause, step, reset, record; needs no Rerun",
    )
    parser.add_argument("--until", metavar="S", type=instant, help="show the bag up to this time [s]")
    parser.add_argument(
        "--save", metavar="FILE", type=Path, help="write a .rrd file, which any Rerun viewer opens"
    )
    parser.add_argument(
        "--screenshot", metavar="FILE", type=Path, help="write a picture of the last moment (needs chromium)"
    )
    parser.add_argument(
        "--markers",
        metavar="DIR",
        type=Path,
        help="write a new bag that also holds surface, arms, loads, traces",
    )


def run(arguments: argparse.Namespace) -> int:
    """Show, or write what was asked for; exit status 0, also after Ctrl-C."""
    if (arguments.bag is None) == (arguments.live is None):
        raise CommandLineError("view needs a BAG, or --live for a running twin, and not both")
    if arguments.live is not None:
        return _run_live(arguments)
    only_with("--live", {"--panel": arguments.panel})

    recording = open_bag(arguments.bag)
    if arguments.markers is not None:
        return _write_markers(recording, arguments)
    if arguments.save is not None and arguments.screenshot is None:
        written = _write(recording, arguments.save, arguments, play="playing")
        _tell(arguments, written, file=str(arguments.save))
        return 0
    with tempfile.TemporaryDirectory(prefix="ldcs_view_") as folder:
        return _show(recording, Path(folder) / "recording.rrd", arguments)


def _show(recording: Recording, path: Path, arguments: argparse.Namespace) -> int:
    from ldcs_ros.viewing.browser_session import open_browser, save_picture, until_stopped
    from ldcs_ros.viewing.web_server import bag_site

    if (picture := arguments.screenshot) is not None:
        written = _write(recording, path, arguments, play="following")
        with bag_site(path, 0) as site:
            save_picture(site.address, picture)
        _tell(arguments, written, file=str(picture))
        return 0
    written = _write(recording, path, arguments, play="playing")
    with until_stopped() as stopped, bag_site(path, arguments.port) as site:
        _tell(arguments, written, url=site.address)
        if not arguments.no_browser:
            open_browser(site.address)
        while not stopped(1.0):
            pass
    return 0


def _write(recording: Recording, path: Path, arguments: argparse.Namespace, *, play: str) -> Written:
    from ldcs_ros.viewing.from_bag import write_bag

    until = float("inf") if arguments.until is None else arguments.until
    with Progress(1.0, label=f"view {arguments.bag.name}", unit="", quiet=arguments.json) as bar:
        frame = arguments.screenshot is None
        return write_bag(recording, path, until=until, play=play, frame=frame, progress=bar.show)


def _write_markers(recording: Recording, arguments: argparse.Namespace) -> int:
    from ldcs_ros.viewing.marker_bag import write_marker_bag

    with Progress(1.0, label=f"markers of {arguments.bag.name}", unit="", quiet=arguments.json) as bar:
        added = write_marker_bag(recording, arguments.markers, progress=bar.show)
    if arguments.json:
        print_json({"bag": str(arguments.bag), "file": str(arguments.markers), "added": added})
    else:
        print(f"{arguments.markers}: {added} marker messages added")
    return 0


def _run_live(arguments: argparse.Namespace) -> int:
    """Become the executable that listens to ROS, which this command line does without."""
    if arguments.until is not None or arguments.markers is not None:
        raise CommandLineError("--until and --markers belong to a bag, not to --live")
    if arguments.panel and (arguments.save is not None or arguments.screenshot is not None):
        raise CommandLineError("--save and --screenshot belong to the viewer, not to --panel")
    words = ["--namespace", arguments.live, "--port", str(arguments.port)]
    for name in ("save", "screenshot"):
        if getattr(arguments, name) is not None:
            words += [f"--{name}", str(getattr(arguments, name))]
    words += ["--no-browser"] if arguments.no_browser else []
    words += ["--panel"] if arguments.panel else []
    words += ["--json"] if arguments.json else []
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-m", "ldcs_ros.ros", "live_view", *words])


def _tell(
    arguments: argparse.Namespace, written: Written, *, url: str | None = None, file: str | None = None
) -> None:
    if arguments.json:
        print_json(
            {
                "bag": str(arguments.bag),
                "url": url,
                "file": file,
                "start": written.start,
                "end": written.end,
                "surfaces": written.surfaces,
                "every": written.every,
                "points": list(written.points),
                "plots": list(written.plots),
            }
        )
        sys.stdout.flush()
        return
    if written.every > 1:
        print(f"one out of {written.every} recorded surfaces is shown, {written.surfaces} in all")
    if file is not None:
        print(file)
    else:
        print(f"{arguments.bag} is shown at {url}   (Ctrl-C ends it)", flush=True)


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a port, 0 ... 65535")
    return int(text)
