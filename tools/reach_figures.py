"""Measure inverse statics: recovered pressures, nearest points out of reach, and the shapes of a mould."""

from __future__ import annotations

import sys
import time

import numpy as np

from ldcs_ros import Simulation, load_scene
from ldcs_ros.reach import TargetCoordinate, Variable, free_arms, reach, shape_target, workspace

HIGHEST = 190e3  # Pa
MOULD_HIGHEST = 150e3
STARTS = 4
SHAPES = (
    "sphere:radius=0.5",
    "sphere:radius=1",
    "cylinder:radius=0.5",
    "saddle:radius=1",
    "saddle:radius=0.6",
    "sine:amplitude=0.01,length=0.3",
)


def _pressures(simulation: Simulation, highest: float) -> list[Variable]:
    return [Variable(f"pressure.{arm}", 0.0, highest) for arm in simulation.arm_names]


def _rest(simulation: Simulation, pressures: np.ndarray) -> np.ndarray:
    simulation.inputs.set_pressure(pressures)
    simulation.settle()
    return simulation.pose("P1")[0]


def _place(place: np.ndarray) -> list[TargetCoordinate]:
    return [TargetCoordinate("P1", axis, float(x)) for axis, x in zip("xyz", place, strict=True)]


def within_reach(count: int, draw: np.random.Generator) -> bool:
    """Print how random places of P1 give back their pressures, and how fast; return whether all do as asked."""
    simulation, truth = (load_scene("rig").build() for _ in range(2))
    simulation.settle()
    variables = _pressures(simulation, HIGHEST)
    commands, places, cpu, wall = [], [], [], []
    for _ in range(count):
        pressures = draw.uniform(0.0, HIGHEST, len(variables))
        place = _rest(truth, pressures)
        began, began_cpu = time.perf_counter(), time.process_time()
        best = reach(simulation, _place(place), variables)[0]
        cpu.append(time.process_time() - began_cpu)
        wall.append(time.perf_counter() - began)
        found = np.array(list(best.commands.values()))
        commands.append(np.abs(found / pressures - 1.0).max())
        places.append(np.linalg.norm(_rest(truth, found) - place))
    print(
        f"| {count} places of P1 of `rig` within reach: pressures recovered | 0.1 % | {100 * max(commands):.1g} % |"
    )
    print(f"| distance of P1, settled again with them | 1e-5 m | {max(places):.1g} m |")
    print(
        f"| CPU time after build | 0.1 s | median {np.median(cpu):.3f} s, longest {max(cpu):.3f} s "
        f"(by the clock {np.median(wall):.3f} and {max(wall):.3f} s) |"
    )
    return bool(max(commands) < 1e-3 and max(places) < 1e-5 and max(cpu) < 0.1)


def out_of_reach(count: int, draw: np.random.Generator) -> bool:
    """Print how near the result is to random places that P1 cannot reach; return whether a grid has nothing nearer."""
    simulation = load_scene("rig").build()
    simulation.settle()
    variables = _pressures(simulation, HIGHEST)
    grid = workspace(simulation, "P1", variables)
    low, high = grid.extent
    slopes, nearer = [], 0
    for _ in range(count):
        place = 0.5 * (low + high) + draw.uniform(-1.0, 1.0, 3) * (0.5 * (high - low) + 0.02)
        best = reach(simulation, _place(place), variables, starts=2)[0]
        slopes.append(best.optimality)
        nearer += bool(np.linalg.norm(grid.position - place, axis=-1).min() < best.distance - 1e-9)
    print(f"| {count} places out of reach: largest slope that is left | none | {max(slopes):.1g} m |")
    print(
        f"| of these, a grid of {grid.levels} x {grid.levels} pressures has a nearer point in | 0 | {nearer} |"
    )
    return nearer == 0


def shapes() -> None:
    """Print a table of the shapes that `mould` comes near to."""
    simulation = load_scene("mould").build()
    simulation.settle()
    variables = _pressures(simulation, MOULD_HIGHEST)
    print()
    print("| shape | RMS | largest error | RMS with free joints | largest slope that is left |")
    print("|---|---|---|---|---|")
    for text in SHAPES:
        shape = shape_target(text, simulation.lattice)
        found = reach(simulation, [], variables, shape=shape, starts=STARTS)
        free = free_arms(simulation, [], variables, found, shape=shape, starts=STARTS)
        best = found[0]
        print(
            f"| `{text}` | {1e3 * best.distance:.2f} mm | {1e3 * np.abs(best.shape_error).max():.1f} mm "
            f"| {1e3 * free.distance:.2f} mm | {max(best.optimality, free.optimality):.0e} m |",
            flush=True,
        )


def main(count: int, seed: int) -> int:
    """Print the figures; return 1 if one is missed."""
    draw = np.random.default_rng(seed)
    print("| figure | asked | measured |\n|---|---|---|")
    reached = within_reach(count, draw)
    reached &= out_of_reach(count // 2, draw)
    shapes()
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
