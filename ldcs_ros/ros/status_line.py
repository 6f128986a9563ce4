"""The line that tells a person at the terminal how the run goes."""

from __future__ import annotations

import time
from typing import TextIO

from ldcs_ros.interface.twin import Twin

_REWRITE_PERIOD = 0.2
_LINE_PERIOD = 2.0


class StatusLine:
    """Writes the status: one line, rewritten, on a terminal; a line every two seconds elsewhere.

    Args:
        stream: Where it is written.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._terminal = stream.isatty()
        self.period = _REWRITE_PERIOD if self._terminal else _LINE_PERIOD
        self._clear = "\r\033[K" if self._terminal else ""
        self._end = "" if self._terminal else "\n"

    def show(self, text: str) -> None:
        """Write the status."""
        self._write(f"{self._clear}{text}{self._end}")

    def close(self) -> None:
        """Leave the last status standing."""
        if self._terminal:
            self._write("\n")

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except OSError:
            # The terminal went away; the run goes on without one.
            self._terminal = False


class Speed:
    """Real-time factor between two looks at the status."""

    def __init__(self) -> None:
        self._last = (time.perf_counter(), 0.0)

    def measure(self, simulation_time: float) -> float:
        """Return simulated seconds a second since the last call."""
        (wall, simulated), now = self._last, time.perf_counter()
        self._last = (now, simulation_time)
        return max(0.0, simulation_time - simulated) / max(now - wall, 1e-9)


def status_text(twin: Twin, mode: str, real_time_factor: float) -> str:
    """Return simulation time, pace and the positions of the points in a line."""
    state = twin.simulation.state
    places = []
    for name, point in twin.simulation.points.items():
        x, y, z = (1e3 * point.position(state.position)).tolist()
        places.append(f"{name} {x:7.2f} {y:6.2f} {z:7.2f} mm")
    return " | ".join([f"t {twin.time:9.3f} s", f"{real_time_factor:5.2f} x real time", *places, mode])
