"""The tolerance file: limits by channel, and whether a comparison keeps them.

P1: {max: 1.0e-3, rms: 5.0e-4}         # m, of the distance; figures: rms, p95, max, mean, end, normalised_rms
P*.z: {end: 2.0e-4}                    # one axis; * and ? match any letters
surface: {max: 2.0e-5}                 # all nodes
"*/pressure": {rms: 500.0}             # Pa
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from pathlib import Path

from ldcs_ros.compare.difference import ErrorStatistics
from ldcs_ros.errors import LdcsError
from ldcs_ros.schema.checks import Checks
from ldcs_ros.schema.reader import read_text, read_yaml

FIGURES = tuple(field.name for field in fields(ErrorStatistics))


class ToleranceError(LdcsError, ValueError):
    """A tolerance file is not sound, or limits a channel that was not compared."""


_CHECKS = Checks(ToleranceError)


@dataclass(frozen=True)
class Check:
    """One limit with the value found.

    Attributes:
        channel: Channel, with its axis after a dot if one is meant.
        figure: Name of the statistic.
        value: Value found, in SI.
        limit: Largest allowed magnitude, in SI.
        unit: Unit of both, '' for a ratio.
        problem: Reason for which the value does not count; '' if it counts.
    """

    channel: str
    figure: str
    value: float
    limit: float
    unit: str
    problem: str = ""

    @property
    def passed(self) -> bool:
        """The value counts, and its magnitude keeps the limit; NaN does not."""
        return not self.problem and abs(self.value) <= self.limit


Tolerances = dict[str, dict[str, float]]


def load_tolerances(path: str | os.PathLike[str]) -> Tolerances:
    """Return pattern -> figure -> limit of a file.

    Raises:
        ToleranceError: It cannot be read, or a key or limit is not sound.
    """
    file = Path(path)
    text = read_text(file, "tolerance file", ToleranceError)
    content = read_yaml(text, origin=file.name, error=ToleranceError)
    if not isinstance(content, dict) or not content:
        raise ToleranceError(f"{file.name} holds no limits; expected lines such as 'P1: {{max: 1.0e-3}}'")
    tolerances = {}
    for pattern, limits in content.items():
        where = f"{file.name}: {pattern}"
        if not _CHECKS.keys(limits, FIGURES, where):
            raise ToleranceError(f"there is no limit; expected figures such as {{max: 1.0e-3}} @ {where}")
        tolerances[str(pattern)] = {
            figure: _CHECKS.number(limit, f"{where}.{figure}", low=0.0) for figure, limit in limits.items()
        }
    return tolerances


def check(
    tolerances: Tolerances,
    compared: Iterable[tuple[str, ErrorStatistics, str]],
    problems: Mapping[str, str] | None = None,
) -> list[Check]:
    """Return every limit with the value found.

    Args:
        tolerances: The limits.
        compared: Channels that were compared, `P1` and `P1.x` alike: name, statistics, unit.
        problems: Channels that do not count, without axis -> reason.

    Raises:
        ToleranceError: A pattern fits no channel, so that nothing would be checked.
    """
    channels = list(compared)
    checks = []
    for pattern, limits in tolerances.items():
        fitting = [
            one for one in channels if fnmatchcase(one[0], pattern) and ("." in one[0]) == ("." in pattern)
        ]
        if not fitting:
            raise ToleranceError(
                f"the tolerance {pattern!r} fits no channel that both recordings have, "
                f"only {[name for name, _, _ in channels]}"
            )
        for name, found, unit in fitting:
            for figure, limit in limits.items():
                value = getattr(found, figure)
                ratio = figure == "normalised_rms"
                problem = (problems or {}).get(name.split(".")[0], "")
                found_value = math.nan if value is None else value
                checks.append(Check(name, figure, found_value, limit, "" if ratio else unit, problem))
    return checks
