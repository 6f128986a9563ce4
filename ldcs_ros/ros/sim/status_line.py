"""The line that tells a person at the terminal how the run goes."""

from __future__ import annotations

import shutil
import time
from typing import TextIO

from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.twin.twin import Twin

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
        self._start = self._last = (time.perf_counter(), runner.twin.time)

    def show(self) -> None:
        """Write the present status, with the real-time factor since the last one."""
        since, self._last = self._last, (time.perf_counter(), self._runner.twin.time)
        self._put(self._runner.mode.value, since)

    def close(self) -> None:
        """Write the last status, with the real-time factor since the start, and leave it standing."""
        self._last = (time.perf_counter(), self._runner.twin.time)
        self._put("ended", self._start)
        if self._terminal:
            self._write("\n")

    def _put(self, mode: str, since: tuple[float, float]) -> None:
        wall, simulated = self._last[0] - since[0], self._last[1] - since[1]
        text = status_text(self._runner.twin, mode, max(0.0, simulated) / max(wall, 1e-9))
        if self._terminal:
            # A line that wraps cannot be rewritten.
            text = f"\r\033[K{text[: shutil.get_terminal_size().columns - 1]}"
        self._write(text if self._terminal else f"{text}\n")

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
        places.append(f"{name} ({x:.2f} {round(y, 2) + 0.0:.2f} {z:.2f})")
    if places:
        places.append("mm")
    return " ".join([f"t {twin.time:.3f} s", f"{real_time_factor:.2f}x", *places, mode])
