"""What a run compiles or loads at its first steps, done before its clock starts."""

from __future__ import annotations

from contextlib import suppress

from ldcs_ros.errors import CommandError, DivergenceError
from ldcs_ros.physics.kernels.coverage import is_covered
from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.simulation import Simulation

FIRST_TIME = 1e-4  # s
# Commands at this interval [s], at most so many: some hundredths of a second wait in the valves of an arm.
INTERVAL, MOST_COMMANDS = 1e-3, 60
# Commands rise by this fraction of what the scene allows, or by this force [N], each time, and return to zero.
RISE, FORCE, PERIOD = 1e-4, 1e-6, 10


def warm_up(scene: Scene, *, commanded: bool = False) -> None:
    """Move a throw-away simulation of a scene: kernels are compiled or loaded at their first use.

    Args:
        scene: The scene. If it diverges here, so will its run, which reports it.
        commanded: Commands may come at a rate; their steps have kernels of their own.
    """
    simulation = scene.build()
    with suppress(DivergenceError):
        simulation.advance_to(FIRST_TIME)
        # Other scenes have no such kernels, and a fine lattice would take long for the commands.
        for k in range(MOST_COMMANDS if commanded and is_covered(simulation.model) else 0):
            if simulation.follows_commands or not _send(simulation, 1 + k % PERIOD):
                return
            simulation.advance_to(FIRST_TIME + (k + 1) * INTERVAL)


def _send(simulation: Simulation, rises: int) -> bool:
    """Send the next small command; return whether the scene takes one."""
    inputs, arms = simulation.inputs, simulation.model.arms
    if inputs.pressure is not None and arms is not None:
        inputs.set_pressure(rises * RISE * min(own.pressure_limit for own in arms.each))
    elif inputs.torque is not None and arms is not None:
        inputs.set_torque(rises * RISE * min(own.torque_limit for own in arms.each))
    else:
        try:
            # With axes of the base: the formula knows no wrench that turns with the sheet.
            inputs.set_wrench(f"{next(iter(simulation.points), '')}_aligned", force=(0.0, 0.0, rises * FORCE))
        except CommandError:
            return False
    return True
