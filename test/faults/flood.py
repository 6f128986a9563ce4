"""A flood of commands: what is sent is applied or refused, each one counted, and time keeps its pace."""

from __future__ import annotations

import threading
import time

from load_session import Session

from ldcs_ros.interface import messages

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
        result["applied"], result["refused"] = session.counts(result["sent"])
        after = session.health()["simulation"]
        result["real_time_factor"] = (
            float(after["simulation time [s]"]) - float(before["simulation time [s]"])
        ) / (time.monotonic() - start)
        result["overruns"] = int(after["overruns"]) - int(before["overruns"])
        return result
