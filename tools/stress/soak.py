"""A long run at a high publish rate, commanded and recorded: memory, pace and bag from its start to its end."""

from __future__ import annotations

import math
import signal
import time
from dataclasses import dataclass

import numpy as np
from load_session import Figures, Session, counts
from load_tables import row
from witness import Witness

from ldcs_ros.bags import read_bag
from ldcs_ros.messages import messages
from ldcs_ros.replay.session import replay

NODES = "/ldcs/nodes"
COMMANDS = "/ldcs/pressure_command"
COMMAND_RATE = 10.0
LONG_RUN_DOMAIN = 231
"""Beyond those that tests take: an hour is long enough for two of them to meet."""


@dataclass(frozen=True)
class Sample:
    """What was seen at one time.

    Attributes:
        wall: Steady clock since the start [s].
        simulated: Simulation time [s].
        overruns: Overruns so far.
        lateness: Worst lateness in the last second [s].
        figures: Of the process.
    """

    wall: float
    simulated: float
    overruns: int
    lateness: float
    figures: Figures


def soak(
    folder, *, duration, publish_rate=200.0, scene="rig", again=False, domain=None, tell=lambda sample: None
):
    """Run a node for a wall time [s] and return what was measured by name.

    Args:
        folder: Where log and bags go.
        duration: How long [s].
        publish_rate: Reports a second [Hz].
        scene: Scene, with arms driven by pressure.
        domain: ROS domain; None for one of its own.
        again: Replay the bag too: a quarter of an hour for an hour of it.
        tell: Called with each sample, one a second.
    """
    samples: list[Sample] = []
    heard = [0]
    with Session(folder, domain=domain, scene=scene, publish_rate=publish_rate, record="bag") as session:
        publisher = session.publisher("pressure_command", "std_msgs/msg/Float64MultiArray")
        session.listen_raw(
            NODES, "sensor_msgs/msg/PointCloud2", lambda cdr: heard.__setitem__(0, heard[0] + 1)
        )
        witness = Witness(publish_rate)
        start, sent = time.monotonic(), 0
        while time.monotonic() - start < duration:
            session.user.spin(max(0.0, start + sent / COMMAND_RATE - time.monotonic()))
            publisher.publish(messages.pressure_command([wave(sent), wave(sent + 7)]))
            sent += 1
            if session.has_health():
                pace = session.latest_health()["simulation"]
                samples.append(
                    Sample(
                        time.monotonic() - start,
                        float(pace["simulation time [s]"]),
                        int(pace["overruns"]),
                        float(pace["worst lateness [s]"]),
                        session.figures,
                    )
                )
                tell(samples[-1])
        health = session.settled(sent)
        applied, refused, missed = counts(health)
        machine = witness.end()
        status = session.node.stop(signal.SIGINT)
    measured = {
        "sent": sent,
        "applied": applied,
        "refused": refused,
        "missed": missed,
        "recorder": health["recorder"]["message"],
        "exit status": status,
        "heard": heard[0],
        "overruns of an empty loop": machine[0],
        "worst lateness of an empty loop [s]": machine[1],
    }
    return {**measured, **course(samples), **bag_figures(folder / "bag", publish_rate, again)}


def rows(folder, tell, *, seconds=3600.0, again=True):
    """Soak and judge; without `again` the bag is not replayed, which takes a quarter of the time."""
    said = [0.0]

    def show(sample):
        if sample.wall >= said[0]:
            said[0] += 60.0
            memory = sample.figures.memory / 2**20
            tell(
                f"{sample.wall:.0f} s: {memory:.1f} MiB, {sample.overruns} overruns, t = {sample.simulated:.3f} s"
            )

    run = soak(folder, duration=seconds, domain=LONG_RUN_DOMAIN, again=again, tell=show)
    growth, pace = run["memory growth, second half [MiB/h]"], run["real-time factor"]
    first, second = run["overruns, first half"], run["overruns, second half"]
    commands = run["commands in the bag"]
    return [
        row("wall time [s]", run["duration [s]"], "", True),
        row("real-time factor", f"{pace:.5f}", "0.99 ... 1.001", 0.99 <= pace <= 1.001),
        row("processor [cores]", run["processor [cores]"], "", True),
        row("memory after a tenth of the time [MiB]", run["memory after a tenth [MiB]"], "", True),
        row("memory at the end [MiB]", run["memory at the end [MiB]"], "", True),
        row(
            "growth of memory in the second half [MiB/h]",
            growth,
            "less than 10: the index of the bag is 3",
            growth < 10.0 or seconds < 600.0,
        ),
        row("overruns (later than 20 ms), first half", first, "", True),
        row(
            "overruns, second half",
            second,
            "no more than twice the first half + 10, or all no more than the empty loop's",
            second <= 2 * first + 10 or first + second <= run["overruns of an empty loop"],
        ),
        row("overruns of an empty loop beside it", run["overruns of an empty loop"], "", True),
        row("worst lateness [s]", run["worst lateness [s]"], "", True),
        row("worst lateness of the empty loop [s]", run["worst lateness of an empty loop [s]"], "", True),
        row("threads at start, at end", run["threads"], "the same", len(set(run["threads"])) == 1),
        row(
            "open files after a tenth, at end",
            run["descriptors"],
            "the same",
            len(set(run["descriptors"])) == 1,
        ),
        row("commands sent", run["sent"], "", True),
        row(
            "applied + refused",
            f"{run['applied']} + {run['refused']}",
            "as sent",
            run["applied"] == run["sent"],
        ),
        row(
            "commands in the bag",
            commands,
            "as applied, and the vent at the end",
            commands == run["applied"] + 1,
        ),
        row("reports in the bag", run["reports in the bag"], "", True),
        row(
            "reports out of their 5 ms grid",
            run["reports missing in between"],
            "0",
            not run["reports missing in between"],
        ),
        row("clouds that a subscriber got", run["heard"], "", True),
        row("messages in the bag", run["messages in the bag"], "", True),
        row("size of the bag [MiB]", run["bag size [MiB]"], "", True),
        row("exit status after Ctrl-C", run["exit status"], "0", run["exit status"] == 0),
        *(
            [row("replay of the bag", "the same bytes" if same else "differs", "the same bytes", same)]
            if (same := run["replays to the bit"]) is not None
            else []
        ),
    ]


def wave(k):
    """Return the k-th commanded gauge pressure [Pa]; no two neighbours are alike, so each one is a command."""
    return 6.0e4 + 4.0e4 * math.sin(2.0 * math.pi * k / 173.0)


def course(samples):
    """Return memory and pace of a run from its samples; the first tenth warms up."""
    times = np.array([sample.wall for sample in samples])
    memory = np.array([sample.figures.memory for sample in samples]) / 2**20
    overruns = np.array([sample.overruns for sample in samples])
    begin, middle = len(samples) // 10, len(samples) // 2
    first, last = samples[0], samples[-1]
    elapsed = last.wall - first.wall
    return {
        "duration [s]": elapsed,
        "real-time factor": (last.simulated - first.simulated) / elapsed,
        "processor [cores]": (last.figures.cpu - first.figures.cpu) / elapsed,
        "memory after a tenth [MiB]": memory[begin],
        "memory at the end [MiB]": memory[-1],
        "largest memory [MiB]": memory.max(),
        "memory growth [MiB/h]": 3600.0 * np.polyfit(times[begin:], memory[begin:], 1)[0],
        "memory growth, second half [MiB/h]": 3600.0 * np.polyfit(times[middle:], memory[middle:], 1)[0],
        "overruns, first half": int(overruns[middle] - overruns[0]),
        "overruns, second half": int(overruns[-1] - overruns[middle]),
        "worst lateness [s]": max(sample.lateness for sample in samples),
        "threads": (first.figures.threads, last.figures.threads),
        "descriptors": (samples[begin].figures.descriptors, last.figures.descriptors),
    }


def bag_figures(folder, publish_rate, again):
    """Return what a bag holds, whether each report is in it, and whether it replays to the bit."""
    recording = read_bag(folder)
    times = recording.channels[NODES].times
    ticks = np.rint(np.arange(len(times)) / publish_rate * 1e9).astype(np.int64)
    same = replay(folder, folder.with_name("again")).verdict.same_bytes if again else None
    return {
        "bag size [MiB]": sum(file.stat().st_size for file in folder.iterdir()) / 2**20,
        "messages in the bag": recording.count,
        "reports in the bag": len(times),
        "reports missing in between": int(np.abs(times - ticks).max() > 1),
        # The last one vents the arms when the node ends.
        "commands in the bag": len(recording.channels[COMMANDS]),
        "replays to the bit": same,
    }
