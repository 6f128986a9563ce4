"""The status of a run: entries of the diagnostics, and the line on a terminal."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from typing import TextIO

from ldcs_ros.messages.diagnostics import ERROR, OK, WARN, Status
from ldcs_ros.ros.sim.runner import RunMode, Runner
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.twin import Twin


def health(
    runner: Runner, recorder: Recorder | None, recording_error: str, interfaces: dict[str, str], missed: int
) -> list[Status]:
    """Return all entries of the diagnostics; ends the meter's present period.

    Args:
        runner: Runner of the twin.
        recorder: Recorder of the twin; None for none.
        recording_error: Why nothing is recorded although it was asked for; '' otherwise.
        interfaces: State of each optional interface.
        missed: Commands that were overwritten in a full queue.
    """
    runner.meter.read(runner.twin.time)
    statuses = runner.twin.statuses()
    if runner.failure:
        statuses = [
            replace(status, level=ERROR, message=f"{runner.failure}; call reset")
            if status.name == "solver"
            else status
            for status in statuses
        ]
    return [
        _pace(runner),
        *(_with_missed(status, missed) for status in statuses),
        _recording(recorder, recording_error),
        Status("interfaces", OK, "optional interfaces", interfaces),
    ]


def _with_missed(status: Status, missed: int) -> Status:
    if status.name != "commands":
        return status
    values = {**status.values, "missed, queue full": missed}
    return replace(status, values=values, level=WARN if missed else status.level)


def _pace(runner: Runner) -> Status:
    meter, pacer = runner.meter, runner.pacer
    level = ERROR if runner.mode is RunMode.FAILED else OK
    asked, late = pacer.real_time_factor, pacer.take_worst_lateness()
    message = runner.mode.value
    if runner.mode is RunMode.RUNNING and 0.0 < meter.real_time_factor < 0.9 * asked:
        level, message = WARN, f"slower than asked: {meter.real_time_factor:.2f} of {asked:g} x real time"
    return Status(
        "simulation",
        level,
        message,
        {
            "mode": runner.mode.value,
            "scene": runner.twin.scene.name,
            "simulation time [s]": f"{runner.twin.time:.6f}",
            "real-time factor": meter.real_time_factor,
            "real-time factor asked": asked,
            "step time [s]": meter.step_time,
            "worst step time [s]": meter.worst_step_time,
            "overruns": pacer.overruns,
            "worst lateness [s]": late,
        },
    )


def _recording(recorder: Recorder | None, recording_error: str) -> Status:
    if recording_error:
        return Status("recorder", ERROR, recording_error, {"recording": False})
    if recorder is None:
        return Status("recorder", OK, "off", {"recording": False})
    values = {"recording": recorder.error is None, "folder": recorder.folder, "messages": recorder.count}
    if recorder.error is not None:
        return Status("recorder", ERROR, recorder.error, values)
    return Status("recorder", OK, "recording", values)


_REWRITE_PERIOD = 0.2
_LINE_PERIOD = 2.0


class StatusLine:
    """The status of a runner: one line, rewritten, on a terminal; a line every two seconds elsewhere.

    Args:
        stream: Stream of the terminal.
        runner: The runner that is reported.
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
        """Write the last status, with the real-time factor since the start, and leave it on the terminal."""
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
