"""The line that tells a person at the terminal how the run goes."""

from __future__ import annotations

import time
from typing import TextIO

from ldcs_ros.interface.twin import Twin
from ldcs_ros.ros.runner import Runner

_REWRITE_PERIOD = 0.2
_LINE_PERIOD = 2.0


class StatusLine:
    """Writes the status of a runner: one line, rewritten, on a terminal; a line every two seconds elsewhere.

    Args:
        stream: Where it is written.
        runner: What is told about.
    """

    def __init__(self, stream: TextIO, runner: Runner) -> None:
        self._stream = stream
        self._runner = runner
        self._terminal = stream.isatty()
        self.period = _REWRITE_PERIOD if self._terminal else _LINE_PERIOD
        self._last = (time.perf_counter(), runner.twin.time)

    def show(self) -> None:
        """Write the status."""
        text = status_text(self._runner.twin, self._runner.mode.value, self._real_time_factor())
        self._write(f"\r\033[K{text}" if self._terminal else f"{text}\n")

    def close(self) -> None:
        """Write the last status and leave it standing."""
        self.show()
        if self._terminal:
            self._write("\n")

    def _real_time_factor(self) -> float:
        # Since the last status: what a person sees is what happened while they looked.
        (wall, simulated), now = self._last, (time.perf_counter(), self._runner.twin.time)
        self._last = now
        return max(0.0, now[1] - simulated) / max(now[0] - wall, 1e-9)

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except OSError:
            # The terminal went away; the run goes on without one.
            self._terminal = False


def status_text(twin: Twin, mode: str, real_time_factor: float) -> str:
    """Return simulation time, pace and the positions of the points [mm] in a line."""
    state = twin.simulation.state
    places = []
    for name, point in twin.simulation.points.items():
        x, y, z = (1e3 * point.position(state.position)).tolist()
        places.append(f"{name} {x:7.2f} {y + 0.0:6.2f} {z:7.2f} mm")
    return " | ".join([f"t {twin.time:9.3f} s", f"{real_time_factor:5.2f} x real time", *places, mode])
