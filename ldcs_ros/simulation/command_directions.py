"""Commands that are changed alone: the names of a scene's commands, and the force by each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ldcs_ros.physics.inputs import ChamberPressure, HeldCommands, Wrench
from ldcs_ros.physics.model import Model
from ldcs_ros.simulation.problem import Problem

AXES = "xyz"
KINDS = ("pressure", "torque", "wrench")


@dataclass(frozen=True)
class OperatingPoint:
    """A model at an instant, with its commands.

    Attributes:
        scene: The scene, for other values of its numbers.
        model: The model.
        time: Simulation time [s].
        q: Coordinates [m, rad].
        u: Their rates.
        now: The commands that act now.
        held: The same with every chamber at the pressure that was commanded.
        arm_names: Names of the arms.
        joint_names: Names of the joints.
        joint_index: Index of each joint in a flattened array of torques.
    """

    scene: Problem
    model: Model
    time: float
    q: np.ndarray
    u: np.ndarray
    now: HeldCommands
    held: HeldCommands
    arm_names: tuple[str, ...]
    joint_names: tuple[str, ...]
    joint_index: np.ndarray


@dataclass(frozen=True)
class CommandDirection:
    """A command that is changed alone.

    Attributes:
        name: Its name.
        unit: Its unit.
        step: A step of its size for differences; forces are linear in commands.
        apply: Returns held commands with the command changed by an amount.
        present: Returns the command's value in held commands; of several joints, that of the first.
    """

    name: str
    unit: str
    step: float
    apply: Callable[[HeldCommands, float], HeldCommands]
    present: Callable[[HeldCommands], float]


def force_slope(
    model: Model, time: float, q: np.ndarray, u: np.ndarray, held: HeldCommands, one: CommandDirection
) -> np.ndarray:
    """Return d(force)/d(command) on the free coordinates, shape (n_free,); exact, as forces are linear in commands."""
    ahead, before = (model.force(time, q, u, one.apply(held, sign * one.step)) for sign in (1.0, -1.0))
    return (ahead - before) / (2.0 * one.step)


def command_directions(at: OperatingPoint, name: str) -> Iterator[CommandDirection]:
    """Yield the commands of a name: `pressure.left`, `torque.left`, `torque.left_joint_2`, `wrench.P1.force.z`.

    Raises:
        ValueError: The scene has no such command; the message says which there are.
    """
    kind, _, rest = name.partition(".")
    arms, joints = at.arm_names, at.joint_names
    driven = bool(at.held.chambers) if kind == "pressure" else at.held.torque is not None
    if kind == "wrench":
        yield from _wrench_directions(at, name)
        return
    known = [*arms, *(joints if kind == "torque" else ())]
    if not driven or rest not in known:
        offered = all_commands(at)
        raise ValueError(
            f"got {name!r}, expected a command of the scene: {', '.join(offered) or 'it has none'}"
        )
    if kind == "pressure":
        index = arms.index(rest)
        yield CommandDirection(name, "Pa", 1e3, partial(_with_pressure, index), partial(_pressure, index))
        return
    if rest in arms:
        chosen = [k for k, joint in enumerate(joints) if joint.rpartition("_joint_")[0] == rest]
    else:
        chosen = [joints.index(rest)]
    places = at.joint_index[chosen]
    yield CommandDirection(name, "N m", 1e-2, partial(_with_torque, places), partial(_torque, places))


def _wrench_directions(at: OperatingPoint, name: str) -> Iterator[CommandDirection]:
    words = name.split(".")[1:]
    axes = AXES
    if len(words) == 3 and words[2] in AXES:
        axes = words.pop()
    if len(words) != 2 or words[1] not in ("force", "torque") or at.model.wrench is None:
        missing = "" if at.model.wrench else "; the scene needs '- {type: wrench}'"
        raise ValueError(f"got {name!r}, expected wrench.<frame>.force or .torque, or an axis of it{missing}")
    frame, quantity = words
    at.model.wrench.frame(frame)
    for axis in axes:
        unit = "N" if quantity == "force" else "N m"
        yield CommandDirection(
            f"wrench.{frame}.{quantity}.{axis}",
            unit,
            1e-2,
            partial(_with_wrench, frame, quantity, AXES.index(axis)),
            partial(_wrench, frame, quantity, AXES.index(axis)),
        )


def all_commands(at: OperatingPoint) -> list[str]:
    """Return the names of all commands of a scene; of wrenches, the forces at its named points."""
    names = []
    if at.held.chambers:
        names += [f"pressure.{arm}" for arm in at.arm_names]
    if at.held.torque is not None:
        names += [f"torque.{joint}" for joint in at.joint_names]
    if at.model.wrench is not None:
        names += [f"wrench.{point}.force" for point in at.model.points]
    return names


def constant_pressure(pressure: float, like: ChamberPressure) -> ChamberPressure:
    """Return a chamber at a constant gauge pressure [Pa]."""
    return replace(like, pressure=float(pressure), target=float(pressure))


def _pressure(index: int, held: HeldCommands) -> float:
    return held.chambers[index].target


def _torque(places: np.ndarray, held: HeldCommands) -> float:
    assert held.torque is not None
    return float(held.torque.flat[places[0]])


def _wrench(frame: str, quantity: str, axis: int, held: HeldCommands) -> float:
    return float(getattr(held.wrenches.get(frame, Wrench()), quantity)[axis])


def _with_pressure(index: int, held: HeldCommands, by: float) -> HeldCommands:
    chambers = list(held.chambers)
    chambers[index] = constant_pressure(chambers[index].target + by, chambers[index])
    return replace(held, chambers=tuple(chambers))


def _with_torque(places: np.ndarray, held: HeldCommands, by: float) -> HeldCommands:
    assert held.torque is not None
    torque = np.array(held.torque)
    torque.flat[places] += by
    return replace(held, torque=torque)


def _with_wrench(frame: str, quantity: str, axis: int, held: HeldCommands, by: float) -> HeldCommands:
    wrench = held.wrenches.get(frame, Wrench())
    vector = list(getattr(wrench, quantity))
    vector[axis] += by
    changed = replace(wrench, **{quantity: tuple(vector)})
    return replace(held, wrenches={**held.wrenches, frame: changed})
