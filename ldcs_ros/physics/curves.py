"""Prescribed courses: the smooth rise and the circular arc."""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.compiled import compiled


def smoothstep(fraction: float) -> tuple[float, float]:
    """Return s = 3 u^2 - 2 u^3 and ds/du for u limited to 0 ... 1."""
    fraction = min(max(fraction, 0.0), 1.0)
    return fraction * fraction * (3.0 - 2.0 * fraction), 6.0 * fraction * (1.0 - fraction)


@compiled
def fill_arc(along, across, height, kappa, kappa_rate, place, rate):  # type: ignore[no-untyped-def]
    """Write points of an arc in the XZ plane and their velocities, shape (n, 3) [m, m/s].

    Args:
        along: Arc length of each point from the origin [m], shape (n,).
        across: Its y [m].
        height: Its distance along the local normal [m].
        kappa: Curvature [1/m], positive bends up.
        kappa_rate: Its rate [1/(m s)].

    On the arc itself x = sin(kappa s) / kappa and z = (1 - cos(kappa s)) / kappa. Below |kappa s| = 0.1 series
    replace them and their derivatives, because the closed form of the derivatives loses digits there. The first
    dropped term is below 1e-13 of the result.
    """
    for i in range(along.size):
        s = along[i]
        angle = s * kappa
        sine, cosine = np.sin(angle), np.cos(angle)
        if abs(angle) < 0.1:
            a2 = angle * angle
            x = s * (1 - a2 / 6 * (1 - a2 / 20 * (1 - a2 / 42 * (1 - a2 / 72))))
            z = s * angle / 2 * (1 - a2 / 12 * (1 - a2 / 30 * (1 - a2 / 56 * (1 - a2 / 90))))
            x_slope = -(s**2) * angle / 3 * (1 - a2 / 10 * (1 - a2 / 28 * (1 - a2 / 54 * (1 - a2 / 88))))
            z_slope = s**2 / 2 * (1 - a2 / 4 * (1 - a2 / 18 * (1 - a2 / 40 * (1 - a2 / 70))))
        else:
            x, z = sine / kappa, (1 - cosine) / kappa
            x_slope, z_slope = (s * cosine - x) / kappa, (s * sine - z) / kappa
        place[i, 0] = x - height[i] * sine
        place[i, 1] = across[i]
        place[i, 2] = z + height[i] * cosine
        rate[i, 0] = kappa_rate * (x_slope - height[i] * s * cosine)
        rate[i, 1] = 0.0
        rate[i, 2] = kappa_rate * (z_slope - height[i] * s * sine)
