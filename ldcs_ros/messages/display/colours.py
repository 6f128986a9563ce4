"""The colours of what viewers show: a scale of heights for the sheet, and one for each other thing."""

from __future__ import annotations

import numpy as np

Colour = tuple[float, float, float, float]

# Six colours of viridis, distinguishable for colour-blind readers; its own ends are the ends of the scale.
_SCALE = (
    np.array(
        [(68, 1, 84), (65, 68, 135), (42, 120, 142), (34, 168, 132), (122, 209, 81), (253, 231, 37)],
        dtype=np.float32,
    )
    / 255.0
)
_PLACES = np.linspace(-0.5, 0.5, len(_SCALE))

ARM: Colour = (0.13, 0.13, 0.15, 1.0)
JOINT: Colour = (0.95, 0.95, 0.95, 1.0)
FORCE: Colour = (0.80, 0.15, 0.15, 1.0)
TORQUE: Colour = (0.60, 0.20, 0.65, 1.0)
PAYLOAD: Colour = (0.35, 0.37, 0.42, 1.0)
TEXT: Colour = (0.75, 0.10, 0.10, 1.0)
# Okabe and Ito's palette, in the order of the points.
_POINTS: tuple[Colour, ...] = (
    (0.00, 0.45, 0.70, 1.0),
    (0.84, 0.37, 0.00, 1.0),
    (0.80, 0.47, 0.65, 1.0),
    (0.90, 0.62, 0.00, 1.0),
    (0.34, 0.71, 0.91, 1.0),
)


def of_height(height: np.ndarray, length: float) -> np.ndarray:
    """Return red, green, blue, opacity (0 ... 1, float32) of heights above the clamp's mid-plane, shape (n, 4).

    Dark blue hangs half the sheet's length below, teal is level with the clamp, yellow is half a length
    above: one scale for all times and all sheets.

    Args:
        height: Heights z in ldcs_base [m], shape (n,).
        length: Length of the sheet along x [m].
    """
    fraction = np.asarray(height, dtype=np.float64) / length
    colours = np.ones((len(fraction), 4), dtype=np.float32)
    for channel in range(3):
        colours[:, channel] = np.interp(fraction, _PLACES, _SCALE[:, channel])
    return colours


def of_point(number: int) -> Colour:
    """Return the colour of a named point, by its place in the alphabet."""
    return _POINTS[number % len(_POINTS)]
