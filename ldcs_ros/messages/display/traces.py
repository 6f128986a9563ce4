"""The ways that the named points went, as lines for viewers."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np

from ldcs_ros.messages.display import colours
from ldcs_ros.messages.display.marker import LINE_STRIP, Figure

STEP = 2.5e-4  # m between two points of a trace
LENGTH = 1000  # points of a trace
_WIDTH = 0.0015  # m


class Traces:
    """Follows points and draws a line for each, of its last 1000 places that are 0.25 mm apart.

    A point at rest keeps its trace. When time goes back, the traces begin anew.
    """

    def __init__(self) -> None:
        self._places: dict[str, deque[np.ndarray]] = {}
        self._last_time = 0

    def follow(self, time_ns: int, places: Mapping[str, np.ndarray]) -> None:
        """Take note of where the points are at a time [ns]; places in ldcs_base [m], shape (3,), by point."""
        if time_ns < self._last_time:
            self._places.clear()
        self._last_time = time_ns
        for name, place in places.items():
            trace = self._places.setdefault(name, deque(maxlen=LENGTH))
            if not trace or abs(trace[-1] - place).max() >= STEP:
                trace.append(place)

    def figures(self) -> list[Figure]:
        """Return a line for each point that has moved."""
        return [
            Figure(name, LINE_STRIP, (_WIDTH, 0.0, 0.0), colours.of_point(number), points=list(trace))
            for number, (name, trace) in enumerate(sorted(self._places.items()))
            # Viewers complain about a line of one point.
            if len(trace) > 1
        ]
