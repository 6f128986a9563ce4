"""Prescribed courses: the smooth rise and the circular arc."""

from __future__ import annotations

import numpy as np


def smoothstep(share: float) -> tuple[float, float]:
    """Return s = 3 u^2 - 2 u^3 and ds/du for u limited to 0 ... 1."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share), 6.0 * share * (1.0 - share)


def arc(along: np.ndarray, kappa: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return x, z [m] of points at arc length `along` [m] on an arc of curvature kappa [1/m], and their d/dkappa.

    x = sin(kappa s) / kappa and z = (1 - cos(kappa s)) / kappa; below |kappa s| = 0.1 their series, whose
    first dropped term is below 1e-13 of the result (the closed form of the derivative loses digits there).
    """
    angle = along * kappa
    small = np.abs(angle) < 0.1
    a2 = angle * angle
    x_series = along * (1 - a2 / 6 * (1 - a2 / 20 * (1 - a2 / 42 * (1 - a2 / 72))))
    z_series = along * angle / 2 * (1 - a2 / 12 * (1 - a2 / 30 * (1 - a2 / 56 * (1 - a2 / 90))))
    dx_series = -(along**2) * angle / 3 * (1 - a2 / 10 * (1 - a2 / 28 * (1 - a2 / 54 * (1 - a2 / 88))))
    dz_series = along**2 / 2 * (1 - a2 / 4 * (1 - a2 / 18 * (1 - a2 / 40 * (1 - a2 / 70))))
    if small.all():
        return x_series, z_series, dx_series, dz_series
    sine, cosine = np.sin(angle), np.cos(angle)
    x = np.where(small, x_series, sine / kappa)
    z = np.where(small, z_series, (1 - cosine) / kappa)
    x_by_kappa = np.where(small, dx_series, (along * cosine - sine / kappa) / kappa)
    z_by_kappa = np.where(small, dz_series, (along * sine - (1 - cosine) / kappa) / kappa)
    return x, z, x_by_kappa, z_by_kappa
