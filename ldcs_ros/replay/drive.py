"""The drive of a twin through a recorded run, each command at its own place between the events."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from ldcs_ros.messages.cdr import nanoseconds
from ldcs_ros.messages.topics import Topic
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.twin.twin import Twin


class TimedCommand(Protocol):
    """One recorded command.

    Attributes:
        time: Simulation time at which it acted [ns].
        after: Number of the twin's messages of that very time before it; None for all of them.
    """

    @property
    def time(self) -> int: ...

    @property
    def after(self) -> int | None: ...

    def command(self, simulation: Simulation) -> tuple[str, bytes] | None:
        """Return topic and message for the present simulation; None if nothing would change."""
        ...

    def refused(self, reason: str) -> None:
        """Count a refusal by the twin."""
        ...


@dataclass(frozen=True)
class RecordedCommand:
    """A command of our own bag, given unchanged.

    Attributes:
        time: Simulation time at which it acted [ns].
        after: Number of the twin's messages of that very time before it; None for all of them.
        topic: Relative name of the topic.
        cdr: The message.
    """

    time: int
    after: int | None
    topic: str
    cdr: bytes

    def command(self, simulation: Simulation) -> tuple[str, bytes]:
        """Return topic and CDR message as recorded."""
        return self.topic, self.cdr

    def refused(self, reason: str) -> None:
        """Count nothing: the drive counts its own refusals."""


@dataclass
class Outcome:
    """The counts of a drive.

    Attributes:
        applied: Commands applied.
        unchanged: Commands without an effect, left out.
        refused: Commands that the twin refused, by reason.
        not_reached: Commands whose time was not reached before the end.
        last_refusal: The latest refusal in words, with its time.
        interrupted: It was asked to end early.
    """

    applied: int = 0
    unchanged: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    not_reached: int = 0
    last_refusal: str = ""
    interrupted: bool = False


class _Emitted:
    """A sink that counts the messages of the latest time [ns], as `after` counts them."""

    def __init__(self, topics: dict[str, Topic]) -> None:
        self._counted = {name for name, topic in topics.items() if is_counted(topic)}
        self._time = -1
        self._count = 0

    def __call__(self, topic: str, message_type: str, cdr: bytes, time_ns: int) -> None:
        if topic in self._counted:
            self._count = self._count + 1 if time_ns == self._time else 1
            self._time = time_ns

    def at(self, time_ns: int) -> int:
        return self._count if time_ns == self._time else 0


def is_counted(topic: Topic) -> bool:
    """Return whether a topic's messages mark places in a run: those that a twin reports the same way again."""
    return topic.direction == "out" and topic.recorded and not topic.measured


def drive(
    twin: Twin,
    commands: Sequence[TimedCommand],
    *,
    end: int,
    last: int | None = None,
    progress: Callable[[float], None] = lambda time: None,
    stop: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Advance a twin from its start through all commands to an end.

    Args:
        twin: A twin that has emitted nothing.
        commands: The commands, by time.
        end: Simulation time of the end [ns].
        last: Number of the twin's messages of that very time; None for all.
        progress: Called with the simulation time [s] at each event.
        stop: Asked at each event; True ends early.

    Raises:
        DivergenceError: The simulation cannot go on; all messages before that have been emitted.
    """
    outcome = Outcome()
    emitted = _Emitted(twin.topics)
    twin.sinks.append(emitted)

    def advance(time: int, after: int | None) -> bool:
        while not stop():
            due = nanoseconds(twin.next_time)
            if due > time or (due == time and after is not None and emitted.at(time) >= after):
                return True
            twin.advance_to_next()
            progress(twin.time)
        return False

    try:
        for index, command in enumerate(commands):
            if command.time > end or outcome.interrupted:
                outcome.not_reached = len(commands) - index
                break
            if not advance(command.time, command.after):
                outcome.interrupted = True
            else:
                if nanoseconds(twin.time) != command.time:
                    twin.advance_to(command.time / 1e9)
                _apply(twin, command, outcome)
        if not outcome.interrupted and not advance(end, last):
            outcome.interrupted = True
    finally:
        twin.sinks.remove(emitted)
    return outcome


def _apply(twin: Twin, timed: TimedCommand, outcome: Outcome) -> None:
    command = timed.command(twin.simulation)
    if command is None:
        outcome.unchanged += 1
        return
    refusal = twin.receive(*command)
    if refusal is None:
        outcome.applied += 1
        return
    reason = refusal.split(":")[0]
    outcome.refused[reason] += 1
    outcome.last_refusal = f"at {timed.time / 1e9:.3f} s: {refusal}"
    timed.refused(reason)
