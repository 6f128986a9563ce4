"""A live node under load: commanded with bytes, watched from outside, asked for its health by its own diagnostics."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from live import LiveNode, PlainUser, own_domain
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from ldcs_ros.ros.common.optional import message_type

NODE = "/ldcs/ldcs_sim"
CLOUD = message_type("sensor_msgs/msg/PointCloud2")
# What a sender counts as sent must not be overwritten in its own queue.
KEEP_ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=0, reliability=ReliabilityPolicy.RELIABLE)
_TICKS = os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Figures:
    """What the system says about a process.

    Attributes:
        memory: Resident memory [bytes].
        cpu: Processor time so far [s].
        threads: Number of threads.
        descriptors: Number of open files.
    """

    memory: int
    cpu: float
    threads: int
    descriptors: int


def figures(pid: int) -> Figures:
    """Return the figures of a process at this moment."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return Figures(
        memory=int(fields[21]) * _PAGE,
        cpu=(int(fields[11]) + int(fields[12])) / _TICKS,
        threads=int(fields[17]),
        descriptors=len(os.listdir(f"/proc/{pid}/fd")),
    )


def as_urgent_as_this(pid: int) -> None:
    """Give the session of a process the `nice` of this one, if that is urgent.

    Where Linux shares the processor out by sessions, `nice` counts within one only, and the node has its own.
    """
    group = Path(f"/proc/{pid}/autogroup")
    if os.nice(0) < 0 and group.exists():
        group.write_text(str(os.nice(0)))


class Session:
    """The node in its process and a plain ROS user beside it; to be used in a `with` statement.

    Args:
        folder: Where log and bag go.
        domain: ROS domain; None for one that no other test has at this time.
        parameters: Parameters of the node; `record` is a name in the folder.
    """

    def __init__(self, folder: Path, *, domain: int | None = None, **parameters):
        if parameters.get("record"):
            parameters["record"] = folder / parameters["record"]
        self.folder = folder
        self.bag = parameters.get("record")
        self.domain = own_domain() if domain is None else domain
        self.node = LiveNode(folder / "node.log", self.domain, **parameters)
        as_urgent_as_this(self.node.process.pid)
        self.user = PlainUser(self.domain)
        self.user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")

    def __enter__(self):
        self.health(timeout=30.0)
        return self

    def __exit__(self, *_):
        self.node.end()
        self.user.close()

    @property
    def figures(self) -> Figures:
        return figures(self.node.process.pid)

    def publisher(self, topic: str, kind: str):
        """Return a reliable publisher of bytes on a topic of the node, once the node listens."""
        publisher = self.user.node.create_publisher(message_type(kind), f"/ldcs/{topic}", KEEP_ALL)
        self.user.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def listen_raw(self, topic: str, kind: str, heard) -> None:
        """Call `heard` with the bytes of each message."""
        self.user.node.create_subscription(message_type(kind), topic, heard, 50, raw=True)

    def has_health(self) -> bool:
        """Tell whether a diagnostics message came since the last one was read."""
        return bool(self.user.received["/diagnostics"])

    def health(self, timeout: float = 5.0) -> dict[str, dict[str, str]]:
        """Return the entries of the next diagnostics message by name: their values, level and message."""
        self.user.received["/diagnostics"].clear()
        return self.latest_health(timeout)

    def latest_health(self, timeout: float = 5.0) -> dict[str, dict[str, str]]:
        """Return the entries of a message that came since the last one was read, or of the next one."""
        received = self.user.received["/diagnostics"]
        self.user.until(lambda: received, timeout)
        message = received[-1]
        received.clear()
        return {
            status.name.removeprefix(f"{NODE}: "): {
                "level": ord(status.level),
                "message": status.message,
                **{pair.key: pair.value for pair in status.values},
            }
            for status in message.status
        }

    def settled(self, sent: int, timeout: float = 10.0) -> dict[str, dict[str, str]]:
        """Return the diagnostics once every command that was sent is counted, or when the time is over [s]."""
        end = time.monotonic() + timeout
        while True:
            health = self.health()
            if sum(counts(health)) == sent or time.monotonic() > end:
                return health


def counts(health: dict[str, dict[str, str]]) -> tuple[int, int, int]:
    """Commands that were applied, refused and missed."""
    commands = health["commands"]
    names = ("accepted", "refused", "missed, queue full")
    return int(commands[names[0]]), int(commands[names[1]]), int(commands[names[2]])
