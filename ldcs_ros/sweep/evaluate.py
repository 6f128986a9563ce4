"""The samples of one chunk evaluated one after another; worker processes call this with plain data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import CommandError, DivergenceError, LdcsError, SceneError, SolverError, one_line
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import point_at
from ldcs_ros.scene import Scene, load_scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread
from ldcs_ros.sweep.design import SweepError
from ldcs_ros.validate.measure import edge_radius

AXES = "xyz"
RADIUS = "radius"
_COMMANDS = ("pressure", "torque", "wrench")


@dataclass(frozen=True)
class SampleTask:
    """What is done with every sample, as plain data.

    Attributes:
        content: The scene as plain values.
        name: Its name.
        paths: Names of the factors.
        measures: `POINT.AXIS` (also of `node_<layer>_<i>_<j>`) in ldcs_base [m], or `radius` of the actuated edges [m].
        duration: Simulated time after which is measured [s]; None for the rest state.
    """

    content: dict[str, Any]
    name: str
    paths: tuple[str, ...]
    measures: tuple[str, ...]
    duration: float | None = None


@dataclass(frozen=True)
class SampleResult:
    """The result of a sample.

    Attributes:
        index: Index of the sample in its design.
        values: Values of the factors.
        measured: Values of the measures; NaN after a failure.
        stable: The rest state is stable; None for a run in time and after a failure.
        failure: Reason for missing values; '' without one.
    """

    index: int
    values: tuple[float, ...]
    measured: tuple[float, ...]
    stable: bool | None = None
    failure: str = ""


def evaluate(task: SampleTask, indices: tuple[int, ...], samples: np.ndarray) -> list[SampleResult]:
    """Return the rows of some samples, shape (n, n_factors), each rest state sought from the one before.

    Raises:
        SweepError: A factor or a measure does not exist in the scene.
    """
    scene = load_scene(task.content)
    point = Evaluator(scene, task)
    with one_thread():
        return [point.row(index, values) for index, values in zip(indices, samples, strict=True)]


class Evaluator:
    """Evaluates samples of one scene.

    Args:
        scene: The scene.
        task: What is done.

    Raises:
        SweepError: A factor or a measure does not exist in the scene.
    """

    def __init__(self, scene: Scene, task: SampleTask) -> None:
        self._scene, self._task = scene, task
        self._edited = [k for k, path in enumerate(task.paths) if not _is_command(path)]
        self._commands = [k for k, path in enumerate(task.paths) if _is_command(path)]
        self._base = scene.build()
        if self._commands and task.duration is None:
            # The other commands are those at the end of the schedule.
            self._base.settle()
        self._present: Simulation | None = None
        for measure in task.measures:
            self._measure(self._base, measure)

    def row(self, index: int, values: np.ndarray) -> SampleResult:
        """Return the row of a sample, values of shape (n_variables,); a failure for its values is in the row."""
        given = tuple(float(value) for value in values)
        try:
            simulation = self.simulation(values)
            stable = None
            if self._task.duration is None:
                stable = self._settle(simulation)
            else:
                simulation.advance_to(self._task.duration)
            measured = tuple(self._measure(simulation, measure) for measure in self._task.measures)
            if not all(map(math.isfinite, measured)):
                raise DivergenceError(f"got {measured}, expected finite measures")
        except (DivergenceError, SceneError, SolverError, CommandError) as error:
            self._present = None
            return SampleResult(index, given, (math.nan,) * len(self._task.measures), None, one_line(error))
        return SampleResult(index, given, measured, stable)

    def simulation(self, values: np.ndarray) -> Simulation:
        """Return a simulation with a sample's values, shape (n_variables,), near the rest state before if there is one.

        Raises:
            SceneError: A value is out of its bounds, or there is no such path.
            CommandError: A command is out of its bounds, or there is no such command.
        """
        changes: dict[str, object] = {self._task.paths[k]: float(values[k]) for k in self._edited}
        before = self._present
        if changes or before is None or self._task.duration is not None:
            simulation = (self._scene.edited(changes) if changes else self._scene).build()
            if before is not None and before.state.position.shape == simulation.state.position.shape:
                state = before.state
                links = (
                    state.link_angle if simulation.state.link_angle.shape == state.link_angle.shape else None
                )
                simulation.start_from(state.position, link_angle=links)
        else:
            simulation = before
        if self._commands:
            self._command(simulation, values)
        return simulation

    def _settle(self, simulation: Simulation) -> bool:
        import warnings

        with warnings.catch_warnings():
            # An unstable rest state is in the row.
            warnings.simplefilter("ignore", UserWarning)
            stability = simulation.settle()
        self._present = simulation
        return stability.is_stable

    def _command(self, simulation: Simulation, values: np.ndarray) -> None:
        inputs, base = simulation.inputs, self._base.inputs
        pressure = None if base.pressure is None else base.pressure.copy()
        torque = None if base.torque is None else base.torque.copy()
        wrenches = dict(base.wrenches)
        kinds = set()
        for k in self._commands:
            kind, _, rest = self._task.paths[k].partition(".")
            kinds.add(kind)
            if kind == "pressure" and pressure is not None:
                pressure[self._places(rest)] = values[k]
            elif kind == "torque" and torque is not None:
                torque.flat[self._places(rest, joints=True)] = values[k]
            elif kind == "wrench":
                _put_wrench(wrenches, rest, float(values[k]))
            else:
                raise CommandError(f"the scene has no drive by {kind} @ {self._task.paths[k]}")
        if "pressure" in kinds and pressure is not None:
            inputs.set_pressure(pressure)
        if "torque" in kinds and torque is not None:
            inputs.set_torque(torque)
        for frame, wrench in wrenches.items():
            if "wrench" in kinds:
                inputs.set_wrench(frame, force=wrench.force, torque=wrench.torque)

    def _places(self, name: str, *, joints: bool = False) -> np.ndarray:
        base = self._base
        if name in base.arm_names and not joints:
            return np.array([base.arm_names.index(name)])
        known = [
            k for k, joint in enumerate(base.joint_names) if name in (joint, joint.rpartition("_joint_")[0])
        ]
        if not joints or not known:
            expected = [*base.arm_names, *(base.joint_names if joints else ())]
            raise CommandError(f"got the arm {name!r}, expected one of {expected}")
        return base.joint_index[known]

    def _measure(self, simulation: Simulation, measure: str) -> float:
        lattice: Lattice = simulation.lattice
        position = simulation.state.position
        if measure == RADIUS:
            return edge_radius(lattice, position)[0]
        place, _, axis = measure.rpartition(".")
        try:
            if axis not in tuple(AXES):
                raise ValueError("no axis")
            return float(point_at(lattice, place, simulation.points).position(position)[AXES.index(axis)])
        except ValueError as error:
            raise SweepError(
                f"got the measure {measure!r}, expected POINT.x, .y or .z of {list(simulation.points)} or a node, "
                f"or 'radius' ({one_line(error)}) @ --measure"
            ) from error


def check_task(task: SampleTask, first: np.ndarray) -> None:
    """Refuse a sweep whose names do not exist, before anything is run.

    Args:
        task: What is done.
        first: A sample, shape (n_factors,).

    Raises:
        SweepError: A measure does not exist.
        LdcsError: A factor does not exist, or its value is out of bounds.
    """
    try:
        Evaluator(load_scene(task.content), task).simulation(first)
    except LdcsError as error:
        raise SweepError(f"{task.name}: {one_line(error)}") from error


def _is_command(path: str) -> bool:
    return path.partition(".")[0] in _COMMANDS


def _put_wrench(wrenches: dict[str, Wrench], rest: str, value: float) -> None:
    words = rest.split(".")
    if len(words) != 3 or words[1] not in ("force", "torque") or words[2] not in tuple(AXES):
        raise CommandError(
            f"got 'wrench.{rest}', expected wrench.FRAME.force.AXIS or wrench.FRAME.torque.AXIS"
        )
    frame, quantity, axis = words
    held = wrenches.get(frame, Wrench())
    parts = {"force": list(held.force), "torque": list(held.torque)}
    parts[quantity][AXES.index(axis)] = value
    force, torque = parts["force"], parts["torque"]
    wrenches[frame] = Wrench((force[0], force[1], force[2]), (torque[0], torque[1], torque[2]))
