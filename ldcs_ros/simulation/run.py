"""The states of a simulation at regular times, collected into a Run: points, pressures, joints and nodes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point
from ldcs_ros.physics.state import State
from ldcs_ros.tables.run import Run


def sample_times(start: float, duration: float, every: float) -> list[float]:
    """Return `start`, then a time `every` so often, and the end [s].

    Raises:
        ValueError: The duration or the period is not finite or not above zero.
    """
    if not (math.isfinite(duration) and duration > 0.0 and math.isfinite(every) and every > 0.0):
        raise ValueError(f"got duration {duration!r} s, every {every!r} s, expected finite times above 0 s")
    end = start + duration
    times: list[float] = (start + every * np.arange(int(duration / every) + 1)).tolist()
    # The last whole period may miss the end by rounding alone.
    if times[-1] > end - 1e-6 * every:
        times.pop()
    return [*times, end]


class RunCollector:
    """Collects states in the order of their times.

    Args:
        lattice: The lattice.
        points: Points whose positions are wanted.
        arm_names: Names of the arms.
        joint_names: Names of the joints.
        joint_index: Index of each joint in a flattened array of shape (n_arms, n_links).
    """

    def __init__(
        self,
        lattice: Lattice,
        points: Mapping[str, Point],
        arm_names: Sequence[str],
        joint_names: Sequence[str],
        joint_index: np.ndarray,
    ) -> None:
        self._lattice, self._points = lattice, points
        self._arm_names, self._joint_names, self._joint_index = arm_names, joint_names, joint_index
        self._times: list[float] = []
        self._nodes: list[np.ndarray] = []
        self._rows: list[dict[str, np.ndarray]] = []

    def add(self, state: State, commanded: np.ndarray | None) -> None:
        """Take a state and the commanded gauge pressures [Pa], shape (n_arms,), None without a pressure drive."""
        row = {name: point.pose(state.position)[0] for name, point in self._points.items()}
        if commanded is not None:
            for arm, target, pressure in zip(self._arm_names, commanded, state.pressure, strict=True):
                row |= {f"pressure_command.{arm}": target, f"{arm}/pressure": pressure}
        angle = state.joint_angle.ravel()[self._joint_index]
        row |= {f"joint/{name}": value for name, value in zip(self._joint_names, angle, strict=True)}
        self._times.append(state.time)
        self._nodes.append(state.position)
        self._rows.append(row)

    def run(self, title: str) -> Run:
        """Return the Run of all states so far."""
        times = np.array(self._times)
        channels = {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}
        nodes = np.array(self._nodes).reshape(len(times), 2, *self._lattice.nodes, 3)
        return Run(times, channels, times, nodes, title)
