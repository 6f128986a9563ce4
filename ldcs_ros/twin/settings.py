"""The settings of a run beside its scene: one list, which goes into a bag's metadata and comes back from it."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import TypeVar

from ldcs_ros import __version__

_T = TypeVar("_T")


def _setting(default: _T, read: Callable[[str], _T], *, key: str = "") -> _T:
    # `key` is the name in the metadata, where it differs from the name of the field.
    return field(default=default, metadata={"read": read, "key": key})


def _truth(text: str) -> bool:
    return text == "true"


def _number(low: float, high: float) -> Callable[[str], float]:
    """Return a reader of numbers between two bounds: a bag may ask for reports without end."""

    def read(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise ValueError(f"got {text[:40]!r}, expected {low:g} ... {high:g}")
        return value

    return read


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**64:
        raise ValueError(f"got the seed {text[:40]}, expected a whole number from 0 on of 64 bits")
    return value


def _one_of(*words: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in words:
            raise ValueError(f"got {text[:40]!r}, expected one of {list(words)}")
        return text

    return read


_RATE = _number(1e-3, 1e5)
KNOWN_COMMANDS = ("held", "schedule", "all")


@dataclass(frozen=True)
class RunSettings:
    """A set of choices that, with a scene and the commands, determines every byte of a run.

    Attributes:
        seed: Seed of the sensors' noise; None for the scene's.
        accuracy: Position error asked of the solver [m]; None for the scene's.
        publish_rate: Reports of the state per second of simulation time [Hz].
        tracker_rate: Rate of the tracker [Hz]; None for the scene's.
        ambient_pressure: Absolute pressure of the surrounding air [Pa].
        publish_clock: Emit /clock with each report.
        publish_tf: Emit /tf with each report, /tf_static at the start.
        link_frames: Emit the frames of the arms' links on /tf, too.
        frame_prefix: Prefix of the name of each frame.
        full_precision: Emit `lattice_state` and `solver_status` all along and record them.
        settled: Begin at the equilibrium.
        command_steps: Steps under commands at a rate may be those of the formula for them.
        known_commands: Which commands a smooth drive may replace: none ('held'), those of the scene's schedule
            ('schedule'), or those that were announced, too ('all').
        verify: Measure the error by a second solution at a tenth of the accuracy; true also where the scene says so.
    """

    seed: int | None = _setting(None, _seed)
    accuracy: float | None = _setting(None, _number(1e-12, 1.0))
    publish_rate: float = _setting(50.0, _RATE)
    tracker_rate: float | None = _setting(None, _RATE)
    ambient_pressure: float = _setting(101325.0, _number(0.0, 1e9))
    publish_clock: bool = _setting(False, _truth)
    publish_tf: bool = _setting(False, _truth)
    link_frames: bool = _setting(True, _truth)
    frame_prefix: str = _setting("", str)
    full_precision: bool = _setting(False, _truth, key="detail")
    settled: bool = _setting(False, _truth)
    command_steps: bool = _setting(True, _truth)
    known_commands: str = _setting("schedule", _one_of(*KNOWN_COMMANDS))
    verify: bool = _setting(False, _truth)

    def to_metadata(self) -> dict[str, str]:
        """Return the settings as texts by the names that a bag gives them."""
        return {one.metadata["key"] or one.name: _text(getattr(self, one.name)) for one in fields(self)}

    @classmethod
    def from_metadata(cls, texts: Mapping[str, str]) -> RunSettings:
        """Return the settings that a bag's metadata hold; a missing or empty text means the default.

        Raises:
            ValueError: A text is no value of its setting, or out of bounds.
        """
        held = {one.name: (one, texts.get(one.metadata["key"] or one.name, "")) for one in fields(cls)}
        values = {name: one.metadata["read"](text) for name, (one, text) in held.items() if text}
        # Bags from before the links had frames replay without them, those from before command steps by other steps,
        # those from before smooth drives with every command held.
        for later, before in (("link_frames", False), ("command_steps", False), ("known_commands", "held")):
            if texts and later not in texts:
                values[later] = before
        return cls(**values)


def software_versions() -> dict[str, str]:
    """Return the versions that must agree for the same bits to be expected, by name."""
    from importlib import metadata  # loads the package email: a run without a bag does not

    return {
        "ldcs_ros": __version__,
        "python": platform.python_version(),
        **{library: metadata.version(library) for library in ("numpy", "scipy", "numba")},
        # A kernel cannot change a result; these can.
        "platform": "-".join([platform.system(), platform.machine(), *platform.libc_ver()]),
    }


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
