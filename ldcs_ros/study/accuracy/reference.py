"""The independent reference: SciPy's Radau or DOP853 from event to event on independent equations; kept on disk."""

from __future__ import annotations

import hashlib
import json
import math
import time as wall_clock
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import DOP853, Radau
from scipy.optimize._numdiff import group_columns
from scipy.sparse import csc_matrix

from ldcs_ros.scene.load import load_scene
from ldcs_ros.study.accuracy.equations import Equations, chamber
from ldcs_ros.study.accuracy.random_scenes import Case

if TYPE_CHECKING:
    from ldcs_ros.physics.effects.arms import Arms
    from ldcs_ros.scene.scene import Scene

Slope = Callable[[float, np.ndarray], np.ndarray]

# Relative tolerance; the absolute ones are fractions of it.
TOLERANCE, POSITION_FRACTION, RATE_FRACTION = 1e-9, 1e-2, 1.0
# Free coordinates from which Radau's Jacobian is sparse.
SPARSE_SIZE = 30
EQUILIBRIUM_ITERATIONS = 12
JACOBIAN_STEPS = 6
POSITION_STEP, RATE_STEP = 1e-7, 1e-3  # m or rad, m/s or rad/s
CACHE = Path("out/references")
FORMAT = 1


class TooSlow(Exception):
    """A reference that takes longer than its time."""


def start_velocity(case: Case, rest: np.ndarray) -> np.ndarray | None:
    """Return the node velocities at a case's start [m/s], shape (n_nodes, 3), or None for a sheet at rest."""
    if not np.any(case.spin) and not np.any(case.drift):
        return None
    centre = rest.mean(axis=0)
    return np.asarray(np.array(case.drift) + np.cross(np.array(case.spin), rest - centre))


def reference(
    case: Case, *, cache: Path = CACHE, seconds: float = 60.0, tolerance: float = TOLERANCE
) -> np.ndarray:
    """Return the positions of all nodes at the looks of a case [m], shape (looks, n_nodes, 3); raises as below."""
    return _course(case, cache, seconds, tolerance, "positions")["positions"]


def reference_motion(
    case: Case, *, cache: Path = CACHE, seconds: float = 60.0, tolerance: float = TOLERANCE
) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates [m, rad] and rates [m/s, rad/s] at the looks of a case, both (looks, n_coordinates).

    Raises:
        TooSlow: The reference takes longer than `seconds` of computing.
    """
    course = _course(case, cache, seconds, tolerance, "rates")
    return course["coordinates"], course["rates"]


def _course(case: Case, cache: Path, seconds: float, tolerance: float, wanted: str) -> dict[str, np.ndarray]:
    # What is stored of a case if `wanted` is among it, or what is computed and stored now.
    start = [case.start] if case.start else []
    key = json.dumps(
        [FORMAT, case.content, case.duration, case.spin, case.drift, case.looks, tolerance, *start],
        sort_keys=True,
        default=float,
    )
    path = cache / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.npz"
    if path.exists():
        with np.load(path) as stored:
            if wanted in stored:
                return dict(stored)
            if "too_slow" in stored and float(stored["too_slow"]) >= seconds:
                raise TooSlow(case.name)
    cache.mkdir(parents=True, exist_ok=True)
    try:
        q, u = _solve(case, seconds, tolerance)
    except TooSlow:
        np.savez(path, too_slow=seconds)
        raise
    positions = q[:, : 3 * load_scene(case.content).lattice.n_nodes].reshape(len(q), -1, 3)
    np.savez_compressed(path, positions=positions, coordinates=q, rates=u)
    return {"positions": positions, "coordinates": q, "rates": u}


def looks_of(case: Case) -> np.ndarray:
    """Return the times at which a case is looked at [s]."""
    return np.linspace(0.0, case.duration, case.looks + 1)[1:]


def _solve(case: Case, seconds: float, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    scene = load_scene(case.content)
    equations = Equations(scene)
    free, n = equations.free, len(equations.free)
    q, u = equations.begin()
    nodes = free[free < 3 * equations.n]
    if case.start:
        q[nodes] = np.ravel(case.start)[nodes]
    velocity = start_velocity(case, np.array(case.start) if case.start else equations.rest)
    if velocity is not None:
        u[nodes] = velocity.ravel()[nodes]
    events = _events(scene, equations, case.duration)
    pattern = equations.pattern() if n >= SPARSE_SIZE else None
    looks = looks_of(case)
    course = np.empty((2, len(looks), equations.n_coordinates))
    y = np.concatenate([q[free], u[free]])
    deadline = wall_clock.process_time() + seconds

    def place(t: float, y: np.ndarray) -> None:
        equations.prescribe(t, q, u)
        q[free], u[free] = y[:n], y[n:]

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        place(t, y)
        return np.concatenate([y[n:], equations.accelerations(t, q, u)[free]])

    for index, (begin, act) in enumerate(events):
        act()
        end = events[index + 1][0] if index + 1 < len(events) else case.duration
        if end <= begin:
            continue
        method = Radau if _is_stiff(slope, begin, y, n) else DOP853
        atol = tolerance * np.repeat([POSITION_FRACTION, RATE_FRACTION], n)
        first = min(1e-6, 0.1 * (end - begin))
        sparse = {"jac": _KeptJacobian(slope, pattern)} if method is Radau and pattern is not None else {}
        solver = method(slope, begin, y, end, rtol=tolerance, atol=atol, first_step=first, **sparse)
        while solver.status == "running":
            if wall_clock.process_time() > deadline:
                raise TooSlow(case.name)
            message = solver.step()
            if solver.status == "failed":
                raise ArithmeticError(f"the reference of {case.name} failed: {message}")
            curve = None
            for k in np.flatnonzero((looks > solver.t_old + 1e-12) & (looks <= solver.t + 1e-12)):
                curve = curve or solver.dense_output()
                place(looks[k], curve(min(looks[k], solver.t)))
                course[:, k] = q, u
        y = solver.y
    return course[0], course[1]


def equilibrium(case: Case, position: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the node positions without acceleration nearest to a state [m], shape (n_nodes, 3), for the last commands.

    Args:
        case: The case.
        position: Node positions to start from [m], shape (n_nodes, 3).
        angles: Link angles to start from [rad], shape (n_arms, n_links).

    Raises:
        ArithmeticError: Newton's iteration does not converge.
    """
    scene = load_scene(case.content)
    equations = Equations(scene)
    free, nodes = equations.free, 3 * equations.n
    for _, act in _events(scene, equations, case.duration):
        act()
    q, u = equations.begin()
    # Nodes of holes have no position.
    here = np.concatenate([np.where(np.isfinite(position), position, equations.rest).ravel(), angles.ravel()])
    q[free] = here[free]
    equations.prescribe(case.duration, q, u)
    u[:] = 0.0

    def acceleration(x: np.ndarray) -> np.ndarray:
        q[free] = x
        return np.asarray(equations.accelerations(case.duration, q, u)[free])

    x = q[free].copy()
    for _ in range(EQUILIBRIUM_ITERATIONS):
        moves = POSITION_STEP * np.eye(len(x))
        slope = np.array([acceleration(x + move) - acceleration(x - move) for move in moves]).T
        move = np.linalg.lstsq(slope / (2.0 * POSITION_STEP), -acceleration(x), rcond=None)[0]
        x += move
        if np.abs(move).max() < 1e-9:
            q[free] = x
            return q[:nodes].reshape(-1, 3)
    raise ArithmeticError(f"{case.name}: Newton's iteration on the independent equations does not converge")


class _KeptJacobian:
    # Central differences, those of columns without a common row at once. SciPy's own steps are fractions of each
    # value: too small where a coordinate or a rate is nearly 0. Radau asks for a Jacobian after almost each step; a
    # kept one changes the number of its iterations only. It asks again at the same time where they do not converge.

    def __init__(self, slope: Slope, pattern: csc_matrix) -> None:
        self.slope, self.pattern = slope, pattern
        self.rows, columns = pattern.nonzero()
        self.columns, self.group = columns, group_columns(pattern)
        self.size = np.repeat([POSITION_STEP, RATE_STEP], pattern.shape[1] // 2)
        self.time, self.age, self.kept = math.nan, 0, pattern

    def __call__(self, t: float, y: np.ndarray) -> csc_matrix:
        self.age += 1
        if t == self.time or self.age > JACOBIAN_STEPS or self.kept is self.pattern:
            self.age, self.kept = 0, self._differences(t, y)
        self.time = t
        return self.kept

    def _differences(self, t: float, y: np.ndarray) -> csc_matrix:
        values = np.empty(len(self.rows))
        for group in range(self.group.max() + 1):
            move = np.where(self.group == group, self.size, 0.0)
            change = self.slope(t, y + move) - self.slope(t, y - move)
            here = self.group[self.columns] == group
            values[here] = change[self.rows[here]] / (2.0 * self.size[self.columns[here]])
        return csc_matrix((values, (self.rows, self.columns)), shape=self.pattern.shape)


def _is_stiff(slope: Slope, t: float, y: np.ndarray, n: int) -> bool:
    # Largest decay rate of the rates alone: an explicit method pays for it in every step.
    rng, rate = np.random.default_rng(1), 0.0
    base, w = slope(t, y), rng.normal(size=n)
    for _ in range(15):
        w /= np.linalg.norm(w)
        moved = y.copy()
        moved[n:] += 1e-6 * w
        change = (slope(t, moved) - base)[n:] / 1e-6
        rate, w = float(np.linalg.norm(change)), change
        if rate == 0.0:
            return False
    return rate > 3000.0


Event = tuple[float, Callable[[], None]]


class _Chambers:
    # The pressure of the arms since the valves last answered.

    def __init__(self, arms: Sequence[Arms]) -> None:
        self.start, self.begin, self.target = 0.0, np.zeros(len(arms)), np.zeros(len(arms))
        self.fill, self.vent = (
            np.array([getattr(one, f"{name}_time") for one in arms]) for name in ("fill", "vent")
        )

    def at(self, time: float) -> np.ndarray:
        taus = np.where(self.target > self.begin, self.fill, self.vent)
        values = zip(self.begin, self.target, taus, strict=True)
        return np.array([chamber(time, self.start, *map(float, value)) for value in values])

    def answer(self, time: float, target: np.ndarray) -> None:
        self.begin, self.target, self.start = self.at(time), target, time


def _events(scene: Scene, equations: Equations, duration: float) -> list[Event]:
    # Times at which the right side jumps, each with what happens then.
    effects: list[Any] = list(scene.effects)
    events: list[Event] = [(0.0, lambda: None)]
    for effect in effects:
        driven = effect.name == "driven_edges" or getattr(effect, "drive", "") == "curvature"
        if driven and effect.rise_time < duration:
            events.append((effect.rise_time, lambda: None))
    arms: Arms | None = equations.effects.get("arms")
    chains = equations.chains
    chambers = None if chains is None else _Chambers(chains.own)
    if arms is not None and chambers is not None and arms.drive == "pressure":
        equations.pressure = chambers.at
    for command in scene.inputs:
        t = command.time
        if command.torque is not None and chains is not None:
            given = np.array(command.torque, dtype=float).reshape(-1, 1)
            torque = np.where(chains.used, np.broadcast_to(given, chains.used.shape), 0.0)
            events.append((t, partial(setattr, equations, "held", torque)))
        if command.pressure is not None and arms is not None and chambers is not None:
            target = np.broadcast_to(np.array(command.pressure, dtype=float), chambers.target.shape)
            later = t + arms.dead_time
            events.append((later, partial(chambers.answer, later, target)))
        if command.wrench is not None:
            frame, force, moment = command.wrench
            held = {frame: (np.array(force), np.array(moment))}
            events.append((t, partial(equations.wrenches.update, held)))
    return sorted((event for event in events if event[0] < duration), key=lambda event: event[0])
