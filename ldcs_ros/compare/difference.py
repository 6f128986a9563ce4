"""Differences of one channel in numbers: RMS, 95th percentile, maximum, mean, and where it ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.signals.series import Series, resample_common

# The end of a run, over which the final difference is averaged.
END_SHARE = 0.05


@dataclass(frozen=True)
class Figures:
    """The difference A - B of one component, or of a distance, in SI units.

    Attributes:
        rms: Root of the mean square.
        p95: 95th percentile of the amount.
        max: Largest amount.
        mean: Mean with its sign; of a distance, its mean.
        end: Mean over the last twentieth of the time.
        normalised_rms: RMS over the side length; None for what is no length.
    """

    rms: float
    p95: float
    max: float
    mean: float
    end: float
    normalised_rms: float | None = None


@dataclass(frozen=True)
class ChannelDifference:
    """The difference of one channel.

    Attributes:
        name: The channel.
        unit: Unit of the figures.
        time: Times that were compared, on A's clock [s], shape (n,).
        a, b: Values there, shape (n, k).
        figures: Component name -> figures; 'distance' for the length of a difference in space.
        skipped: Times left out because the other side was silent there.
    """

    name: str
    unit: str
    time: np.ndarray
    a: np.ndarray
    b: np.ndarray
    figures: dict[str, Figures]
    skipped: int

    @property
    def overall(self) -> Figures:
        """The figures of the whole: of the distance, or of the only component."""
        return self.figures.get("distance") or next(iter(self.figures.values()))


def channel_difference(
    name: str, a: Series, b: Series, offset: float, *, side_length: float | None, relative: bool
) -> ChannelDifference | None:
    """Return the difference of a channel; None if the two never have something to say at one time.

    Args:
        name: The channel.
        a, b: The two sides.
        offset: What B's clock is ahead of A's [s].
        side_length: Length of the sheet [m].
        relative: Compare what changed since the first common time, not the values themselves.
    """
    time, ours, theirs, skipped = resample_common(a, b, offset)
    if not len(time):
        return None
    if relative:
        ours, theirs = ours - _beginning(time, ours), theirs - _beginning(time, theirs)
    difference = ours - theirs
    length = side_length if a.unit == "m" else None
    parts = {axis: figures(difference[:, k], time, length) for k, axis in enumerate(a.axes)}
    if len(a.axes) > 1:
        parts["distance"] = figures(np.linalg.norm(difference, axis=1), time, length)
    return ChannelDifference(name, a.unit, time, ours, theirs, parts, skipped)


def figures(difference: np.ndarray, time: np.ndarray, side_length: float | None) -> Figures:
    """Return the figures of a difference over time, shape (n,)."""
    amount = np.abs(difference)
    rms = float(np.sqrt(np.mean(difference**2)))
    ending = time >= time[-1] - END_SHARE * (time[-1] - time[0])
    return Figures(
        rms=rms,
        p95=float(np.percentile(amount, 95)),
        max=float(amount.max()),
        mean=float(difference.mean()),
        end=float(difference[ending].mean()),
        normalised_rms=None if side_length is None else rms / side_length,
    )


def _beginning(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    # A few values, so that the noise of a single one does not shift the whole.
    first = time <= time[0] + min(0.1, 0.02 * (time[-1] - time[0]))
    beginning: np.ndarray = value[first].mean(axis=0)
    return beginning
