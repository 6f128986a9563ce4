"""The state of a twin at an instant: everything that changes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class State:
    """The state of a twin at an instant; `Simulation.reset(state)` continues from it to the bit.

    Attributes:
        time: Simulation time [s].
        position: Node positions in ldcs_base [m], shape (n_nodes, 3), order layer, i, j; NaN for nodes in holes.
        velocity: Node velocities in ldcs_base [m/s], shape (n_nodes, 3); NaN for nodes in holes.
        link_angle: Angle of each link against its arm's line on the flat sheet [rad], shape (n_arms, n_links),
            in the order of the scene's arms. If arms differ in links, a shorter one ends in zeros.
        link_rate: Its time derivative [rad/s], same shape.
        pressure: Gauge pressure of each arm [Pa], shape (n_arms,), or (0,) without a pressure drive.
        memory: The simulation's own part (commands, the step under way), with which it continues to the bit; opaque.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    link_angle: np.ndarray
    link_rate: np.ndarray
    pressure: np.ndarray
    memory: object = field(default=None, repr=False, compare=False)

    @property
    def joint_angle(self) -> np.ndarray:
        """Angle of each link against the one before it [rad], shape (n_arms, n_links)."""
        return np.diff(self.link_angle, axis=1, prepend=0.0)

    @property
    def joint_rate(self) -> np.ndarray:
        """Time derivative of `joint_angle` [rad/s], of the same shape."""
        return np.diff(self.link_rate, axis=1, prepend=0.0)
