"""A hundred subscribers that join and leave while a node runs: its memory, threads and pace stay as they were."""

from __future__ import annotations

import time

import rclpy
from load_session import Session, message_type
from load_tables import row
from rclpy.context import Context
from rclpy.node import Node

TOPICS = {
    "nodes": "sensor_msgs/msg/PointCloud2",
    "P1/pose": "geometry_msgs/msg/PoseStamped",
    "joint_states": "sensor_msgs/msg/JointState",
    "surface": "visualization_msgs/msg/Marker",
}


def joins(folder, *, count=100, at_once=10, scene="rig", publish_rate=200.0):
    """Let subscribers come and go, some of them at a time, each a participant of its own; return the figures."""
    with Session(folder, scene=scene, publish_rate=publish_rate) as session:
        crowd = [_Listener(session.domain) for _ in range(at_once)]
        _serve(crowd, session)
        for listener in crowd:
            listener.leave()
        before, pace, start = session.figures, session.health()["simulation"], time.monotonic()
        heard = 0
        for _ in range(count // at_once):
            crowd = [_Listener(session.domain) for _ in range(at_once)]
            _serve(crowd, session)
            heard += sum(listener.heard == set(TOPICS) for listener in crowd)
            for listener in crowd:
                listener.leave()
        health = session.health()["simulation"]
        elapsed = time.monotonic() - start
        after = session.figures
        return {
            "heard": heard,
            "count": count,
            "memory": (after.memory - before.memory) / 2**20,
            "threads": (before.threads, after.threads),
            "descriptors": (before.descriptors, after.descriptors),
            "overruns": int(health["overruns"]) - int(pace["overruns"]),
            "real-time factor": (float(health["simulation time [s]"]) - float(pace["simulation time [s]"]))
            / elapsed,
            "elapsed": elapsed,
        }


class _Listener:
    """A participant that wants one message of each topic."""

    def __init__(self, domain: int) -> None:
        self.heard: set[str] = set()
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node(
            "listener", context=self._context, start_parameter_services=False, enable_rosout=False
        )
        for topic, kind in TOPICS.items():
            self.node.create_subscription(
                message_type(kind),
                f"/ldcs/{topic}",
                lambda cdr, topic=topic: self.heard.add(topic),
                5,
                raw=True,
            )
        self.executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self.executor.add_node(self.node)

    def leave(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)


def _serve(crowd: list[_Listener], session: Session) -> None:
    end = time.monotonic() + 10.0
    while time.monotonic() < end and not all(listener.heard == set(TOPICS) for listener in crowd):
        for listener in crowd:
            listener.executor.spin_once(timeout_sec=0.0)
        session.user.spin(0.005)


def rows(folder, tell):
    """Let them come and go, and judge."""
    tell("100 subscribers, ten at a time")
    run = joins(folder)
    return [
        row(
            "subscribers that got each of four topics",
            run["heard"],
            f"{run['count']}",
            run["heard"] == run["count"],
        ),
        row(
            "growth of memory after the first ten [MiB]", run["memory"], "less than 20", run["memory"] < 20.0
        ),
        row("threads before, after", run["threads"], "the same", len(set(run["threads"])) == 1),
        row("open files before, after", run["descriptors"], "the same", len(set(run["descriptors"])) == 1),
        row("overruns", run["overruns"], "", True),
        row(
            "real-time factor",
            run["real-time factor"],
            "1, or overruns that tell",
            run["real-time factor"] > 0.98 or run["overruns"] > 0,
        ),
        row("joins and leaves a second", run["count"] / run["elapsed"], "", True),
    ]
