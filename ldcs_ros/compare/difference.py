"""Differences in numbers: of one channel over time, and of the whole surface at every node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.signals.series import GAP_PERIODS, Series, at_times, covered, curve, resample_common
from ldcs_ros.signals.signals import surface_values
from ldcs_ros.signals.tracks import SurfaceTrack

# The end of a run, over which the final difference is averaged.
END_FRACTION = 0.05


@dataclass(frozen=True)
class ErrorStatistics:
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
        unit: Unit of the statistics.
        time: Times that were compared, on A's clock [s], shape (n,).
        a, b: Values there, shape (n, k).
        statistics: Component name -> statistics; 'distance' for the length of a difference in space.
        skipped: Times left out because the other side was silent there.
        coverage: Fraction of the recordings' overlap that its times cover without a gap, 0 ... 1.
    """

    name: str
    unit: str
    time: np.ndarray
    a: np.ndarray
    b: np.ndarray
    statistics: dict[str, ErrorStatistics]
    skipped: int
    coverage: float = 1.0

    @property
    def overall(self) -> ErrorStatistics:
        """The statistics of the whole: of the distance, or of the only component."""
        return self.statistics.get("distance") or next(iter(self.statistics.values()))


def coverage(time: np.ndarray, start: float, end: float) -> float:
    """Return the fraction of `start` to `end` [s] that ascending times [s], shape (n,), cover without a gap."""
    length = end - start
    if length <= TIME_TOLERANCE:
        return 1.0
    if len(time) < 2:
        return 0.0
    steps = np.diff(np.concatenate(([start], time, [end])))
    gaps = steps[steps > GAP_PERIODS * np.median(np.diff(time))]
    return float(max(0.0, 1.0 - gaps.sum() / length))


def channel_difference(
    name: str, a: Series, b: Series, offset: float, *, side_length: float | None, relative: bool
) -> ChannelDifference | None:
    """Return the difference of a channel; None if the two have no time in common.

    Args:
        name: The channel.
        a, b: The two sides.
        offset: Lead of B's clock over A's [s].
        side_length: Length of the sheet [m].
        relative: Compare the changes since the first common time, not the values themselves.
    """
    time, ours, theirs, skipped = resample_common(a, b, offset)
    if not len(time):
        return None
    if relative:
        ours, theirs = ours - _beginning(time, ours), theirs - _beginning(time, theirs)
    difference = ours - theirs
    length = side_length if a.unit == "m" else None
    parts = {axis: statistics(difference[:, k], time, length) for k, axis in enumerate(a.axes)}
    if len(a.axes) > 1:
        parts["distance"] = statistics(np.linalg.norm(difference, axis=1), time, length)
    return ChannelDifference(name, a.unit, time, ours, theirs, parts, skipped)


def statistics(difference: np.ndarray, time: np.ndarray, side_length: float | None) -> ErrorStatistics:
    """Return the statistics of a difference over time, shape (n,)."""
    amount = np.abs(difference)
    rms = float(np.sqrt(np.mean(difference**2)))
    ending = time >= time[-1] - END_FRACTION * (time[-1] - time[0])
    return ErrorStatistics(
        rms=rms,
        p95=float(np.percentile(amount, 95)),
        max=float(amount.max()),
        mean=float(difference.mean()),
        end=float(difference[ending].mean()),
        normalised_rms=None if side_length is None else rms / side_length,
    )


def _beginning(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    # The mean of a few values, so that the noise of one does not shift the whole.
    first = time <= time[0] + min(0.1, 0.02 * (time[-1] - time[0]))
    beginning: np.ndarray = value[first].mean(axis=0)
    return beginning


# Moments compared at most: a long run is sampled evenly.
MOST_MOMENTS = 1000


@dataclass(frozen=True)
class FieldDifference:
    """The distance of every node between two recordings.

    Attributes:
        time: Moments, on A's clock [s], shape (n,).
        distance: Distances [m], shape (n, 2, nx, ny); NaN where a side did not measure.
        place: A's node positions at the worst moment [m], shape (2, nx, ny, 3).
        statistics: Statistics of all nodes at all moments; `end` is the RMS at the last moment.
        worst: Index of the moment with the largest distance.
        nodes: Nodes along x and y that were compared.
        measured: Fraction of the distances that are known, 0 ... 1.
        coverage: Fraction of the recordings' overlap that its moments cover without a gap, 0 ... 1.
    """

    time: np.ndarray
    distance: np.ndarray
    place: np.ndarray
    statistics: ErrorStatistics
    worst: int
    nodes: tuple[int, int]
    measured: float
    coverage: float = 1.0

    @property
    def rms_over_nodes(self) -> np.ndarray:
        """RMS over the nodes at each moment [m], shape (n,)."""
        rms: np.ndarray = np.sqrt(np.nanmean(self.distance**2, axis=(1, 2, 3)))
        return rms

    @property
    def rms_over_time(self) -> np.ndarray:
        """RMS over the moments and both layers at each node [m], shape (nx, ny)."""
        mean = np.sum(self.distance**2, axis=(0, 1), where=np.isfinite(self.distance))
        rms: np.ndarray = np.sqrt(mean / np.maximum(np.isfinite(self.distance).sum(axis=(0, 1)), 1))
        return rms


def field_difference(
    a: SurfaceTrack, b: SurfaceTrack, offset: float, *, side_length: float | None
) -> FieldDifference | None:
    """Return the difference of two surfaces; None if they have no time in common.

    Lattices of different size are compared at the nodes of the coarser one; the finer one is interpolated in the
    sheet. Between moments a cubic spline interpolates in time, or straight lines at nodes that B did not measure
    throughout. Moments in a silence of B are left out.
    """
    ours, theirs = surface_values(a), surface_values(b)
    nodes = (min(a.nodes[0], b.nodes[0]), min(a.nodes[1], b.nodes[1]))
    their_time = theirs.time - offset
    start, end = (
        max(ours.time[0], their_time[0]) - TIME_TOLERANCE,
        min(ours.time[-1], their_time[-1]) + TIME_TOLERANCE,
    )
    index = np.flatnonzero((ours.time >= start) & (ours.time <= end))
    index = index[covered(their_time, ours.time[index])]
    if not len(index):
        return None
    index = index[np.unique(np.linspace(0, len(index) - 1, min(len(index), MOST_MOMENTS)).astype(int))]
    time = ours.time[index]
    place = _on_nodes(ours.value[index], nodes)
    distance = np.linalg.norm(place - _at_moments(their_time, _on_nodes(theirs.value, nodes), time), axis=-1)
    known = np.isfinite(distance)
    seen = known.any(axis=(1, 2, 3))
    if not seen.any():
        return None
    time, place, distance, known = time[seen], place[seen], distance[seen], known[seen]
    worst = int(np.argmax(np.nanmax(distance, axis=(1, 2, 3))))
    whole = statistics(distance[known], np.repeat(time, known.sum(axis=(1, 2, 3))), side_length)
    last = float(np.sqrt(np.mean(distance[-1][known[-1]] ** 2)))
    summary = ErrorStatistics(whole.rms, whole.p95, whole.max, whole.mean, last, whole.normalised_rms)
    return FieldDifference(time, distance, place[worst], summary, worst, nodes, float(known.mean()))


def _at_moments(known: np.ndarray, value: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return positions at some times, shape (n, 2, nx, ny, 3); NaN beside an unmeasured one."""
    throughout = np.isfinite(value).all(axis=(0, -1))[..., None]
    whole = np.where(throughout, value, 0.0)
    smooth = at_times(known, whole, asked, curve(known, whole, smooth=True))
    if throughout.all():
        return smooth
    straight = at_times(known, value, asked, curve(known, value, smooth=False))
    return np.where(throughout, smooth, straight)


def _on_nodes(value: np.ndarray, nodes: tuple[int, int]) -> np.ndarray:
    """Return positions at a coarser grid of nodes, linear between the given ones."""
    for axis, count in ((2, nodes[0]), (3, nodes[1])):
        if value.shape[axis] != count:
            where = np.linspace(0.0, value.shape[axis] - 1.0, count)
            low = np.minimum(where.astype(int), value.shape[axis] - 2)
            fraction = (where - low).reshape([-1 if k == axis else 1 for k in range(value.ndim)])
            value = (1.0 - fraction) * value.take(low, axis=axis) + fraction * value.take(low + 1, axis=axis)
    return value
