"""The verdict on a replay: the same bytes as the original, or how far the node positions are apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from ldcs_ros.bags import Channel, Recording
from ldcs_ros.messages.topics import TOPICS
from ldcs_ros.signals.topics import find_topic
from ldcs_ros.signals.tracks import CLOUD, cloud_positions

MEASURED = {topic.type for topic in TOPICS.values() if topic.measured}
"""Types of messages with times of the computer: not compared."""


@dataclass(frozen=True)
class Verdict:
    """The comparison of a replay with the original run.

    Attributes:
        same_bytes: Every message, its time and the order of all are the same, without times of the computer.
        messages: Messages compared.
        first_difference: Place of the first difference, in words; '' when there is none.
        largest: Largest distance of a node from its original position [m], float32 in both; None without `nodes`.
        allowed: Distance that passes [m].
        differing: Software with another version, as 'name: then, now'.
    """

    same_bytes: bool
    messages: int
    first_difference: str
    largest: float | None
    allowed: float
    differing: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """The same bytes, or node positions within the allowed distance."""
        if self.same_bytes:
            return True
        return self.largest is not None and self.largest <= self.allowed


def compare_runs(
    original: Recording, again: Recording, *, allowed: float, differing: tuple[str, ...]
) -> Verdict:
    """Return the verdict on two recordings of the same run, as far as the original goes."""
    ours, theirs = _comparable(original), _comparable(again)
    topics, missing = sorted(ours & theirs), sorted(ours ^ theirs)
    difference, messages = "", 0
    for then, now in zip_longest(original.in_order(topics), again.in_order(topics)):
        # A bag that was cut off ends within the messages of one time.
        if then is None and now.time >= original.end:
            break
        if then != now:
            one = then or now
            what = "only one has it" if then is None or now is None else f"{then.topic} against {now.topic}"
            difference = f"message {messages + 1}, at {one.time / 1e9:.6f} s: {what}"
            break
        messages += 1
    if not difference and missing:
        difference = f"only one bag has the topic {missing[0]}"
    same = not difference
    largest = 0.0 if same else _largest(original, again)
    return Verdict(same, messages, difference, largest, allowed, differing)


def _comparable(recording: Recording) -> set[str]:
    return {topic for topic, info in recording.topics.items() if info.type not in MEASURED}


def _largest(original: Recording, again: Recording) -> float | None:
    """Return the largest distance of a node [m]; infinite where the second run lacks a surface."""
    ours, theirs = _clouds(original), _clouds(again)
    if ours is None or theirs is None:
        return None
    where = {time: index for index, time in enumerate(theirs.times.tolist())}
    largest = None
    for index, time in enumerate(ours.times.tolist()):
        if time not in where:
            return math.inf
        a, b = cloud_positions(ours.messages[index]), cloud_positions(theirs.messages[where[time]])
        if a.shape != b.shape:
            return None
        apart = float(np.linalg.norm(a - b, axis=1).max())
        largest = max(largest or 0.0, math.inf if math.isnan(apart) else apart)
    return largest


def _clouds(recording: Recording) -> Channel | None:
    topic = find_topic(recording, "nodes", CLOUD)
    return None if topic is None else recording.channels[topic]
