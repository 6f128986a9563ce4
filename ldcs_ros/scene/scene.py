"""`Scene`: the frozen, checked content of one scene file."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.material import Material
from ldcs_ros.physics.points import Point

if TYPE_CHECKING:
    from ldcs_ros.simulation.simulation import Simulation


@dataclass(frozen=True)
class Solver:
    """How a scene is to be integrated.

    Attributes:
        integrator: A name of `INTEGRATORS`, or 'auto'.
        accuracy: Largest node position error asked for [m]; None with a fixed step.
        dt: Fixed step [s]; None with adaptive steps.
    """

    integrator: str = "auto"
    accuracy: float | None = 1.0e-5
    dt: float | None = None


@dataclass(frozen=True)
class Scene:
    """Everything that one scene file says; `build` makes a simulation of it.

    Attributes:
        name: Name of the shipped scene or stem of the file.
        title: One line for people.
        lattice: The lattice.
        points: Named points.
        effects: The effects, in the file's order.
        inputs: Schedule of commands, by time.
        sensors: Parameters of each sensor by name; empty means that none is computed.
        solver: How to integrate.
        material: What the sheet is made of, if it is not given by mass, stiffness and damping.
        text: The scene as YAML text, for bags.
    """

    name: str
    title: str
    lattice: Lattice
    points: dict[str, Point]
    effects: tuple[Effect, ...]
    inputs: tuple[ScheduledCommand, ...] = ()
    sensors: dict[str, dict[str, Any]] = field(default_factory=dict)
    solver: Solver = Solver()
    material: Material | None = None
    text: str = ""

    def effect(self, name: str) -> Any:
        """Return the scene's effect of a name, or None."""
        return next((effect for effect in self.effects if effect.name == name), None)

    def with_accuracy(self, accuracy: float) -> Scene:
        """Return the same scene with adaptive steps at another accuracy [m]."""
        from ldcs_ros.scene.schema import check_solver

        integrator = "auto" if self.solver.dt is not None else self.solver.integrator
        return replace(self, solver=check_solver({"integrator": integrator, "accuracy": accuracy}, "solver"))

    def build(self) -> Simulation:
        """Return a simulation of the scene at its start."""
        from ldcs_ros.simulation.simulation import Simulation

        return Simulation(self)
