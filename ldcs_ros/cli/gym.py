"""`ldcs gym`: the environments for reinforcement learning, measured with the baseline."""

from __future__ import annotations

import argparse

import numpy as np

from ldcs_ros.cli.arguments import count, seed
from ldcs_ros.cli.output import Progress, print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_set, scene_with

DESCRIPTION = """\
Run the baseline (linear feedback) in a vector of Gymnasium environments, and print how many steps they make in a
second and how near the point comes to its targets. The exit status is 1 if an episode failed. Needs the extra [rl]."""
EXAMPLE = """\
ldcs gym
  ldcs gym --task follow --envs 4 --steps 600
  ldcs gym --scene three_arms --set effects.payload.mass=0.02"""

EXIT_FAILED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("--task", choices=("reach", "follow"), default="reach", help="reach")
    parser.add_argument("--scene", metavar="SCENE", default="rig", help="a shipped scene or a YAML file; rig")
    parser.add_argument("--envs", metavar="N", type=count, help="environments, a process each; one a core")
    parser.add_argument(
        "--steps", metavar="N", type=count, default=240, help="steps of each environment; 240"
    )
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="seed of the first environment; 0")
    add_set(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the trial, print the figures; status 0, or 1 if an episode failed."""
    from ldcs_ros.learning.trial import run_trial
    from ldcs_ros.simulation.threads import core_count

    scene = scene_with(arguments.scene, arguments.overrides)
    environments = arguments.envs or core_count()
    with Progress(1.0, label=f"gym {arguments.task}", unit="", quiet=arguments.json) as bar:
        trial = run_trial(
            arguments.task,
            scene,
            environments=environments,
            steps=arguments.steps,
            processes=environments > 1,
            seed=arguments.seed,
            progress=bar.show,
        )
    episodes = len(trial.distances) + trial.terminated
    if arguments.json:
        print_json(
            {
                "task": arguments.task,
                "scene": scene.name,
                "environments": environments,
                "steps": trial.steps,
                "steps_per_second": trial.steps_per_second,
                "real_time": trial.real_time,
                "episodes": episodes,
                "successes": trial.successes,
                "distances": trial.distances,
            }
        )
    else:
        distances = 1e3 * np.array(trial.distances)
        ends = (
            f", {np.median(distances):.3f} mm from the target at the end (median)" if len(distances) else ""
        )
        print_pairs(
            [
                ("task", f"{arguments.task}, scene {scene.name}"),
                ("environments", f"{environments}, {arguments.steps} steps each"),
                (
                    "throughput",
                    f"{trial.steps_per_second:.0f} steps/s, {trial.real_time:.1f} times real time",
                ),
                ("baseline", f"{trial.successes} of {episodes} episodes succeeded{ends}"),
            ]
        )
    return 0 if trial.successes == episodes else EXIT_FAILED
