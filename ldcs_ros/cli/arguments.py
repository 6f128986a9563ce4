"""Types of command line arguments: text to a checked number, or one clear complaint."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path

from ldcs_ros.errors import LdcsError

PICTURES = (".png", ".pdf", ".svg")


class CommandLineError(LdcsError, ValueError):
    """The command line itself cannot be understood."""


def add_format_argument(parser: argparse.ArgumentParser) -> None:
    """Declare what pictures are written as."""
    parser.add_argument(
        "--format", choices=("png", "pdf", "svg"), default="png", help="format of the pictures; png"
    )


def add_picture_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what pictures are written as, and how wide they are."""
    add_format_argument(parser)
    parser.add_argument(
        "--width",
        choices=("screen", "column", "page"),
        default="screen",
        help="for print: one column (88 mm) or a whole page (180 mm), without headings; screen",
    )


def only_with(companion: str, given: Mapping[str, object]) -> None:
    """Refuse options that would be ignored, as the one that they go with is not there.

    Args:
        companion: The missing option, in words.
        given: Values of the options by name; None, '', [] and False are not given.

    Raises:
        CommandLineError: One is given.
    """
    for option, value in given.items():
        if value is not None and value is not False and value != "" and value != []:
            raise CommandLineError(f"{option} goes with {companion}, which is not given")


def picture(text: str) -> Path:
    """Return the path of a picture, whose suffix says its format."""
    path = Path(text)
    if path.suffix.lower() not in PICTURES:
        raise argparse.ArgumentTypeError(f"got '{text}', expected a file that ends in {', '.join(PICTURES)}")
    return path


def seconds(text: str) -> float:
    """Return a duration in seconds, above zero and finite."""
    return _positive(text, what="duration", unit="s")


def metres(text: str) -> float:
    """Return a length in metres, above zero and finite."""
    return _positive(text, what="length", unit="m")


def instant(text: str) -> float:
    """Return a time in seconds, zero or later, finite."""
    value = number(text, what="time", unit="s")
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"time is '{text}', expected 0 s or later")
    return value


def seed(text: str) -> int:
    """Return a seed for the sensors' noise: a whole number, 0 or above."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"seed is '{text}', expected a whole number, 0 or above")
    return int(text)


def hertz(text: str) -> float:
    """Return a rate, above zero and finite."""
    return _positive(text, what="rate", unit="Hz")


def count(text: str) -> int:
    """Return a whole number above zero."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number above 0")
    return int(text)


def _positive(text: str, *, what: str, unit: str) -> float:
    value = number(text, what=what, unit=unit)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{what} is '{text}', expected a number above 0 {unit}")
    return value


def number(text: str, *, what: str, unit: str) -> float:
    """Return a finite number; the error names its meaning and its unit."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{what} is '{text}', expected a number in {unit}") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{what} is '{text}', expected a finite number in {unit}")
    return value
