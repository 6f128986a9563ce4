"""A trial of the baseline in a vector of environments: its score, and the steps that they make in a second."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np

from ldcs_ros.learning.baseline import LinearFeedback
from ldcs_ros.learning.environment import SurfaceEnv, make_vector
from ldcs_ros.scene import Scene


@dataclass(frozen=True)
class Trial:
    """What a trial measured.

    Attributes:
        steps: Steps of all environments together, resets included.
        seconds: Wall time of them [s].
        cpu: CPU time of this process meanwhile [s]; all of it without processes of the environments' own.
        period: Simulated time of a step [s].
        distances: Distance of point and target at the end of each finished episode [m].
        successes: Finished episodes that succeeded.
        terminated: Episodes that the simulation ended by diverging.
    """

    steps: int
    seconds: float
    cpu: float
    period: float
    distances: tuple[float, ...]
    successes: int
    terminated: int

    @property
    def steps_per_second(self) -> float:
        """Steps of all environments in a second of wall time."""
        return self.steps / self.seconds

    @property
    def real_time(self) -> float:
        """Simulated time over wall time, of all environments together."""
        return self.steps_per_second * self.period


def run_trial(
    task: str,
    scene: Scene,
    *,
    environments: int,
    steps: int,
    processes: bool,
    seed: int = 0,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Trial:
    """Run the baseline.

    Args:
        task: 'reach' or 'follow'.
        scene: The scene.
        environments: Number of environments.
        steps: Steps of each.
        processes: One process for each environment.
        seed: Seed of the first one; the others count on.
        progress: Called with the fraction that is done.

    Raises:
        SceneError: The scene does not fit.
        DivergenceError: It has no rest state.
    """
    single = SurfaceEnv(task, scene=scene)
    policy = LinearFeedback(single)
    distances: list[float] = []
    successes = terminated = 0
    vector = make_vector(environments, processes=processes, task=task, scene=scene)
    try:
        observation, _ = vector.reset(seed=seed)
        started, worked = perf_counter(), process_time()
        for step in range(steps):
            observation, _, ended, truncated, info = vector.step(policy(observation))
            distances += np.asarray(info["distance"], dtype=float)[truncated].tolist()
            if truncated.any():
                successes += int(np.asarray(info["is_success"])[truncated].sum())
            terminated += int(ended.sum())
            progress((step + 1) / steps)
        seconds, cpu = perf_counter() - started, process_time() - worked
    finally:
        vector.close()
    return Trial(environments * steps, seconds, cpu, single.period, tuple(distances), successes, terminated)
