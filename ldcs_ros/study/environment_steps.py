"""Environments for learning: CPU time of a step under the baseline, one environment in this process."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from ldcs_ros.learning.trial import run_trial
from ldcs_ros.scene import load_scene
from ldcs_ros.study.rows import Row, Task


def environment_steps(task: Task) -> list[Row]:
    """Return a row for each task of learning: CPU per simulated second; period and episodes in `extra`."""
    rows, scene = [], load_scene(task.scene)
    for name in ("reach", "follow"):
        run = partial(run_trial, name, scene, environments=1, processes=False, seed=1)
        run(steps=1)  # loads and compiles
        trial = run(steps=int(task.value))
        episodes = len(trial.distances) + trial.terminated
        cpu = trial.cpu / (trial.steps * trial.period)
        extra = f"period {trial.period:g} solved {trial.successes} of {episodes}"
        rows.append(replace(task.row(), method=name, cpu=cpu, steps=trial.steps, extra=extra))
    return rows
