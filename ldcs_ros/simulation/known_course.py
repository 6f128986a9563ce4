"""`KnownCourse`: commands of the arms that are known beforehand, and the smooth drive that replaces them.

Commands at a rate that sample something smooth differ from a smooth drive by a sawtooth. Its mean over each interval is
zero; the sheet hardly follows the rest. Steps then pass many commands. The course estimates how far nodes move
under the sawtooth, and is smooth only where that is a small fraction of the asked accuracy.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ldcs_ros.physics.drive_curve import STENCIL, CurveFit, DriveCurve
from ldcs_ros.physics.effects.arms import ArmsTerm
from ldcs_ros.physics.inputs import ChamberPressure, HeldCommands, ScheduledCommand
from ldcs_ros.physics.model import Model, Motion
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.drive_response import DriveResponse
from ldcs_ros.simulation.inputs import Inputs

# Commands come at a rate if no more than this lies between them [s]; so many intervals make a course.
LONGEST_INTERVAL, FEWEST_INTERVALS = 0.1, 10
# A smooth stretch is at least so long [s]: the steps at its ends cost more than a shorter one saves.
SHORTEST_STRETCH = 0.1
# The estimated difference may be this fraction of the asked accuracy.
LARGEST_SHARE = 0.3
# The sawtooth counts as an oscillation of this fraction of its largest value, at the frequency of the commands: its
# first harmonic has 2 / pi. The rest, and what a bent sheet responds more, is the second factor.
HARMONIC, SAFETY = 2.0 / math.pi, 1.3
# Steps sample a drive this often at 1e-5 m asked [Hz]: faster parts of its means are roughness. What steps miss of
# them counts as an oscillation of that frequency, and this fraction of their size.
RESOLVED, ROUGHNESS = 20.0, 0.25
# Intervals of like length are judged with one frequency: a factor of 2^(1 / LIKE) in length.
LIKE = 2.0
# Lattices of more free coordinates have no smooth drive: its estimate needs factors of a complex matrix.
MOST_COORDINATES = 20_000


@dataclass(frozen=True, eq=False)
class KnownCourse:
    """Commands of the arms from a time on, interval by interval.

    Attributes:
        knots: Time at which each interval begins [s], shape (n + 1,); the last one does not end.
        expected: Torque of each joint [N m], shape (n + 1, n_arms, n_links), or target pressure of each arm [Pa],
            shape (n + 1, n_arms), in each interval.
        curve: The smooth drive.
        is_smooth: Whether it acts in an interval, shape (n + 1,).
        ends: End of the stretch of the same kind that an interval belongs to [s], shape (n + 1,).
        difference: Estimated difference of a node's position that the smooth drive makes in that stretch [m],
            shape (n + 1,).
        speed: The same of its velocity [m/s].
        is_announced: Whether the commands come from outside, and may not come.
    """

    knots: tuple[float, ...]
    expected: np.ndarray
    curve: DriveCurve
    is_smooth: np.ndarray
    ends: np.ndarray
    difference: np.ndarray
    speed: np.ndarray
    is_announced: bool

    def interval(self, time: float) -> int:
        """Return the interval of a time [s], which begins at its knot; -1 before the course."""
        return bisect_right(self.knots, time + TIME_TOLERANCE) - 1

    def next_knot(self, time: float) -> float:
        """Return the next knot after a time [s]; infinity without one."""
        k = self.interval(time) + 1
        return self.knots[k] if k < len(self.knots) else math.inf

    def agrees(self, interval: int, held: HeldCommands) -> bool:
        """Return whether what is held is what the course says of an interval."""
        if interval < 0:
            return False
        if held.torque is not None:
            return bool((held.torque == self.expected[interval]).all())
        targets = [chamber.target for chamber in held.chambers]
        return targets == self.expected[interval].tolist()


@dataclass(frozen=True)
class _Pieces:
    """Held drive torques: value + swing exp(-t / lag) of the time t since an interval's start, by column.

    Attributes:
        lengths: Of the intervals [s], shape (n, 1).
        value: Shape (n, n_columns) [N m].
        swing: Same shape [N m].
        lag: Same shape [s].
        bounds: Least and largest torque of each column [N m], shape (2, n_columns).
        column: Column of each joint, shape (n_arms, n_links).
    """

    lengths: np.ndarray
    value: np.ndarray
    swing: np.ndarray
    lag: np.ndarray
    bounds: np.ndarray
    column: np.ndarray

    def at(self, s: float) -> np.ndarray:
        """Return the torques at a fraction of each interval [N m]."""
        return self.value + self.swing * np.exp(-s * self.lengths / self.lag)

    def integrals(self) -> np.ndarray:
        """Return the integral over each interval [N m s]."""
        return self.value * self.lengths + self.swing * self.lag * self._passed()

    def first_moments(self) -> np.ndarray:
        """Return the integral over each interval of the integral since its start [N m s^2]."""
        rest = self.swing * self.lag * (self.lengths - self.lag * self._passed())
        return 0.5 * self.value * self.lengths**2 + rest

    def _passed(self) -> np.ndarray:
        return -np.expm1(-self.lengths / self.lag)


def known_course(
    model: Model,
    motion: Motion,
    inputs: Inputs,
    scheduled: Sequence[ScheduledCommand],
    announced: Sequence[ScheduledCommand],
    accuracy: float,
) -> KnownCourse | None:
    """Return the course of the commands of the arms after a motion; None if no part of it is smooth.

    Args:
        model: The model.
        motion: The present motion.
        inputs: The present commands.
        scheduled: Commands of the scene still to come, their times rising.
        announced: Commands that will come from outside, their times rising.
        accuracy: Asked accuracy [m].
    """
    if model.arms is None or model.arms.prescribed or len(model.free) > MOST_COORDINATES:
        return None
    kind = model.arms.arms.drive
    if len(scheduled) + len(announced) < FEWEST_INTERVALS:
        return None
    coming = _coming(kind, motion.time, inputs, scheduled, announced)
    held = inputs.held()
    times, expected = (_torques if kind == "torque" else _targets)(model.arms, motion.time, inputs, coming)
    lengths = np.diff(times)
    if np.count_nonzero(lengths <= LONGEST_INTERVAL) < max(FEWEST_INTERVALS, STENCIL):
        return None
    if kind == "torque":
        pieces = _torque_pieces(model.arms, lengths, expected)
    else:
        pieces = _pressure_pieces(model.arms, times, expected, held.chambers)
    patterns = np.stack([pieces.column == k for k in range(pieces.value.shape[1])]).astype(float)
    response = DriveResponse(model, motion, held, patterns)
    try:
        return _Judgement(np.array(times), expected, pieces, response, accuracy).course(
            is_announced=bool(announced)
        )
    except RuntimeError:
        return None


def _coming(
    kind: str,
    time: float,
    inputs: Inputs,
    scheduled: Sequence[ScheduledCommand],
    announced: Sequence[ScheduledCommand],
) -> Iterator[tuple[float, object]]:
    """Yield time and value of the commands of one kind that will act; those from outside replace the schedule."""
    first = next((one.time for one in announced if getattr(one, kind) is not None), math.inf)
    if kind not in inputs.get_state().overridden:
        for one in scheduled:
            if getattr(one, kind) is not None and one.time <= first:
                yield one.time, getattr(one, kind)
    for one in announced:
        if getattr(one, kind) is not None and one.time > time - TIME_TOLERANCE:
            yield max(one.time, time), getattr(one, kind)


def _torques(
    arms: ArmsTerm, time: float, inputs: Inputs, coming: Iterator[tuple[float, object]]
) -> tuple[list[float], np.ndarray]:
    """Return knots [s] and the torques from each on [N m], shape (n, n_arms, n_links)."""
    assert inputs.torque is not None
    times: list[float] = [time]
    values: list[np.ndarray] = [inputs.torque]
    for due, value in coming:
        given = np.array(value, dtype=float)
        torque: np.ndarray = np.empty(arms.used.shape)
        torque[:] = given[:, None] if given.ndim == 1 and given.size > 1 else given
        if due <= times[-1] + TIME_TOLERANCE:
            values[-1] = torque
        else:
            times.append(due)
            values.append(torque)
    return times, np.array(values)


def _targets(
    arms: ArmsTerm, time: float, inputs: Inputs, coming: Iterator[tuple[float, object]]
) -> tuple[list[float], np.ndarray]:
    """Return knots [s] and the target of each arm's chamber from each on [Pa], shape (n, n_arms)."""
    state = inputs.get_state()
    given = list(coming)
    changes = [(due, [math.nan if one is None else one for one in targets]) for due, targets in state.pending]
    dues = np.array([due for due, _ in changes] + [due for due, _ in given])
    targets = np.empty((len(dues), arms.n_arms))
    for k, value in enumerate([*(row for _, row in changes), *(value for _, value in given)]):
        targets[k] = np.array(value, dtype=float)
    # Knots of each arm: what is pending already, then its commands after its dead time.
    delay = np.array([own.dead_time for own in arms.each])
    is_pending = np.arange(len(dues)) < len(changes)
    at = np.where(is_pending[:, None], dues[:, None], dues[:, None] + delay)
    ordered = np.unique(at[~np.isnan(targets)])
    later = ordered[ordered > time + TIME_TOLERANCE]
    times = [time, *later[np.diff(later, prepend=time) > TIME_TOLERANCE].tolist()]
    expected = np.empty((len(times), arms.n_arms))
    for a in range(arms.n_arms):
        own = ~np.isnan(targets[:, a])
        order = np.argsort(at[own, a], kind="stable")
        due, value = at[own, a][order], np.append(state.chambers[a].target, targets[own, a][order])
        expected[:, a] = value[np.searchsorted(due, np.array(times) + TIME_TOLERANCE, side="right")]
    return times, expected


def _torque_pieces(arms: ArmsTerm, lengths: np.ndarray, torque: np.ndarray) -> _Pieces:
    flat = torque[:-1].reshape(len(torque) - 1, -1)
    first, column = _distinct(flat)
    value = flat[:, first]
    limit = np.repeat([own.torque_limit for own in arms.each], arms.n_links)
    bounds = np.zeros((2, value.shape[1]))
    np.maximum.at(bounds[1], column, limit)
    bounds[0] = -bounds[1]
    none = np.zeros_like(value)
    return _Pieces(
        lengths[:, None], value, none, none + 1.0, bounds, column.reshape(arms.n_arms, arms.n_links)
    )


def _pressure_pieces(
    arms: ArmsTerm, times: Sequence[float], target: np.ndarray, chambers: Sequence[ChamberPressure]
) -> _Pieces:
    n, gain = len(times) - 1, np.array([own.pressure_gain for own in arms.each])
    swing, lag = np.zeros((n, arms.n_arms)), np.ones((n, arms.n_arms))
    for a, chamber in enumerate(chambers):
        pressure = chamber.at(times[0])
        for i, goal in enumerate(target[:-1, a].tolist()):
            tau = chamber.fill_time if goal > pressure else chamber.vent_time
            if tau > 0.0:
                swing[i, a], lag[i, a] = pressure - goal, tau
                pressure = goal + (pressure - goal) * math.exp((times[i] - times[i + 1]) / tau)
            else:
                pressure = goal
    whole = np.concatenate([gain * target[:-1], gain * swing, lag])
    first, column = _distinct(whole)
    value, swing, lag = np.split(whole[:, first], 3)
    bounds = np.zeros((2, len(first)))
    np.maximum.at(bounds[1], column, gain * [own.pressure_limit for own in arms.each])
    joints = np.repeat(column[:, None], arms.n_links, axis=1)
    return _Pieces(np.diff(times)[:, None], value, swing, lag, bounds, joints)


def _distinct(values: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Return the first of each set of equal columns, and the set of each column, shape (n_columns,)."""
    first: list[int] = []
    places = np.empty(values.shape[1], dtype=np.int64)
    for k in range(values.shape[1]):
        same = [i for i, one in enumerate(first) if np.array_equal(values[:, one], values[:, k])]
        places[k] = same[0] if same else len(first)
        if not same:
            first.append(k)
    return first, places


class _Judgement:
    """The choice of the intervals in which a smooth drive acts."""

    def __init__(
        self,
        times: np.ndarray,
        expected: np.ndarray,
        pieces: _Pieces,
        response: DriveResponse,
        accuracy: float,
    ) -> None:
        self._times, self._expected, self._pieces = times, expected, pieces
        self._response, self._accuracy = response, accuracy
        self._fit, self._parts = CurveFit(times), pieces.integrals()
        self._frequency = _frequencies(pieces.lengths[:, 0])

    def course(self, *, is_announced: bool) -> KnownCourse | None:
        """Return the course; None if no interval is smooth."""
        integral = self._fit.integral(self._parts)
        curve = self._curve(integral)
        difference = self._judged(curve)
        is_smooth = difference <= LARGEST_SHARE * self._accuracy
        is_smooth = _long_stretches(self._times, is_smooth & self._is_within_bounds(curve))
        if not is_smooth.any():
            return None
        curve = self._curve(integral + self._fit.integral(self._momentum_correction(integral, is_smooth)))
        n, rate = len(is_smooth), 2.0 * math.pi * self._frequency
        ends, largest, fastest = np.full(n + 1, math.inf), np.zeros(n + 1), np.zeros(n + 1)
        for begin, end in _runs(is_smooth):
            ends[begin:end] = self._times[end]
            if is_smooth[begin]:
                made = difference[begin:end]
                largest[begin:end], fastest[begin:end] = made.max(), (rate[begin:end] * made).max()
        return KnownCourse(
            tuple(self._times.tolist()),
            self._expected,
            curve,
            np.append(is_smooth, False),
            ends,
            largest,
            fastest,
            is_announced,
        )

    def _curve(self, integral: np.ndarray) -> DriveCurve:
        return DriveCurve(self._times, self._fit.derivative(integral), self._pieces.column)

    def _momentum_correction(self, integral: np.ndarray, is_smooth: np.ndarray) -> np.ndarray:
        """Return what each interval's integral has to gain, so that the sawtooth's integral has no mean [N m s].

        The sawtooth's integral is zero at the knots and on one side of zero between them. Its mean acts like a
        momentum that rises and falls with the slope of the course: dt^2 / 12 times the slope for a steady rate.
        """
        moment = self._pieces.first_moments() - self._fit.first_moment(integral)
        mean, h = moment / self._pieces.lengths, self._pieces.lengths
        at_knots = np.zeros((len(mean) + 1, mean.shape[1]))
        between = (mean[:-1] * h[1:] + mean[1:] * h[:-1]) / (h[:-1] + h[1:])
        # At the ends of a stretch the momentum is zero, as that of the sawtooth.
        at_knots[1:-1] = np.where((is_smooth[:-1] & is_smooth[1:])[:, None], between, 0.0)
        return np.diff(at_knots, axis=0)

    def _judged(self, curve: DriveCurve) -> np.ndarray:
        """Return the estimated difference of a node's position that the curve makes in each interval [m]."""
        n, enough = len(self._frequency), 0.1 * LARGEST_SHARE * self._accuracy
        each, largest = np.arange(n), np.zeros(n)
        for s in (0.0, 0.5, 1.0):
            gap = self._pieces.at(s) - curve.values(each, np.full(n, s))
            for frequency in np.unique(self._frequency):
                rows = self._frequency == frequency
                if frequency > 0.0:
                    moved = self._response.amplitudes(gap[rows], float(frequency), enough)
                    largest[rows] = np.maximum(largest[rows], moved)
        largest *= SAFETY * HARMONIC
        largest[self._frequency == 0.0] = math.inf
        return largest + self._roughness()

    def _roughness(self) -> np.ndarray:
        """Return what steps miss of the rough part of the course in each interval [m].

        The rough part is the fourth difference of five means, divided by what it makes of white noise of size 1.
        """
        middle = 0.5 * (self._times[:-1] + self._times[1:])
        window = np.arange(len(middle) - 4)[:, None] + np.arange(5)
        gaps = middle[window][:, :, None] - middle[window][:, None, :] + np.eye(5)
        weights = 1.0 / np.prod(gaps, axis=2)
        weights /= np.linalg.norm(weights, axis=1)[:, None]
        rough = np.einsum("nw,nwc->nc", weights, (self._parts / self._pieces.lengths)[window])
        frequency = RESOLVED * (1e-5 / self._accuracy) ** 0.25
        enough = 0.1 * LARGEST_SHARE * self._accuracy
        # Masses move as 1 / frequency^2, all else by less: what is known of a higher frequency often does.
        higher = self._frequency[self._frequency > 0.0].min(initial=math.inf)
        moved = np.full(len(rough), math.inf)
        if higher < math.inf:
            growth = max(higher / frequency, 1.0) ** 2
            moved = growth * self._response.amplitudes(rough, float(higher), enough)
        if moved.max() > enough:
            moved = self._response.amplitudes(rough, frequency, enough)
        moved *= ROUGHNESS
        around = np.zeros((5, len(middle)))
        for k in range(5):
            around[k, k : k + len(moved)] = moved
        return np.asarray(around.max(axis=0))

    def _is_within_bounds(self, curve: DriveCurve) -> np.ndarray:
        low, high = self._pieces.bounds
        each = np.arange(len(self._frequency))
        within = np.ones(len(each), dtype=bool)
        for s in (0.0, 0.25, 0.5, 0.75, 1.0):
            values = curve.values(each, np.full(len(each), s))
            within &= ((values >= low) & (values <= high)).all(axis=1)
        return within


def _frequencies(lengths: np.ndarray) -> np.ndarray:
    """Return the frequency of each interval's commands [Hz], that of the longest of like length; 0 for no rate."""
    group = np.round(LIKE * np.log2(lengths)).astype(int)
    result = np.zeros(len(lengths))
    for one in np.unique(group):
        rows = group == one
        longest = float(lengths[rows].max())
        if longest <= LONGEST_INTERVAL and np.count_nonzero(rows) >= FEWEST_INTERVALS // 2:
            result[rows] = 1.0 / longest
    return result


def _runs(values: np.ndarray) -> list[tuple[int, int]]:
    """Return begin and end of each run of equal values."""
    cuts = np.flatnonzero(np.diff(values)) + 1
    edges = [0, *cuts.tolist(), len(values)]
    return list(pairwise(edges))


def _long_stretches(times: np.ndarray, is_smooth: np.ndarray) -> np.ndarray:
    kept = is_smooth.copy()
    for begin, end in _runs(is_smooth):
        if times[end] - times[begin] < SHORTEST_STRETCH:
            kept[begin:end] = False
    return kept
