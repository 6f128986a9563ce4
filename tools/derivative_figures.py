"""Measure derivatives along runs: cost of tangents and of a gradient, stated errors, and `ldcs identify` by them."""

from __future__ import annotations

import argparse
import math
import time
import warnings
from dataclasses import replace

import numpy as np

from ldcs_ros import Scene, load_scene
from ldcs_ros.errors import LdcsError
from ldcs_ros.identify.experiments import Experiment
from ldcs_ros.identify.identify import identify
from ldcs_ros.identify.parameters import parse_parameter
from ldcs_ros.identify.prediction import predict
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.study.accuracy.random_scenes import random_case

ARMS = ("joint_stiffness", "joint_damping", "link_mass", "coupling_stiffness", "coupling_damping")
NUMBERS = {
    name: [
        "effects.springs.stiffness",
        "effects.springs.damping",
        "lattice.mass",
        "effects.payload.mass",
        "effects.arms.backbone_height",
        *(f"effects.arms.{key}" for key in ARMS),
    ]
    for name in ("paper", "rig")
} | {
    "arc": [
        "effects.springs.stiffness",
        "effects.springs.damping",
        "lattice.mass",
        *(f"start.{kind}.mode_{k}" for k in (1, 2, 3) for kind in ("position", "velocity")),
        "start.position.mode_4",
    ]
}
# Of random scenes: numbers that most have.
RANDOM = ("springs.stiffness", "springs.damping", "arms.joint_stiffness", "arms.link_mass", "payload.mass")
MOST_CPU = 30.0  # s, of one random scene
TRUTH = {
    "effects.arms.joint_stiffness": 0.258,
    "effects.springs.stiffness": 138.8,
    "effects.arms.pressure_gain": 9.407e-7,
    "effects.arms.backbone_height": 4.0e-3,
}
GUESS = {
    "effects.arms.joint_stiffness": 0.35,
    "effects.springs.stiffness": 100.0,
    "effects.arms.pressure_gain": 7.0e-7,
    "effects.arms.backbone_height": 3.0e-3,
}
STEPS = (
    ((0.0, 3e4, 5e4), (0.8, 12e4, 6e4), (1.6, 5e4, 10e4)),
    ((0.0, 10e4, 10e4), (0.8, 2e4, 9e4), (1.6, 11e4, 4e4)),
)


def plain(scene: Scene, end: float) -> tuple[float, int]:
    """Return CPU time and steps of a run without derivatives."""
    simulation = scene.build()
    began = time.process_time()
    simulation.advance_to(end)
    return time.process_time() - began, simulation.statistics.steps


def cost(rounds: int) -> None:
    """Print the cost of ten numbers in plain runs, in turns."""
    for name, numbers in NUMBERS.items():
        scene = load_scene(name)
        times = list(np.linspace(0.1, 2.0, 20))
        pairs = []
        for _ in range(rounds + 1):
            simulation = scene.build()
            began = time.process_time()
            run = simulation.run_sensitivity(times, ["P0", "P1"], numbers, with_error=False)
            pairs.append((time.process_time() - began, *plain(scene, 2.0)))
        own, other, steps = (min(part) for part in zip(*pairs[1:], strict=True))
        print(
            f"{name:6} steps {steps} plain, {run.steps} with tangents; ten numbers cost {own / other:.1f} plain runs"
        )


def gradient(rounds: int, count: int = 500) -> None:
    """Print the cost of a gradient by 1000 commands in plain runs with the same commands."""
    rows = [
        {"time": 0.01 * k, "pressure": [7e4 * (1.0 - math.cos(0.005 * k * (1 + arm))) for arm in range(2)]}
        for k in range(count)
    ]
    scene = load_scene("rig").edited({"inputs": rows, "solver": {"integrator": "esdirk43", "accuracy": 1e-5}})
    end, pairs = 0.01 * count, []
    weights = np.array([[0.0, 0.0, 1.0]])
    for _ in range(rounds):
        simulation = scene.build()
        began = time.process_time()
        found = simulation.run_gradient([end], ["P1"], weights)
        pairs.append((time.process_time() - began, *plain(scene, end)))
    own, other, steps = (min(part) for part in zip(*pairs, strict=True))
    print(
        f"rig    {steps} steps, gradient of P1.z by {found.values.size} commands: {own / other:.1f} plain runs"
    )


def errors(first: int, last: int) -> None:
    """Print how often the stated error covers the real one, over pairs of a random scene and a number."""
    right, ratios, skipped = 0, [], 0
    for seed in range(first, last):
        case = random_case(seed)
        scene = load_scene(case.content)
        numbers = ["lattice.mass"] + [
            f"effects.{name}" for name in RANDOM if scene.effect(name.partition(".")[0]) is not None
        ]
        times = list(np.linspace(case.duration / 5.0, case.duration, 5))
        for number in numbers:
            began = time.process_time()
            try:
                run = scene.build().run_sensitivity(times, ["P0", "P1"], [number])
                if time.process_time() - began > MOST_CPU / 5.0:
                    raise ValueError("a run that is too long")
                fine = scene.edited({"solver": {"accuracy": 3e-7}}).build()
                reference = fine.run_sensitivity(times, ["P0", "P1"], [number], with_error=False).values
            except (ValueError, LdcsError):
                skipped += 1
                continue
            assert run.error is not None
            real, stated = float(np.abs(run.values - reference).max()), float(run.error.max())
            right += real <= stated
            ratios.append(stated / max(real, 1e-300))
    n = len(ratios)
    print(f"stated error covers the real one in {right} of {n} pairs, {skipped} without tangents or too long")
    print(f"stated / real: median {np.median(ratios):.1f}, 5 % {np.quantile(ratios, 0.05):.2f}")


def identification() -> None:
    """Print the CPU time of the four-number example by tangents and by differences."""
    scene = load_scene("paper_calibrated")
    scene = scene.edited({"inputs": None, "effects.arms.drive": "pressure", **TRUTH})
    content, bags = scene.content, []
    for k, steps in enumerate(STEPS):
        commands = tuple((t, "pressure_command", pressure_command(np.array(p))) for t, *p in steps)
        nothing = np.zeros((160, 2, 3))
        bag = Experiment(
            f"bag {k}", commands, True, (), ("P0", "P1"), np.arange(160) / 80.0, nothing, 1.0, ""
        )
        places = predict(content, bag)
        places += np.random.default_rng(k).normal(0.0, 1e-4, places.shape)
        places = np.round(places / 2.8e-5) * 2.8e-5
        bags.append(replace(bag, position=places, noise=float(np.hypot(1e-4, 2.8e-5 / math.sqrt(12.0)))))
    guess = scene.edited(GUESS)
    bounds = {"effects.arms.backbone_height": "=0.001..0.005"}
    parameters = [parse_parameter(path + bounds.get(path, ""), guess.content) for path in TRUTH]
    spent = []
    for tangents in (True, False):
        began = time.process_time()
        found = identify(guess, bags, parameters, processes=1, tangents=tangents)
        spent.append(time.process_time() - began)
        print(f"{found.slopes}: {found.evaluations} parameter sets, {spent[-1]:.1f} s, {found.misfit.words}")
        for item in found.estimates:
            print(f"  {item.parameter.path} = {item.value:.6g}, {item.low:.6g} ... {item.high:.6g}")
    print(f"differences cost {spent[1] / spent[0]:.1f} times the tangents")


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("cost", "gradient", "errors", "identify"), nargs="+")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each kind; the least counts")
    parser.add_argument("--seeds", default="100..140", help="random scenes of the errors")
    arguments = parser.parse_args()
    first, last = (int(part) for part in arguments.seeds.split(".."))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for what in arguments.what:
            if what == "errors":
                errors(first, last)
            elif what == "identify":
                identification()
            else:
                {"cost": cost, "gradient": gradient}[what](arguments.rounds)


if __name__ == "__main__":
    main()
