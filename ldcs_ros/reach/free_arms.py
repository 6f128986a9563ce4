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


def free_arms(
    simulation: Simulation,
    targets: Sequence[TargetCoordinate],
    variables: Sequence[Variable],
    found: Reached,
    *,
    shape: ShapeTarget | None = None,
) -> Reached:
    """Return the nearest rest state with a free torque at every joint of the arms whose pressure varies.

    One pressure gives all joints of an arm the same torque. So the pressures are a special case of free joints, and the
    distance with free joints bounds that of any pressures from below, on the branch of the solution that was found.
    Were the force on every node free as well, every shape would be possible.
    Each torque stays between minus and plus that of the largest pressure that its arm may have.

    Args:
        simulation: The simulation of the solution; it stays as it is.
        targets: As of `reach`.
        variables: The pressures that may vary.
        found: The solution; the search begins there.
        shape: As of `reach`.

    Raises:
        ValueError: A variable is no pressure of an arm.
    """
    at = simulation.operating_point()
    arms = {variable.name.removeprefix("pressure."): variable for variable in variables}
    if not all(variable.name.startswith("pressure.") for variable in variables):
        raise ValueError("the bound of free arms needs pressures alone as variables")
    held = at.held
    for name, value in found.commands.items():
        (command,) = command_directions(at, name)
        held = command.apply(held, value - command.present(held))
    assert at.model.arms is not None
    torque = at.model.arms.drive_torque(at.time, held)
    driven = simulation.scene.edited({"effects.arms.drive": "torque", "inputs": None})
    other = Simulation(driven)
    free = replace(
        other.operating_point(), q=found.coordinates, held=replace(other.inputs.held(), torque=torque)
    )
    per_pascal = np.array([own.pressure_gain for own in at.model.arms.each])
    joints = []
    for joint, index in zip(at.joint_names, at.joint_index, strict=True):
        arm = joint.rpartition("_joint_")[0]
        if arm in arms:
            largest = max(abs(arms[arm].low), abs(arms[arm].high)) * per_pascal[at.arm_names.index(arm)]
            joints.append((Variable(f"torque.{joint}", -largest, largest), float(torque.flat[index])))
    with one_thread():
        return reach_from(
            free, targets, [one for one, _ in joints], shape, np.array([start for _, start in joints])
        )
