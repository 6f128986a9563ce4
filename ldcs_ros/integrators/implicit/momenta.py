"""The momenta of a sheet that nothing holds: no damper forgets an error of them, and it shows more with time."""

from __future__ import annotations

import numpy as np

from ldcs_ros.integrators.base import ErrorState
from ldcs_ros.physics.model import Model, Motion

# Moments below this share of forces times their levers are rounding.
NO_MOMENT = 1e-10


class Momenta:
    """Linear and angular momentum of a loose sheet about its centre of mass, shape (2, 3) [N s, N m s]."""

    def __init__(self, model: Model) -> None:
        self._n = model.n_free_nodes
        self._free = model.free[: self._n]
        self._mass = model.mass[: self._n].reshape(-1, 3)[:, :1]
        self._whole = float(self._mass.sum())

    def _relative(self, values: np.ndarray) -> np.ndarray:
        """Return node vectors against those of the centre of mass, shape (n_nodes, 3)."""
        vectors = values.reshape(-1, 3)
        return np.asarray(vectors - (self._mass * vectors).sum(axis=0) / self._whole)

    def of_impulses(self, q: np.ndarray, push: np.ndarray) -> np.ndarray:
        """Return the momenta of impulses [N s] on the free coordinates at q; of forces, their rates."""
        vectors = push[: self._n].reshape(-1, 3)
        moment = np.cross(self._relative(q[self._free]), vectors)
        return np.stack([vectors.sum(axis=0), moment.sum(axis=0)])

    def is_turned(self, q: np.ndarray, force: np.ndarray) -> bool:
        """Return whether forces on the free coordinates at q have a moment about the centre of mass."""
        place, vectors = self._relative(q[self._free]), force[: self._n].reshape(-1, 3)
        levers = (np.linalg.norm(place, axis=1) * np.linalg.norm(vectors, axis=1)).sum()
        return bool(np.linalg.norm(np.cross(place, vectors).sum(axis=0)) > NO_MOMENT * levers)

    def of_rates(self, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the momenta of rates of the free coordinates at q."""
        return self.of_impulses(q, (self._mass * u[: self._n].reshape(-1, 3)).ravel())

    def of_error(self, motion: Motion, error: ErrorState) -> np.ndarray:
        """Return what an error adds to the momenta of a motion, to first order."""
        added = self.of_rates(motion.q, error.u)
        turned = np.cross(self._relative(error.q[: self._n]), self._relative(motion.u[self._free]))
        added[1] += (self._mass * turned).sum(axis=0)
        return added

    def velocities(self, q: np.ndarray, momenta: np.ndarray) -> np.ndarray:
        """Return the velocities of the nodes [m/s] in the rigid motion with given momenta, shape (n_nodes, 3)."""
        place = self._relative(q[self._free])
        inertia = (self._mass * place**2).sum() * np.eye(3) - (self._mass * place).T @ place
        spin = np.linalg.lstsq(inertia, momenta[1], rcond=1e-9)[0]
        return np.asarray(momenta[0] / self._whole + np.cross(spin, place))

    def spinning(self, q: np.ndarray, momenta: np.ndarray) -> np.ndarray:
        """Return the rates of the free coordinates [m/s], shape (n_free,), with the momenta's angular part."""
        return self.velocities(q, momenta * [[0.0], [1.0]]).ravel()

    def speed(self, q: np.ndarray, momenta: np.ndarray) -> float:
        """Return the largest speed of a node [m/s] in the rigid motion with given momenta, shape (2, 3)."""
        return float(np.linalg.norm(self.velocities(q, momenta), axis=1).max())
