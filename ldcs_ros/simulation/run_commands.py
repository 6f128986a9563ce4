"""The commands by which a run is differentiated: for all of it, from a time of the schedule on, or by a profile."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.physics.inputs import HeldCommands, ScheduledCommand
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.command_directions import CommandDirection, OperatingPoint, command_directions


@dataclass(frozen=True)
class CommandProfile:
    """A change of one command over a run, by which the run is differentiated.

    Attributes:
        name: Its name.
        command: `pressure.left`, `torque.left_joint_2`, `wrench.P1.force.z`.
        time: Times at which the change takes another value, those of scheduled commands [s], rising.
        amplitude: Change from each time on, per unit of the profile, same length.
    """

    name: str
    command: str
    time: tuple[float, ...]
    amplitude: tuple[float, ...]


class CommandColumns:
    """Commands that are higher: for the whole run, from one time of the schedule to the next, or by a profile.

    The force is linear in commands. A chamber follows its target by a first-order lag, solved exactly, so its
    pressure has a tangent of its own.

    Args:
        at: The start of the run.
        schedule: The commands to come.
        commands: `pressure.left` for the whole run, `pressure.left@0.8` for the command of 0.8 s, or a profile.
        dead_time: Dead time of each arm's valve [s].
        settled: The run starts at rest under its commands.

    Attributes:
        names: Name of each column.
        units: SI unit of each column.

    Raises:
        ValueError: There is no such command, or none at that time.
    """

    def __init__(
        self,
        at: OperatingPoint,
        schedule: Sequence[ScheduledCommand],
        commands: Sequence[str | CommandProfile],
        dead_time: Sequence[float],
        *,
        settled: bool,
    ) -> None:
        self._model = at.model
        profiles = [one for command in commands for one in _profiles(at, schedule, command)]
        self.names = tuple(profile.name for profile, _ in profiles)
        self.units = tuple(one.unit for _, one in profiles)
        self._channels = list({one.name: one for _, one in profiles}.values())
        known = [one.name for one in self._channels]
        self._channel = np.array([known.index(one.name) for _, one in profiles], dtype=int)
        pressures = [one.name.startswith("pressure.") for _, one in profiles]
        self._chamber = np.array(
            [
                at.arm_names.index(one.name.partition(".")[2]) if is_pressure else -1
                for (_, one), is_pressure in zip(profiles, pressures, strict=True)
            ],
            dtype=int,
        )
        delay = np.append(dead_time, 0.0)[self._chamber]
        self._profiles = [
            (np.array(profile.time) + late, np.array((0.0, *profile.amplitude)))
            for (profile, _), late in zip(profiles, delay, strict=True)
        ]
        self._on = np.array([time[0] for time, _ in self._profiles])
        # Chambers of a settled start have their commanded pressure.
        self._pressure = np.where(settled & np.isneginf(self._on), 1.0, 0.0)
        self._target = np.zeros(len(self._on))
        self._time, self._rate = at.time, np.zeros(len(self._on))
        self._held = at.now

    @property
    def begun(self) -> np.ndarray:
        """Whether each column has moved anything yet, shape (k,)."""
        return np.asarray(self._on <= self._time + TIME_TOLERANCE)

    def enter(self, time: float, held: HeldCommands) -> None:
        """Begin a step at a time [s] with the commands that act during it."""
        self._pressure = self._amplitude(time)
        self._time, self._held = time, held
        self._target = np.array(
            [
                amplitude[np.searchsorted(times, time + TIME_TOLERANCE, side="right")]
                for times, amplitude in self._profiles
            ]
        )
        constants = np.array([*(chamber.time_constant for chamber in held.chambers), 0.0])
        with np.errstate(divide="ignore"):
            self._rate = 1.0 / constants[self._chamber]

    def forces(self, time: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return d(force)/d(command) of the free coordinates, shape (n_free, k)."""
        return self._scaled(time, q, u, self._amplitude(time))

    def unit_forces(self, time: float, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the same of commands that act in full, also of those to come; same shapes as `forces`."""
        return self._scaled(time, q, u, np.ones(len(self._on)))

    def _scaled(self, time: float, q: np.ndarray, u: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
        model, held = self._model, self._held
        slopes = np.zeros((len(self._channels), len(model.free)))
        for number in np.unique(self._channel[amplitude != 0.0]):
            one = self._channels[number]
            jump = model.force_jump(time, q, u, one.apply(held, 0.0), one.apply(held, one.step))
            slopes[number] = jump[model.free] / one.step
        return slopes[self._channel].T * amplitude

    def _amplitude(self, time: float) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            decay = np.exp(-self._rate * max(time - self._time, 0.0))
        decay[np.isinf(self._rate)] = 0.0
        return np.asarray(self._target + (self._pressure - self._target) * decay)


def _profiles(
    at: OperatingPoint, schedule: Sequence[ScheduledCommand], command: str | CommandProfile
) -> list[tuple[CommandProfile, CommandDirection]]:
    if isinstance(command, CommandProfile):
        (one,) = command_directions(at, command.command)
        return [(command, one)]
    kind, at_time, text = command.partition("@")
    found = []
    for one in command_directions(at, kind):
        if at_time:
            begin, end = _interval(schedule, one.name, command, _time(command, text))
            profile = CommandProfile(f"{one.name}@{begin:.12g}", one.name, (begin, end), (1.0, 0.0))
        else:
            profile = CommandProfile(one.name, one.name, (-math.inf,), (1.0,))
        found.append((profile, one))
    return found


def _time(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(
            f"got {name!r}, expected the time of a scheduled command after the @, in s"
        ) from None


def _frame(command: ScheduledCommand) -> str | None:
    return None if command.wrench is None else command.wrench[0]


def _interval(
    schedule: Sequence[ScheduledCommand], channel: str, name: str, time: float
) -> tuple[float, float]:
    """Return when the command of a time acts: from then to the next of its kind [s]."""
    kind, _, rest = channel.partition(".")
    frame = rest.partition(".")[0]
    times = [
        command.time
        for command in schedule
        if (getattr(command, kind) is not None if kind != "wrench" else _frame(command) == frame)
    ]
    found = [k for k, when in enumerate(times) if abs(when - time) <= TIME_TOLERANCE]
    if not found:
        listed = ", ".join(f"{when:g}" for when in times[:10]) or "none"
        raise ValueError(f"got {name!r}, expected a time of the scene's schedule for {kind}: {listed}")
    last = found[-1]
    return times[last], times[last + 1] if last + 1 < len(times) else math.inf
