"""Train the reduced model of the scene rig and measure it on 200 held-out runs: speed, errors, estimates."""

from __future__ import annotations

import contextlib
import sys
import time

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.errors import DivergenceError
from ldcs_ros.estimate.reduced_run import train
from ldcs_ros.estimate.training import PERIOD, full_run, random_commands
from ldcs_ros.simulation.threads import one_thread

SLEW = 200e3  # Pa/s
COUNT = 100  # periods of a held-out run
SEED = 26000


def main(runs: int) -> int:
    """Print the figures; return 1 if one is missed."""
    scene = load_scene("rig").edited({"sensors": None})
    began = time.process_time()
    reduced = train(scene, SLEW)
    built = time.process_time() - began
    limit = np.array([own.pressure_limit for own in scene.build().model.arms.each])
    largest, estimates, costs, full_costs, outside, failed = [], [], [], [], 0, 0
    with one_thread():
        for seed in range(runs):
            run = full_run(scene, random_commands(limit, SLEW, COUNT, np.random.default_rng(SEED + seed)))
            try:
                errors = reduced.follow(run)
                outside += bool(reduced.outside)
                largest.append(float(errors.max()))
                estimates.append(reduced.error_estimate)
                reduced.reset(run.commands[0], run.coordinates[0])
                began = time.process_time()
                for command in run.commands[1:]:
                    reduced.advance(command)
                costs.append((time.process_time() - began) / ((COUNT - 1) * PERIOD))
                full_costs.append(run.cpu_time / ((COUNT - 1) * PERIOD))
            except DivergenceError:
                failed += 1
    error, ratio = 1e3 * np.array(largest), np.array(estimates) / np.array(largest)
    honest = float(np.sum((ratio >= 1.0) & (ratio <= 5.0))) / runs
    speed, paired = 1.0 / np.median(costs), np.median(np.array(full_costs) / np.array(costs))
    within = float(np.sum(error <= 0.3)) / runs
    print(
        f"held-out runs            {runs} of {COUNT * PERIOD:g} s, 0 to 200 kPa, at most {SLEW / 1e3:g} kPa/s"
    )
    print(f"training                 {built:.0f} s of CPU time")
    print(
        f"speed                    {speed:.0f} times real time (CPU time, median), {paired:.0f} times the full model"
    )
    print(
        f"largest node error       median {np.median(error):.3f} mm, 95 % {np.percentile(error, 95):.3f} mm, "
        f"worst {error.max():.3f} mm; at most 0.3 mm in {100 * within:.1f} %"
    )
    print(
        f"estimate / largest error 2.5 % {np.percentile(ratio, 2.5):.2f}, median {np.median(ratio):.2f}, "
        f"97.5 % {np.percentile(ratio, 97.5):.2f}; between 1 and 5 in {100 * honest:.1f} %"
    )
    print(f"said to be outside       {outside} runs; not converged {failed}")
    jumps = full_run(scene, random_commands(limit, np.inf, COUNT, np.random.default_rng(3)))
    with contextlib.suppress(DivergenceError):
        reduced.follow(jumps)
    print(f"jumps of pressure        {reduced.outside or 'not noticed'}")
    return 0 if speed >= 100.0 and within == 1.0 and honest >= 0.95 and failed == 0 else 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
