"""`Checkpoint`: the part of a state beside positions and rates, with which a run continues to the bit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ldcs_ros.integrators.base import Counters, Step
from ldcs_ros.integrators.control import Pace
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.state import State
from ldcs_ros.simulation.inputs import InputsState

if TYPE_CHECKING:
    # Loaded where enough commands are known to make a course.
    from ldcs_ros.simulation.known_course import KnownCourse


@dataclass(frozen=True)
class Checkpoint:
    """A simulation's own part of a state; opaque to others.

    Attributes:
        origin: Lattice, points, effects, material, schedule and method of the simulation that made it.
        step: The integration step under way.
        pace: State of the step control.
        held: Commands during the step.
        is_command_waiting: A command was given at this time and no step has begun with it.
        next_command: Index of the next scheduled command.
        course: The known course of the commands, or None.
        is_course_prepared: That course is the one of the commands at this time.
        last_command_time: Time of the last command [s].
        next_command_time: Time at which the next command is expected [s].
        inputs: State of the inputs.
        integrator: State of the integrator, of its own class.
        counters: Cost of the run so far.
        error_estimate: Largest estimated error of a node position so far [m].
        velocity_estimate: Largest estimated error of a node velocity so far [m/s].
        finer: State of the finer solution of a verified run; None otherwise.
    """

    origin: tuple[object, ...]
    step: Step
    pace: Pace
    held: HeldCommands
    is_command_waiting: bool
    next_command: int
    course: KnownCourse | None
    is_course_prepared: bool
    last_command_time: float
    next_command_time: float
    inputs: InputsState
    integrator: object
    counters: Counters
    error_estimate: float
    velocity_estimate: float
    finer: State | None = None
