"""What a simulation tells without a change: its parts, poses, energy, and derivatives at the present state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.model import Model, Motion
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.physics.state import State
from ldcs_ros.simulation.inputs import Inputs
from ldcs_ros.simulation.problem import Problem
from ldcs_ros.simulation.threads import one_thread

if TYPE_CHECKING:
    # Loaded when they are asked for.
    from ldcs_ros.simulation.command_directions import OperatingPoint
    from ldcs_ros.simulation.linear_model import LinearModel
    from ldcs_ros.simulation.sensitivity import StaticSensitivity


class ReadableSimulation:
    """The read-only part of a `Simulation`.

    Attributes:
        scene: The problem that is simulated.
        model: Its model.
        inputs: What is commanded.
        time: Simulation time [s].
    """

    scene: Problem
    model: Model
    inputs: Inputs
    time: float

    @property
    def state(self) -> State:
        """The state at the present time."""
        raise NotImplementedError

    def motion(self) -> Motion:
        """Return the motion at the present time."""
        raise NotImplementedError

    @property
    def lattice(self) -> Lattice:
        """The lattice."""
        return self.scene.lattice

    @property
    def points(self) -> dict[str, Point]:
        """The scene's named points."""
        return self.scene.points

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that were built."""
        return tuple(effect.name for effect in self.model.effects)

    @property
    def arm_names(self) -> tuple[str, ...]:
        """Names of the arms in the order of the scene; () without arms."""
        return self.model.arms.names if self.model.arms is not None else ()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the arms' joints in the order of the scene, base to tip; () without arms."""
        if self.model.arms is None:
            return ()
        pairs = zip(self.arm_names, self.model.arms.links, strict=True)
        return tuple(f"{arm}_joint_{k}" for arm, links in pairs for k in range(1, links + 1))

    @property
    def joint_index(self) -> np.ndarray:
        """Index of each joint of `joint_names` in a flattened array of shape (n_arms, n_links), shape (n_joints,)."""
        return np.zeros(0, dtype=int) if self.model.arms is None else np.flatnonzero(self.model.arms.used)

    @property
    def joint_torque(self) -> np.ndarray:
        """Present drive torque of each joint [N m], shape (n_arms, n_links)."""
        if self.model.arms is None:
            return np.zeros((0, 0))
        return self.model.arms.drive_torque(self.time, self.inputs.held())

    def pose(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m], shape (3,), and unit quaternion x, y, z, w of a point or `node_<layer>_<i>_<j>`."""
        return point_at(self.lattice, name, self.points).pose(self.state.position)

    def energy(self) -> tuple[float, float]:
        """Return the kinetic and the potential (elastic and gravitational) energy [J]."""
        motion = self.motion()
        return self.model.kinetic_energy(motion.q, motion.u), self.model.potential_energy(self.time, motion.q)

    def operating_point(self) -> OperatingPoint:
        """Return the model at the present state with its commands, for derivatives."""
        from ldcs_ros.simulation.command_directions import OperatingPoint, constant_pressure

        motion, held = self.motion(), self.inputs.held()
        pressure = self.inputs.chamber_pressure(self.time)
        commanded = pressure if self.inputs.pressure is None else self.inputs.pressure
        now, later = (
            replace(held, chambers=tuple(map(constant_pressure, values, held.chambers)))
            for values in (pressure, commanded)
        )
        return OperatingPoint(
            self.scene,
            self.model,
            self.time,
            motion.q,
            motion.u,
            now,
            later,
            self.arm_names,
            self.joint_names,
            self.joint_index,
        )

    def sensitivity(self, of: Sequence[str], to: Sequence[str]) -> StaticSensitivity:
        """Return how places move at rest with commands and numbers of the scene [m per SI unit].

        The equilibrium near the present state counts; the simulation stays as it is.

        Args:
            of: Points or `node_<layer>_<i>_<j>`.
            to: `pressure.<arm>`, `torque.<arm>`, `torque.<joint>`, `wrench.<frame>.force`, or a path of the scene such
                as `effects.payload.mass`.

        Raises:
            ValueError: There is no such place or number.
            DivergenceError: No equilibrium was found.
        """
        from ldcs_ros.simulation.sensitivity import sensitivity

        with one_thread():
            return sensitivity(self.operating_point(), of, to)

    def linearize(self, modes: int = 12) -> LinearModel:
        """Return the linear model around the present state, with its lowest natural modes."""
        from ldcs_ros.simulation.linear_model import linearize

        with one_thread():
            return linearize(self.operating_point(), modes)
