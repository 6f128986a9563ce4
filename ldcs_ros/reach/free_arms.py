"""The bound of free arms: how near a sheet could come if every joint of its arms had a torque of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ldcs_ros.reach.reach import Reached, TargetCoordinate, Variable, reach_from
from ldcs_ros.reach.shapes import ShapeTarget
from ldcs_ros.simulation.command_directions import command_directions
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread

# Random torques differ from those of a solution by at most this part of the largest.
AROUND = 0.5


def free_arms(
    simulation: Simulation,
    targets: Sequence[TargetCoordinate],
    variables: Sequence[Variable],
    found: Sequence[Reached],
    *,
    shape: ShapeTarget | None = None,
    starts: int = 1,
    seed: int = 0,
) -> Reached:
    """Return the nearest rest state with a free torque at every joint of the arms whose pressure varies.

    One pressure gives all joints of an arm the same torque. So pressures are a special case of free joints, and the
    least distance with free joints bounds that of any pressures from below. The search for it is local: it begins at
    each solution, and at random torques. A nearer rest state that it misses would lower the bound.
    Each torque stays between minus and plus that of the largest pressure that its arm may have.

    Args:
        simulation: The simulation of the solution; it stays as it is.
        targets: As of `reach`.
        variables: The pressures that may vary.
        found: The solutions of `reach`.
        shape: As of `reach`.
        starts: Number of searches: from each solution, then from random torques around those of the nearest.
        seed: Seed of the random torques.

    Raises:
        ValueError: A variable is no pressure of an arm.
    """
    if not all(variable.name.startswith("pressure.") for variable in variables):
        raise ValueError("the bound of free arms needs pressures alone as variables")
    at = simulation.operating_point()
    arms = at.model.arms
    assert arms is not None
    largest = np.zeros((arms.n_arms, arms.n_links))
    for variable in variables:
        number = at.arm_names.index(variable.name.removeprefix("pressure."))
        largest[number] = max(abs(variable.low), abs(variable.high)) * arms.each[number].pressure_gain
    torques = []
    for one in found[:starts]:
        held = at.held
        for name, value in one.commands.items():
            (command,) = command_directions(at, name)
            held = command.apply(held, value - command.present(held))
        torques.append(arms.drive_torque(at.time, held))
    other = Simulation(simulation.scene.edited({"effects.arms.drive": "torque", "inputs": None}))
    free = replace(
        other.operating_point(),
        q=found[0].coordinates,
        held=replace(other.inputs.held(), torque=torques[0]),
    )
    draw = np.random.default_rng(seed)
    torques += [torques[0] + AROUND * draw.uniform(-largest, largest) for _ in range(starts - len(torques))]
    joints = [
        (f"torque.{name}", index)
        for name, index in zip(at.joint_names, at.joint_index, strict=True)
        if largest.flat[index] > 0.0
    ]
    variables = [Variable(name, -largest.flat[index], largest.flat[index]) for name, index in joints]
    index = [index for _, index in joints]
    with one_thread():
        return reach_from(free, targets, variables, shape, [torque.flat[index] for torque in torques])[0]
