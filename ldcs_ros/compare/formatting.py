"""Numbers of a comparison in handy units: millimetres, kilopascals, degrees."""

from __future__ import annotations

import math

# SI unit -> (unit shown, factor).
SHOWN = {"m": ("mm", 1e3), "Pa": ("kPa", 1e-3), "rad": ("deg", math.degrees(1.0)), "": ("", 1.0)}

# The same for differences too small for these.
FINE = {"m": ("\N{MICRO SIGN}m", 1e6), "Pa": ("Pa", 1.0), "rad": ("mdeg", 1e3 * math.degrees(1.0))}

NOTHING = 1e-9
"""In units shown: rounding, not a difference."""


def unit(si: str) -> str:
    """Return the unit shown for an SI unit."""
    return SHOWN[si][0]


def scale(largest: float, si: str) -> tuple[str, float]:
    """Return the handiest unit and factor for differences of up to an amount in SI."""
    shown = SHOWN[si]
    return FINE[si] if si in FINE and shown[1] * largest < 0.02 else shown


def number(value: float | None, si: str = "") -> str:
    """Return a value in SI as text in the unit shown, with three significant digits."""
    if value is None or not math.isfinite(value):
        return "-"
    return three_digits(SHOWN[si][1] * value)


def three_digits(shown: float) -> str:
    """Return a number in the unit shown, as text with three significant digits."""
    if abs(shown) < NOTHING:
        return "0"
    if abs(shown) < 1e-3 or abs(shown) >= 1e5:
        return f"{shown:.1e}"
    digits = max(0, 2 - math.floor(math.log10(abs(shown))))
    return f"{shown:.{digits}f}"


def percent(value: float | None) -> str:
    """Return a ratio in per cent."""
    return "-" if value is None else f"{number(100.0 * value)} %"


def milliseconds(value: float) -> str:
    """Return a time [s] with its sign, in ms, or in s when it is long."""
    return f"{1e3 * value:+.2f} ms" if abs(value) < 10.0 else f"{value:+.4f} s"
