"""The energy audit: the work of inputs and drives against stored and dissipated energy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.integrators.base import Step
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.model import Model, Motion

# Gauss-Legendre points of a step: exact for polynomials of degree 9, a step's own curve has degree 5.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
# A step's own curve is used while its dissipation and the cubic's differ by less than this fraction.
SWING = 0.1


@dataclass(frozen=True)
class Power:
    """Powers that change the energy at an instant [W].

    Attributes:
        work: Of drive torques, wrenches and prescribed motion.
        dissipated: By dampers, drag and contact.
    """

    work: float
    dissipated: float


def power(model: Model, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands) -> Power:
    """Return the power of inputs and dampers at coordinates q and rates u, shape (n_coordinates,).

    The stored energy counts the kinetic energy of free coordinates only, so what moves a prescribed one delivers
    minus the force on it times its rate. The arms' force contains terms of the second order in the rates
    that do no work (they belong to the changing inertia); dampers are odd in the rates and are told by that.
    """
    no_rate = np.zeros_like(u)
    work = dissipated = 0.0
    reaction = np.zeros(model.n_coordinates)
    for term in model.terms:
        at_rest, moving = np.zeros(model.n_coordinates), np.zeros(model.n_coordinates)
        term.add_force(time, q, no_rate, inputs, at_rest)
        term.add_force(time, q, u, inputs, moving)
        damping = moving - at_rest
        if term is model.arms:
            back = np.zeros(model.n_coordinates)
            term.add_force(time, q, -u, inputs, back)
            damping = 0.5 * (moving - back)
            torque = term.drive_torque(time, inputs)
            joint_rate = np.diff(term.angles(u), axis=1, prepend=0.0)
            work += float(np.sum(torque * joint_rate))
        if term is model.wrench:
            work += float(u @ at_rest)
        dissipated -= float(u @ damping)
        reaction += at_rest + damping
    reaction[model.free] = 0.0
    return Power(work - float(u @ reaction), dissipated)


def cubic(step: Step, time: float, model: Model) -> Motion:
    """Return the motion inside a step on the cubic through position and rate at both ends."""
    left, right = step.left, step.right
    h, free = right.time - left.time, model.free
    s = (time - left.time) / h
    q, u = left.q.copy(), left.u.copy()
    way, u0, u1 = right.q[free] - left.q[free], h * left.u[free], h * right.u[free]
    c2, c3 = 3.0 * way - 2.0 * u0 - u1, -2.0 * way + u0 + u1
    q[free] += s * (u0 + s * (c2 + s * c3))
    u[free] = (u0 + s * (2.0 * c2 + s * 3.0 * c3)) / h
    model.prescribe(time, q, u)
    return Motion(time, q, u, left.a)


class EnergyAudit:
    """Adds up a run's energy, step by step.

    Args:
        model: The model.
        motion: Start of the run.

    Attributes:
        worst: Largest residual so far, |kinetic + potential + dissipated - work - start| [J].
        growth: Largest excess of stored and dissipated energy over the work put in [J].
        moved: Largest energy that was stored, put in or dissipated so far [J]: the residual relates to it.
    """

    def __init__(self, model: Model, motion: Motion) -> None:
        self.model = model
        self.start, self.kinetic = self._potential(motion), self._kinetic(motion)
        self.work = self.dissipated = 0.0
        self.worst = self.growth = self.moved = 0.0

    def follow(self, step: Step, end: float, inputs: HeldCommands) -> None:
        """Add one step, up to a time `end` [s] if it goes further."""
        left, right = step.left.time, min(step.right.time, end)
        if not right > left:
            return
        half = 0.5 * (right - left)
        curve = self._curve(step, inputs)
        for point, weight in zip(_POINTS, _WEIGHTS, strict=True):
            motion = curve(left + half * (1.0 + point))
            now = power(self.model, motion.time, motion.q, motion.u, inputs)
            self.work += half * weight * now.work
            self.dissipated += half * weight * now.dissipated
        motion = step.at(right, self.model)
        kinetic, potential = self._kinetic(motion), self._potential(motion) - self.start
        residual = kinetic + potential + self.dissipated - self.work - self.kinetic
        self.worst, self.growth = max(self.worst, abs(residual)), max(self.growth, residual)
        self.moved = max(self.moved, kinetic, abs(potential), abs(self.work), self.dissipated)

    @property
    def relative(self) -> float:
        """The largest residual over the energy moved; 0 without motion."""
        return self.worst / self.moved if self.moved > 0.0 else 0.0

    def _curve(self, step: Step, inputs: HeldCommands) -> Callable[[float], Motion]:
        # A step's own curve uses the accelerations at its ends. Where they belong to a transient much shorter than
        # the step, its rates swing by more than they are, and powers of stiff dampers with their squares.
        middle = 0.5 * (step.left.time + step.right.time)
        own, plain = step.at(middle, self.model), cubic(step, middle, self.model)
        powers = [power(self.model, middle, motion.q, motion.u, inputs).dissipated for motion in (own, plain)]
        if abs(powers[0] - powers[1]) > SWING * max(powers):
            return lambda time: cubic(step, time, self.model)
        return lambda time: step.at(time, self.model)

    def _potential(self, motion: Motion) -> float:
        return self.model.potential_energy(motion.time, motion.q)

    def _kinetic(self, motion: Motion) -> float:
        rate = motion.u[self.model.free]
        return 0.5 * float(rate @ self.model.momentum(motion.q, rate))
