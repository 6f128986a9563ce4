"""A node killed in the middle of a flood that it records, and `ldcs recover`: how much is gone."""

from __future__ import annotations

import os
import signal
import threading

from flood import send
from load_session import Session
from load_tables import row

from ldcs_ros.bags import read_bag, recover
from ldcs_ros.messages import messages
from ldcs_ros.replay.session import replay


def killed(folder, *, duration=2.0, rate=1000.0, publish_rate=200.0):
    """Command a recording node, kill it while commands come, mend its bag; return the figures.

    Args:
        folder: Where log and bag go.
        duration: When it is killed [s].
        rate: Commands a second [Hz].
        publish_rate: Reports a second [Hz].
    """
    sent: list[bytes] = []

    def make(k):
        sent.append(messages.pressure_command([1.0e4 + k]))
        return "pressure_command", sent[-1]

    with Session(folder, scene="rig", publish_rate=publish_rate, record="bag") as session:
        publishers = {
            "pressure_command": session.publisher("pressure_command", "std_msgs/msg/Float64MultiArray")
        }
        session.user.listen("/ldcs/nodes", "sensor_msgs/PointCloud2")
        stop = threading.Event()
        sender = threading.Thread(target=send, args=(publishers, make, rate, duration + 5.0, stop))
        sender.start()
        session.user.spin(duration)
        os.killpg(session.node.process.pid, signal.SIGKILL)
        session.node.process.wait(10.0)
        stop.set()
        sender.join()
        session.user.spin(0.1)
        stamp = session.user.received["/ldcs/nodes"][-1].header.stamp
    report = recover(folder / "bag")
    recording = read_bag(folder / "bag")
    kept = [one.cdr for one in recording.in_order(["/ldcs/pressure_command"])]
    return {
        "published until [s]": stamp.sec + 1e-9 * stamp.nanosec,
        "kept until [s]": recording.channels["/ldcs/nodes"].times[-1] / 1e9,
        "commands kept": len(kept),
        "kept in order": kept == sent[: len(kept)],
        "dropped [bytes]": report.dropped,
        "same": replay(folder / "bag", folder / "again").verdict.same_bytes,
    }


def rows(folder, tell):
    """Kill and judge, five times."""
    runs = []
    for k in range(5):
        (folder / str(k)).mkdir()
        runs.append(killed(folder / str(k), duration=2.0 + 0.23 * k))
        tell(f"kill -9 number {k + 1} of 5")
    lost = [run["published until [s]"] - run["kept until [s]"] for run in runs]
    kept = ", ".join(str(run["commands kept"]) for run in runs)
    in_order, same = all(run["kept in order"] for run in runs), sum(run["same"] for run in runs)
    return [
        row(
            "lost of each run, published but not kept [s]",
            ", ".join(f"{one:.3f}" for one in lost),
            "less than 1",
            max(lost) < 1.0,
        ),
        row(
            "commands kept of each, at 1 kHz",
            kept,
            "the first ones, in order, none in between missing",
            in_order,
        ),
        row("mended bags that replay to the same bytes", same, "5", same == 5),
    ]
