"""A quadratic manifold of the shapes that a scene takes in motion, fitted to samples of runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Of the mean square of a product of coordinates: rounding alone stays below it.
RIDGE = 1e-8


@dataclass(frozen=True)
class QuadraticManifold:
    """q = mean + [z, z_i z_j for i <= j] times `decoder`: main directions of samples, and their squares for the rest.

    The stiff couplings of the arms bend the set of possible shapes. A flat set of as many directions misses it by
    millimetres, the squares bring it to tenths.

    Attributes:
        mean: Coordinates at z = 0 [m, rad], shape (n_q,).
        decoder: Shape (r + r (r + 1) / 2, n_q).
        encoder: Shape (r, n_q): z = encoder (q - centre).
        centre: Mean of the samples, shape (n_q,).
        low: Smallest z of the samples, shape (r,).
        high: Largest z of the samples.
        scale: Displacement of all nodes together for z = 1 [m], shape (r,).
    """

    mean: np.ndarray
    decoder: np.ndarray
    encoder: np.ndarray
    centre: np.ndarray
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray

    @property
    def n(self) -> int:
        """Number of its coordinates z."""
        return len(self.scale)

    def encode(self, q: np.ndarray) -> np.ndarray:
        """Return z of coordinates, shape (n_q,) or (m, n_q)."""
        return np.array((q - self.centre) @ self.encoder.T)

    def decode(self, z: np.ndarray) -> np.ndarray:
        """Return coordinates [m, rad] of z, shape (r,) or (m, r)."""
        return np.array(self.mean + _products(z) @ self.decoder)

    def tangent(self, z: np.ndarray) -> np.ndarray:
        """Return the derivatives of the coordinates by z, shape (r, n_q)."""
        first, second = np.triu_indices(self.n)
        by_z = np.zeros((self.n, len(first)))
        places = np.arange(len(first))
        np.add.at(by_z, (first, places), z[second])
        np.add.at(by_z, (second, places), z[first])
        return np.array(self.decoder[: self.n] + by_z @ self.decoder[self.n :])


def fit_manifold(samples: np.ndarray, count: int) -> QuadraticManifold:
    """Return the manifold of `count` coordinates nearest to samples of coordinates, shape (m, n_q)."""
    centre = samples.mean(axis=0)
    moved = samples - centre
    _, vectors = np.linalg.eigh(moved.T @ moved)
    directions = vectors[:, : -count - 1 : -1].T
    along = moved @ directions.T
    scale = along.std(axis=0)
    z = along / scale
    features = np.hstack([_products(z), np.ones((len(z), 1))])
    gram = features.T @ features + RIDGE * len(z) * np.eye(features.shape[1])
    fitted = np.linalg.solve(gram, features.T @ (moved - along @ directions))
    decoder = fitted[:-1].copy()
    decoder[:count] += directions * scale[:, None]
    return QuadraticManifold(
        centre + fitted[-1],
        np.ascontiguousarray(decoder),
        directions / scale[:, None],
        centre,
        z.min(axis=0),
        z.max(axis=0),
        scale,
    )


def _products(z: np.ndarray) -> np.ndarray:
    first, second = np.triu_indices(z.shape[-1])
    return np.concatenate([z, z[..., first] * z[..., second]], axis=-1)
