"""The start of a recording that begins in motion: a rest state, moved along a few slow shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.simulation.command_directions import (
    OperatingPoint,
    all_commands,
    command_directions,
    force_slope,
)
from ldcs_ros.simulation.linear_model import mass_matrix, rest_factors, stiffness_and_damping
from ldcs_ros.simulation.run_starts import start_modes

# Natural modes beside the shapes in which commands bend the sheet.
MODES = 6
# A shape whose part beyond those before it is smaller than this counts as a combination of them.
NEW_PART = 0.05
# Bounds: displacement in lengths of the sheet, and the time in which the fastest start covers it [s].
REACH, REACH_TIME = 0.25, 0.05


@dataclass(frozen=True)
class Start:
    """The unknown start of a recording: pressures of a rest state, and displacement and velocity along shapes.

    Attributes:
        time: Time of the start [s].
        pressure: Pressures to begin the search with [Pa], shape (n_arms,), empty without a pressure drive.
        limit: Largest pressure of each arm [Pa], same shape.
        shapes: Free coordinates of each shape, shape (n_free, n), whose largest displacement is 1 m.
        reach: Largest displacement along a shape [m].
    """

    time: float
    pressure: np.ndarray
    limit: np.ndarray
    shapes: np.ndarray
    reach: float

    @property
    def ranges(self) -> list[tuple[float, float, float]]:
        """First value, lower and upper bound of each number: pressures, displacements, velocities."""
        n, speed = self.shapes.shape[1], self.reach / REACH_TIME
        pressures = [(float(p), 0.0, float(high)) for p, high in zip(self.pressure, self.limit, strict=True)]
        return [*pressures, *[(0.0, -self.reach, self.reach)] * n, *[(0.0, -speed, speed)] * n]

    def split(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the parts of the numbers, shape (n_arms + 2 n_shapes,).

        They are the pressures [Pa], shape (n_arms,), and displacement [m, rad] and velocity [m/s, rad/s] of the free
        coordinates, shape (n_free,).
        """
        arms, n = len(self.pressure), self.shapes.shape[1]
        along, speed = numbers[arms : arms + n], numbers[arms + n :]
        return numbers[:arms], self.shapes @ along, self.shapes @ speed


def start_at(at: OperatingPoint, time: float) -> Start:
    """Return the unknown start near a rest state.

    Args:
        at: The rest state under the commands of the first instant.
        time: Time of the start [s].
    """
    model, still = at.model, np.zeros_like(at.u)
    by_q, _ = stiffness_and_damping(model, at.time, at.q, still, at.held)
    factors, mass = rest_factors(by_q), mass_matrix(model, at.q)
    names = [name for name in all_commands(at) if not name.startswith("wrench")]
    bent = [
        factors.solve(force_slope(model, at.time, at.q, still, at.held, one))
        for name in names
        for one in command_directions(at, name)
    ]
    kept: list[np.ndarray] = []
    for shape in (*bent, *start_modes(at, min(MODES, len(model.free))).T):
        whole = float(np.sqrt(shape @ (mass @ shape)))
        rest = shape / whole
        for _ in range(2):
            for one in kept:
                rest = rest - one * (one @ (mass @ rest))
        size = float(np.sqrt(rest @ (mass @ rest)))
        if size > NEW_PART:
            kept.append(rest / size)
    shapes = np.stack(kept, axis=1)
    shapes = shapes / np.abs(shapes[: model.n_free_nodes]).max(axis=0)
    chambers = at.held.chambers
    each = model.arms.each if model.arms is not None and chambers else ()
    return Start(
        time,
        np.array([chamber.target for chamber in chambers]),
        np.array([own.pressure_limit for own in each]),
        shapes,
        REACH * model.lattice.size[0],
    )
