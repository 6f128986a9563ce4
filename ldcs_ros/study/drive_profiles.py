"""Drive profiles: a smooth profile that is sampled at a rate and held, as by a rig's controller, or followed itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.integrators.implicit.esdirk import Dirk
from ldcs_ros.physics.inputs import HeldCommands, Wrench
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.inputs import Inputs
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.problems import content_of, positions

PERIOD = 2.0  # s: from zero to the maximum and back
PUSHED_NODE = "node_top_8_4_aligned"
# Problem -> (shipped scene, what is commanded, its largest value [Pa, N m or N]).
DRIVEN = {
    "rig": ("rig", "pressure", 140.0e3),
    "paper": ("paper", "torque", 0.1392),
    "arc_pushed": ("arc", "wrench", -0.39),
}


@dataclass(frozen=True)
class DriveProfile:
    """A command over time, (1 - cos(2 pi t / PERIOD)) / 2 of the maximum.

    Attributes:
        kind: 'pressure', 'torque' or 'wrench'.
        maximum: Largest value [Pa, N m or N].
    """

    kind: str
    maximum: float

    def at(self, time: float) -> float:
        """Return the value at a time [s]; 0 before the start."""
        return 0.5 * self.maximum * (1.0 - math.cos(2.0 * math.pi * max(time, 0.0) / PERIOD))

    def send(self, inputs: Inputs, value: float) -> None:
        """Command a value."""
        if self.kind == "pressure":
            inputs.set_pressure(value)
        elif self.kind == "torque":
            inputs.set_torque(value)
        else:
            inputs.set_wrench(PUSHED_NODE, force=(0.0, 0.0, value))


def drive_problem(name: str) -> tuple[dict[str, Any], DriveProfile]:
    """Return the content of a driven problem's scene without its own commands, and the profile of its drive."""
    shipped, kind, maximum = DRIVEN[name]
    content = {**content_of(shipped), "inputs": []}
    if kind == "wrench":
        content["effects"] = [*content["effects"], {"type": "wrench"}]
    return content, DriveProfile(kind, maximum)


def sampled(
    simulation: Simulation, profile: DriveProfile, rate: float, times: tuple[float, ...]
) -> np.ndarray:
    """Advance through times [s] with a command every 1 / rate; return all node positions there [m].

    The result has shape (n_times, n_nodes, 3).
    """
    count = 0

    def advance(simulation: Simulation, end: float) -> None:
        nonlocal count
        while count / rate < end - TIME_TOLERANCE:
            simulation.advance_to(count / rate)
            profile.send(simulation.inputs, profile.at(count / rate))
            count += 1
        simulation.advance_to(end)

    return positions(simulation, times, advance)


def follow(simulation: Simulation, profile: DriveProfile) -> None:
    """Let a simulation's drive follow the profile itself, which no command can ask for: the smooth case.

    Only one term of this simulation changes: model, Jacobian and solver are those of every other run.
    """
    if profile.kind == "wrench":
        # Any: a method of one object is replaced, which types do not express.
        pushed: Any = simulation.model.wrench

        def add_force(
            time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
        ) -> None:
            now = {PUSHED_NODE: Wrench(force=(0.0, 0.0, profile.at(time)))}
            type(pushed).add_force(pushed, time, q, u, HeldCommands(wrenches=now), force)

        pushed.add_force = add_force
        # Compiled stages take a wrench for constant; this smooth case costs more than it would with a compiled one.
        if isinstance(simulation.integrator, Dirk):
            simulation.integrator.call_effects_one_by_one()
        # The term is asked for its force only while a wrench is commanded; how large it is, the profile says.
        simulation.inputs.set_wrench(PUSHED_NODE, force=(0.0, 0.0, 0.0))
        return
    term: Any = simulation.model.arms
    arms, shape = term.arms, (2, term.n_links)
    if profile.kind == "pressure":
        chamber = Chamber(profile, arms.fill_time, arms.vent_time, arms.dead_time)
        gain = arms.pressure_gain
        term.drive_torques = lambda times, inputs: np.array(
            [np.full(shape, gain * chamber.at(time)) for time in times]
        )
    else:
        term.drive_torques = lambda times, inputs: np.array(
            [np.full(shape, profile.at(time)) for time in times]
        )


class Chamber:
    """The pressure of a chamber whose valve follows a profile: p' = (profile - p) / tau, solved exactly.

    Args:
        profile: The pressure that the valve is asked for.
        fill_time: tau while the pressure rises [s].
        vent_time: tau while it falls [s].
        dead_time: Delay of the valve [s].
    """

    def __init__(self, profile: DriveProfile, fill_time: float, vent_time: float, dead_time: float) -> None:
        self._rate, self._half, self._delay = 2.0 * math.pi / PERIOD, 0.5 * profile.maximum, dead_time
        self._profile = profile
        self._parts: list[tuple[float, float, float]] = [(0.0, fill_time, self._offset(0.0, 0.0, fill_time))]
        # The pressure turns where it meets the profile: first within half a period, then within each other half.
        for k in range(1, 8):
            began, tau, _ = self._parts[-1]
            turn = self._meeting(max(began + 1e-6, 0.5 * k * PERIOD), 0.5 * (k + 1) * PERIOD)
            after = vent_time if tau == fill_time and k % 2 == 1 else fill_time
            self._parts.append((turn, after, self._offset(turn, self._pressure(turn), after)))

    def at(self, time: float) -> float:
        """Return the gauge pressure at a time [s, Pa]."""
        return self._pressure(max(time - self._delay, 0.0))

    def _driven(self, time: float, tau: float) -> float:
        w = self._rate
        return self._half * (
            1.0 - (math.cos(w * time) + w * tau * math.sin(w * time)) / (1.0 + (w * tau) ** 2)
        )

    def _offset(self, time: float, pressure: float, tau: float) -> float:
        return pressure - self._driven(time, tau)

    def _pressure(self, time: float) -> float:
        began, tau, offset = self._parts[0]
        for part in self._parts:
            if part[0] > time:
                break
            began, tau, offset = part
        return self._driven(time, tau) + offset * math.exp(-(time - began) / tau)

    def _meeting(self, low: float, high: float) -> float:
        # After an extremum of the profile the pressure lags until they meet.
        sign = self._profile.at(low) > self._pressure(low)
        for _ in range(60):
            middle = 0.5 * (low + high)
            if (self._profile.at(middle) > self._pressure(middle)) == sign:
                low = middle
            else:
                high = middle
        return high
