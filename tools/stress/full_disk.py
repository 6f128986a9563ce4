"""A disk that fills up under a recording node: one clear line, and the simulation goes on."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
from contextlib import contextmanager

from load_session import Session
from load_tables import row

from ldcs_ros.bags import read_bag, recover


@contextmanager
def small_disk(folder, room):
    """Mount a small disk in a folder where the system allows it; yields what it is."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={room}", "tmpfs", str(folder)]
    mounted = os.geteuid() == 0 and subprocess.run(mount, capture_output=True).returncode == 0
    try:
        yield f"{room / 1e6:g} MB, {'tmpfs' if mounted else 'RLIMIT_FSIZE'}"
    finally:
        if mounted:
            subprocess.run(["umount", "--lazy", str(folder)], capture_output=True)


def full_disk(folder, *, room=2_000_000):
    """Record onto a small disk until it is full and a second longer; return the figures."""
    with small_disk(folder / "disk", room) as kind:
        limit = "tmpfs" not in kind
        with Session(folder, scene="rig", publish_rate=200.0, record="disk/bag") as session:
            if limit:
                resource.prlimit(session.node.process.pid, resource.RLIMIT_FSIZE, (room, room))
            recorder = session.health()["recorder"]
            while recorder["level"] == 0:
                recorder = session.health()["recorder"]
            full = session.health()["simulation"]
            session.user.spin(1.0)
            after = session.health()
            status = session.node.stop(signal.SIGINT)
            lines = [line for line in session.node.output.splitlines() if "stopped at" in line]
        # Mended where there is room, as its advice says.
        kept = folder / "kept"
        subprocess.run(["cp", "-r", str(folder / "disk" / "bag"), str(kept)], check=True)
        report = recover(kept)
        return {
            "kind": kind,
            "message": recorder["message"],
            "lines": len(lines),
            "went on": float(after["simulation"]["simulation time [s]"]) - float(full["simulation time [s]"]),
            "exit status": status,
            "messages kept": report.messages,
            "kept until [s]": read_bag(kept).channels["/ldcs/nodes"].times[-1] / 1e9,
        }


def rows(folder, tell):
    """Fill a disk and judge."""
    tell("filling a small disk")
    run = full_disk(folder)
    clear = "\\n" not in run["message"] and "ldcs recover" in run["message"]
    return [
        row("the disk", run["kind"], "", True),
        row("error lines in the log", run["lines"], "1", run["lines"] == 1),
        row(
            "what they say",
            run["message"].replace(str(folder), "..."),
            "one line: what, where, what to do",
            clear,
        ),
        row("simulation time after that [s]", run["went on"], "goes on", run["went on"] > 0.5),
        row(
            "exit status after Ctrl-C",
            run["exit status"],
            "1: the recording stopped",
            run["exit status"] == 1,
        ),
        row("messages kept by ldcs recover", run["messages kept"], "more than 0", run["messages kept"] > 0),
    ]
