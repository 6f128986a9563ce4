"""The contract between a simulation and what is carried along its steps, such as tangents."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ldcs_ros.integrators.base import Integrator, Step
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model, Motion
from ldcs_ros.simulation.inputs import Inputs
from ldcs_ros.simulation.problem import Problem
from ldcs_ros.simulation.statistics import Statistics

if TYPE_CHECKING:
    from ldcs_ros.simulation.command_directions import OperatingPoint


class StepFollower(Protocol):
    """A computation along the steps of a simulation that may ask for shorter ones."""

    def longest_step(self, step: Step, held: HeldCommands) -> float:
        """Follow a step that the simulation is about to take; return the longest step that suffices [s].

        Where that is much shorter than the step, the simulation takes a shorter one from the same start instead.
        """

    def take(self, step: Step) -> None:
        """Go on to the end of the step that was followed last."""


class Followed(Protocol):
    """The part of a simulation that a follower uses."""

    scene: Problem
    model: Model
    inputs: Inputs
    integrator: Integrator
    accuracy: float | None
    time: float
    statistics: Statistics

    @property
    def last_step(self) -> Step:
        """The integration step under way."""

    def motion(self) -> Motion:
        """Return the motion at the present time."""

    def operating_point(self) -> OperatingPoint:
        """Return the model at the present state with its commands."""

    def follow(self, follower: StepFollower) -> None:
        """Have every step from now on followed."""

    def advance_to(self, time: float) -> None:
        """Advance to a simulation time [s]."""
