"""Runs of the full model under random pressures: samples for a reduced model, and truths to measure it with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.scene import Scene

PERIOD = 0.02
"""Time between two commands [s]."""
ACCURACY = 1e-4
"""Accuracy asked of the full model [m]; its real error under these commands is below a micrometre."""


@dataclass(frozen=True)
class FullRun:
    """A run of the full model.

    Attributes:
        commands: Commanded gauge pressures [Pa], shape (n, n_arms), one row a period; the first one is settled.
        coordinates: Coordinates at the same times [m, rad], shape (n, n_q).
        cpu_time: CPU time of the motion [s].
    """

    commands: np.ndarray
    coordinates: np.ndarray
    cpu_time: float


def random_commands(limit: np.ndarray, slew: float, count: int, draw: np.random.Generator) -> np.ndarray:
    """Return random gauge pressures [Pa], shape (count, n_arms): jumps, sines, or jumps of all arms together.

    Args:
        limit: Largest pressure of each arm [Pa], shape (n_arms,).
        slew: Largest change [Pa/s]; it turns jumps into ramps.
        count: Number of periods.
        draw: Source of random numbers.
    """
    arms, time = len(limit), PERIOD * np.arange(count)
    kind = draw.integers(3)
    if kind == 0:
        wanted = np.stack([_held(draw, count) for _ in range(arms)], axis=1)
    elif kind == 1:
        turns = 2.0 * np.pi * draw.uniform(0.1, 3.0, (3, arms))
        phases, sizes = draw.uniform(0.0, 2.0 * np.pi, (3, arms)), draw.uniform(0.0, 0.3, (3, arms))
        wanted = 0.5 + (sizes * np.sin(turns * time[:, None, None] + phases)).sum(axis=1)
    else:
        wanted = _held(draw, count)[:, None] + draw.uniform(-0.15, 0.15, arms)
    wanted = limit * np.clip(wanted, 0.0, 1.0)
    commands, most = wanted.copy(), slew * PERIOD
    for k in range(1, count):
        commands[k] = commands[k - 1] + np.clip(wanted[k] - commands[k - 1], -most, most)
    return commands


def _held(draw: np.random.Generator, count: int) -> np.ndarray:
    lengths = draw.integers(3, 70, count)
    return np.repeat(draw.random(count), lengths)[:count]


def full_run(scene: Scene, commands: np.ndarray) -> FullRun:
    """Return a run of the full model from the rest state of the first command.

    Args:
        scene: The scene.
        commands: Pressures of the arms, one row a period [Pa], shape (n_periods, n_arms).
    """
    import time

    simulation = scene.edited({"solver.accuracy": ACCURACY, "inputs": None}).build()
    simulation.inputs.set_pressure(commands[0])
    simulation.settle()
    coordinates = [simulation.motion().q.copy()]
    began = time.process_time()
    for k, command in enumerate(commands[1:], 1):
        simulation.inputs.set_pressure(command)
        simulation.advance_to(k * PERIOD)
        coordinates.append(simulation.motion().q.copy())
    return FullRun(commands, np.array(coordinates), time.process_time() - began)
