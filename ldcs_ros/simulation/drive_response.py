"""`DriveResponse`: how far nodes move under drive torques of one frequency, by the equation linearised at a motion."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse.linalg import splu

from ldcs_ros.integrators.implicit.linearisation import Linearisation
from ldcs_ros.physics.drive_curve import constant_curve
from ldcs_ros.physics.inputs import NO_INPUTS, HeldCommands
from ldcs_ros.physics.model import Model, Motion

# Rows whose displacements are held at one time.
_ROWS = 512


class DriveResponse:
    """Amplitudes of nodes in steady oscillation, (K + i w C - w^2 M)^-1 times the force of a torque.

    Above some 20 Hz they hardly depend on the shape of the sheet: on the shipped scenes by less than a quarter.

    Args:
        model: The model.
        motion: The motion to linearise at; its rates count as zero.
        held: Commands there.
        patterns: Torque of each joint for a unit of each column, shape (n_columns, n_arms, n_links).
    """

    def __init__(self, model: Model, motion: Motion, held: HeldCommands, patterns: np.ndarray) -> None:
        self._model = model
        still = np.zeros_like(motion.u)
        matrices = Linearisation(model, np.ones(len(model.free))).at(
            motion.time, motion.q, still, motion.a, held
        )
        self._by_q, self._by_u, self._mass = (matrix.to_scipy().tocsc() for matrix in matrices)
        forces = [
            model.force_jump(motion.time, motion.q, still, NO_INPUTS, HeldCommands(curve=constant_curve(one)))
            for one in patterns
        ]
        self._force = np.stack(forces, axis=1)[model.free]
        self._known: dict[float, np.ndarray] = {}

    def amplitudes(self, torque: np.ndarray, frequency: float, enough: float) -> np.ndarray:
        """Return a bound of the largest amplitude of a node [m] for each row of torques, shape (n,).

        Args:
            torque: Amplitude of each column [N m], shape (n, n_columns).
            frequency: Frequency [Hz].
            enough: Below it the sum over the columns is bound enough; above, the amplitude itself is found [m].

        Raises:
            RuntimeError: An undamped oscillation has this very frequency.
        """
        if frequency not in self._known:
            self._known[frequency] = self._solved(frequency)
        unit = self._known[frequency]
        bound = np.abs(torque) @ np.sqrt(_squares(unit.T).max(axis=1))
        if torque.shape[1] > 1:
            (rows,) = np.nonzero(bound > enough)
            for begin in range(0, len(rows), _ROWS):
                some = rows[begin : begin + _ROWS]
                bound[some] = np.sqrt(_squares(torque[some] @ unit.T).max(axis=1))
        return np.asarray(bound)

    def _solved(self, frequency: float) -> np.ndarray:
        w = 2.0 * math.pi * frequency
        matrix = -(w * w) * self._mass - 1j * w * self._by_u - self._by_q
        moved = splu(matrix.tocsc()).solve(self._force.astype(complex))
        nodes = np.zeros((3 * self._model.lattice.n_nodes, self._force.shape[1]), dtype=complex)
        free = self._model.free[: self._model.n_free_nodes]
        nodes[free] = moved[: len(free)]
        return nodes


def _squares(moved: np.ndarray) -> np.ndarray:
    """Return the squared amplitude of each node, shape (n, n_nodes), of its coordinates, shape (n, 3 n_nodes)."""
    squares = moved.real**2 + moved.imag**2
    return np.asarray(squares.reshape(len(moved), -1, 3).sum(axis=2))
