"""The commands held over a step: torques, chamber pressures and wrenches, free of side effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    # Loaded where commands are known beforehand.
    from ldcs_ros.physics.drive_curve import DriveCurve


@dataclass(frozen=True)
class ChamberPressure:
    """The pressure in one arm's chamber, a first-order lag towards its target: p' = (target - p) / tau, solved exactly.

    Attributes:
        time: When the target last changed [s].
        pressure: Gauge pressure then [Pa].
        target: Gauge pressure that it tends to [Pa].
        fill_time: Time constant while the pressure rises [s].
        vent_time: Time constant while it falls [s].
    """

    time: float
    pressure: float
    target: float
    fill_time: float
    vent_time: float

    @property
    def time_constant(self) -> float:
        """That of the way to the target [s]."""
        return self.fill_time if self.target > self.pressure else self.vent_time

    def at(self, time: float) -> float:
        """Return the gauge pressure [Pa] at a time >= `self.time` [s]; it never leaves pressure ... target."""
        tau = self.time_constant
        if tau == 0.0:
            return self.target
        return self.target + (self.pressure - self.target) * math.exp(-max(0.0, time - self.time) / tau)


@dataclass(frozen=True)
class Wrench:
    """A force and a torque at a frame of the sheet.

    Attributes:
        force: Force [N] in the frame's axes, shape (3,).
        torque: Torque [N m] in the frame's axes, shape (3,).
    """

    force: tuple[float, float, float] = (0.0, 0.0, 0.0)
    torque: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class HeldCommands:
    """Everything commanded, constant or a known function of time until the next command.

    Attributes:
        torque: Drive torque of each joint [N m], shape (n_arms, n_links); None unless the arms are torque-
            driven.
        chambers: Pressure in each arm's chamber; empty unless the arms are pressure-driven.
        wrenches: Wrench by frame name.
        curve: Drive torques that act instead of torque or chambers, where commands are known beforehand; or None.
    """

    torque: np.ndarray | None = None
    chambers: tuple[ChamberPressure, ...] = ()
    wrenches: dict[str, Wrench] = field(default_factory=dict)
    curve: DriveCurve | None = None


@dataclass(frozen=True)
class ScheduledCommand:
    """One entry of a scene's `inputs`: a command from a time on, unless others have come in the meantime.

    Attributes:
        time: Simulation time [s].
        torque: Joint torques [N m], as `Inputs.set_torque` takes them, or None.
        pressure: Gauge pressures [Pa], as `Inputs.set_pressure` takes them, or None.
        wrench: (frame, force [N], torque [N m]), or None.
    """

    time: float
    torque: object = None
    pressure: object = None
    wrench: tuple[str, tuple[float, float, float], tuple[float, float, float]] | None = None


NO_INPUTS = HeldCommands()
