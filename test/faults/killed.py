"""A node killed while it records, and `ldcs recover`: how much of what was acknowledged is gone."""

from __future__ import annotations

import os
import signal
import time

from load_session import Session
from load_tables import row

from ldcs_ros.interface import messages
from ldcs_ros.recording import read_bag, recover
from ldcs_ros.replay.session import replay


def killed(folder, *, duration=3.0, rate=200.0):
    """Command a recording node, kill it in the middle of that, mend its bag; return the figures."""
    with Session(folder, scene="rig", publish_rate=rate, record="bag") as session:
        publisher = session.publisher("pressure_command", "std_msgs/msg/Float64MultiArray")
        session.user.listen("/ldcs/nodes", "sensor_msgs/PointCloud2")
        start, sent = time.monotonic(), []
        while time.monotonic() - start < duration:
            sent.append(messages.pressure_command([1.0e4 + len(sent)]))
            publisher.publish(sent[-1])
            session.user.spin(0.01)
        os.killpg(session.node.process.pid, signal.SIGKILL)
        session.node.process.wait(10.0)
        session.user.spin(0.1)
        stamp = session.user.received["/ldcs/nodes"][-1].header.stamp
    report = recover(folder / "bag")
    recording = read_bag(folder / "bag")
    kept = [one.cdr for one in recording.in_order(["/ldcs/pressure_command"])]
    return {
        "published until [s]": stamp.sec + 1e-9 * stamp.nanosec,
        "kept until [s]": recording.channels["/ldcs/nodes"].times[-1] / 1e9,
        "commands sent": len(sent),
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
    return [
        row("lost of each run [s]", ", ".join(f"{one:.3f}" for one in lost), "less than 1", max(lost) < 1.0),
        row(
            "commands sent, kept",
            ", ".join(f"{run['commands sent']}, {run['commands kept']}" for run in runs),
            "the first ones, in order",
            all(run["kept in order"] for run in runs),
        ),
        row(
            "mended bags that replay to the same bytes",
            sum(run["same"] for run in runs),
            "5",
            all(run["same"] for run in runs),
        ),
    ]
