"""What the two-step formula carries from one row of steps to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros.integrators.base import Step
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Motion

if TYPE_CHECKING:
    from ldcs_ros.integrators.implicit.bordered_kernel import FactorTables
    from ldcs_ros.integrators.implicit.system import Factors

# First and later contraction rate to expect of new factors.
FRESH_RATES = (0.5, 0.05)
NO_JUMP = np.zeros(0)


@dataclass(frozen=True)
class StepRow:
    """Steps of one length.

    Attributes:
        begin: Time of the first one's start [s].
        h: Their length [s].
        count: Number of steps.
        end: Time of the last one's end [s].
        is_open: A command may come at any time, and not at the end alone.
    """

    begin: float
    h: float
    count: int
    end: float
    is_open: bool = False

    def time(self, index: int) -> float:
        """Return the time at which step number `index` starts [s]."""
        return self.end if index >= self.count else self.begin + index * self.h


@dataclass(frozen=True)
class Loads:
    """What the kernel needs of held commands.

    Attributes:
        held: The commands.
        steady: Constant forces with the wrenches, shape (n_coordinates,).
        drive: Drive torques as functions of time, as of the kernel, shape (4, n_arms, n_links).
        is_constant: They are constant.
    """

    held: HeldCommands
    steady: np.ndarray
    drive: np.ndarray
    is_constant: bool

    def torque(self, time: float) -> np.ndarray:
        """Return the drive torque of each joint at a time [N m], shape (n_arms, n_links)."""
        toward, off, since, lag = self.drive
        if self.is_constant:
            return np.asarray(toward)
        return np.asarray(toward + off * np.exp((since - time) / lag))


@dataclass(frozen=True)
class CommandedRun:
    """What the formula carries from one row of steps to the next; its arrays do not change.

    Attributes:
        time: Time of the last step's end [s].
        before: Time of its start [s].
        length: Time between both, without the rounding of their difference [s].
        motion: q, u at both, shape (4, n_coordinates).
        vectors: Accelerations and carried errors, as of the kernel, shape (6, n_free).
        loads: Those of the last step.
        commanded: Time of the last command [s].
        h: Length that steps ought to have [s].
        since: Time of the last decision about it [s].
        level: Distance of the carried error then [m].
        row: The present row.
        index: Number of its next step.
        factors: Kept factors.
        tables: Those as the kernel reads them.
        rotations: Of the columns since factoring.
        travelled: Distance that nodes have moved since those were made [m].
        rates: First and later contraction rate to expect.
        distance: Largest distance of the carried error during the last steps [m].
        has_failed: The one-step method takes over here.
        previous: The run before its last step, where a command may come inside that.
        jump: That of the force at the start of that step, shape (n_free,) or (0,).
    """

    time: float
    before: float
    length: float
    motion: np.ndarray
    vectors: np.ndarray
    loads: Loads
    commanded: float
    h: float
    since: float
    level: float
    row: StepRow
    index: int = 0
    factors: Factors | None = None
    tables: FactorTables | None = None
    rotations: np.ndarray | None = None
    travelled: float = math.inf
    rates: tuple[float, float] = FRESH_RATES
    distance: float = 0.0
    has_failed: bool = False
    previous: CommandedRun | None = None
    jump: np.ndarray = field(default_factory=lambda: NO_JUMP)

    def changed(self, **values: object) -> CommandedRun:
        """Return a copy with other values: `dataclasses.replace` takes 15 us for so many, several times a command."""
        other = object.__new__(CommandedRun)
        other.__dict__.update(self.__dict__, **values)
        return other

    @property
    def end(self) -> Motion:
        """The motion at the end of the last step."""
        return Motion(self.time, self.motion[0], self.motion[1], self.vectors[1])

    @property
    def step(self) -> Step:
        """The last step."""
        left = Motion(self.before, self.motion[2], self.motion[3], self.vectors[0])
        return Step(left, self.end, 0.0)
