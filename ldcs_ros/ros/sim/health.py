"""What the node adds to the twin's diagnostics: pace, recorder, optional interfaces."""

from __future__ import annotations

from dataclasses import replace

from ldcs_ros.messages.diagnostics import ERROR, OK, WARN, Status
from ldcs_ros.ros.sim.runner import Mode, Runner
from ldcs_ros.twin.recorder import Recorder


def health(
    runner: Runner, recorder: Recorder | None, recording_error: str, interfaces: dict[str, str], missed: int
) -> list[Status]:
    """Return all entries of the diagnostics; ends the meter's present period.

    Args:
        runner: What runs the twin.
        recorder: What records it, if anything does.
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
    level = ERROR if runner.mode is Mode.FAILED else OK
    asked, late = pacer.real_time_factor, pacer.take_worst_lateness()
    message = runner.mode.value
    if runner.mode is Mode.RUNNING and 0.0 < meter.real_time_factor < 0.9 * asked:
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
