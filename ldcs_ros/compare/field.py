"""The difference of the whole surface: every node, at every time that both have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.compare.difference import Figures, figures
from ldcs_ros.signals.series import SAME_TIME, at_times, curve
from ldcs_ros.signals.signals import surface_values
from ldcs_ros.signals.tracks import SurfaceTrack

# Moments compared at most: a long run is sampled evenly.
MOST_MOMENTS = 1000


@dataclass(frozen=True)
class FieldDifference:
    """The distance of every node from where the other side has it.

    Attributes:
        time: Moments, on A's clock [s], shape (n,).
        distance: Distances [m], shape (n, 2, nx, ny).
        place: A's node positions at the worst moment [m], shape (2, nx, ny, 3).
        figures: Figures of all nodes at all moments; `end` is the RMS at the last moment.
        worst: Index of the moment with the largest distance.
        nodes: Nodes along x and y that were compared.
    """

    time: np.ndarray
    distance: np.ndarray
    place: np.ndarray
    figures: Figures
    worst: int
    nodes: tuple[int, int]

    @property
    def rms_over_nodes(self) -> np.ndarray:
        """RMS over the nodes at each moment [m], shape (n,)."""
        rms: np.ndarray = np.sqrt(np.mean(self.distance**2, axis=(1, 2, 3)))
        return rms

    @property
    def rms_over_time(self) -> np.ndarray:
        """RMS over the moments and both layers at each node [m], shape (nx, ny)."""
        rms: np.ndarray = np.sqrt(np.mean(self.distance**2, axis=(0, 1)))
        return rms


def field_difference(
    a: SurfaceTrack, b: SurfaceTrack, offset: float, *, side_length: float | None
) -> FieldDifference | None:
    """Return the difference of two surfaces; None if they have no time in common.

    Two lattices of different size are compared at the nodes of the coarser one, the finer one interpolated in
    the sheet; between moments, a cubic spline in time.
    """
    ours, theirs = surface_values(a), surface_values(b)
    nodes = (min(a.nodes[0], b.nodes[0]), min(a.nodes[1], b.nodes[1]))
    their_time = theirs.time - offset
    start, end = max(ours.time[0], their_time[0]) - SAME_TIME, min(ours.time[-1], their_time[-1]) + SAME_TIME
    index = np.flatnonzero((ours.time >= start) & (ours.time <= end))
    if not len(index):
        return None
    index = index[np.unique(np.linspace(0, len(index) - 1, min(len(index), MOST_MOMENTS)).astype(int))]
    time = ours.time[index]
    place = _on_nodes(ours.value[index], nodes)
    known = _on_nodes(theirs.value, nodes)
    other = at_times(their_time, known, time, curve(their_time, known, smooth=True))
    distance = np.linalg.norm(place - other, axis=-1)
    worst = int(np.argmax(distance.max(axis=(1, 2, 3))))
    flat = distance.reshape(len(time), -1)
    whole = figures(flat.ravel(), np.repeat(time, flat.shape[1]), side_length)
    last = float(np.sqrt(np.mean(flat[-1] ** 2)))
    summary = Figures(whole.rms, whole.p95, whole.max, whole.mean, last, whole.normalised_rms)
    return FieldDifference(time, distance, place[worst], summary, worst, nodes)


def _on_nodes(value: np.ndarray, nodes: tuple[int, int]) -> np.ndarray:
    """Return positions at a coarser grid of nodes, linear between those that there are."""
    for axis, count in ((2, nodes[0]), (3, nodes[1])):
        if value.shape[axis] != count:
            where = np.linspace(0.0, value.shape[axis] - 1.0, count)
            low = np.minimum(where.astype(int), value.shape[axis] - 2)
            share = (where - low).reshape([-1 if k == axis else 1 for k in range(value.ndim)])
            value = (1.0 - share) * value.take(low, axis=axis) + share * value.take(low + 1, axis=axis)
    return value
