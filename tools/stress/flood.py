"""A flood of commands: what is sent is applied or refused, each one counted, and time keeps its pace."""

from __future__ import annotations

import signal
import threading
import time

from load_session import Session, counts
from load_tables import row

from ldcs_ros.bags import read_bag
from ldcs_ros.messages import messages

JOINTS = ("left_joint_1", "right_joint_1")


def send(publishers, make, rate, duration, stop=None):
    """Publish `make(k)` = (topic, bytes) at a rate [Hz] on absolute deadlines; return how many went out."""
    start, k = time.monotonic(), 0
    while k < rate * duration and not (stop is not None and stop.is_set()):
        topic, cdr = make(k)
        publishers[topic].publish(cdr)
        k += 1
        time.sleep(max(0.0, start + k / rate - time.monotonic()))
    return k


def flood(folder, *, rate=1000.0, duration=10.0, scene="rig", publish_rate=200.0):
    """Flood a node with pressure and torque commands in turn; return the figures of the run."""
    with Session(folder, scene=scene, publish_rate=publish_rate, record="bag") as session:
        publishers = {
            "pressure_command": session.publisher("pressure_command", "std_msgs/msg/Float64MultiArray"),
            "torque_command": session.publisher("torque_command", "sensor_msgs/msg/JointState"),
        }

        def make(k):
            if k % 2:
                return "torque_command", messages.torque_command(0, JOINTS, [1e-6 * k, 1e-6 * k])
            return "pressure_command", messages.pressure_command([1.0 * k])

        before, start = session.health()["simulation"], time.monotonic()
        result = {}
        cpu = session.figures.cpu
        thread = threading.Thread(target=lambda: result.update(sent=send(publishers, make, rate, duration)))
        thread.start()
        session.user.until(lambda: not thread.is_alive(), duration + 30.0)
        result["took"] = time.monotonic() - start
        result["cpu"] = (session.figures.cpu - cpu) / result["took"]
        health = session.settled(result["sent"])
        result["applied"], result["refused"], result["missed"] = counts(health)
        after = health["simulation"]
        result["real_time_factor"] = (
            float(after["simulation time [s]"]) - float(before["simulation time [s]"])
        ) / (time.monotonic() - start)
        result["overruns"] = int(after["overruns"]) - int(before["overruns"])
        session.node.stop(signal.SIGINT)
    bag = read_bag(folder / "bag").counts
    # The last one vents the arms when the node ends.
    result["recorded"] = bag["/ldcs/pressure_command"] - 1
    return result


def rows(folder, tell, *, seconds=30.0):
    """Flood at 1 kHz and at 3 kHz, and judge."""
    result = []
    for rate in (1000.0, 3000.0):
        tell(f"{rate:g} commands a second, {seconds:g} s")
        (folder / f"{rate:g}").mkdir()
        run = flood(folder / f"{rate:g}", rate=rate, duration=seconds)
        total = run["applied"] + run["refused"] + run["missed"]
        name = f"{rate / 1e3:g} kHz: "
        sums = f"{run['applied']} + {run['refused']} + {run['missed']} of {run['sent']}"
        result += [
            row(f"{name}applied + refused + missed of sent", sums, "the sum", total == run["sent"]),
            row(
                f"{name}missed",
                run["missed"],
                "0" if rate == 1000.0 else "",
                run["missed"] == 0 or rate > 1000.0,
            ),
            row(f"{name}applied ones in the bag", run["recorded"], "all", run["recorded"] == run["applied"]),
            row(f"{name}processor [cores]", run["cpu"], "", True),
            row(
                f"{name}real-time factor",
                run["real_time_factor"],
                "1, or overruns that tell",
                run["real_time_factor"] > 0.98 or run["overruns"] > 0,
            ),
            row(f"{name}overruns, counted", run["overruns"], "", True),
        ]
    return result
