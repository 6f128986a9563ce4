"""Follower: the twin beside a rig; it gets the commands of the rig and predicts its points."""

from __future__ import annotations

from collections import deque

import numpy as np

from ldcs_ros.errors import BridgeError
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.twin.twin import Twin
from ldcs_ros.twin.warm_up import warm_up

_SMALLEST_CHANGE = (
    50.0  # Pa: smaller changes of a set-point are noise, each command costs the solver a restart
)
LONGEST_ADVANCE = 0.1
"""Simulated time of one call of `advance` [s]."""
_SHORTEST_PERIOD = 0.02  # s
_HISTORY = 400


class Follower:
    """A twin at the present, with the past positions of its points.

    Args:
        twin: The twin; its scene's arms are driven by pressure.

    Attributes:
        twin: The twin.
        squared_residual: Running mean of the squared distance between measured and predicted place, by point [m^2].
    """

    def __init__(self, twin: Twin) -> None:
        if twin.simulation.inputs.pressure is None:
            raise BridgeError(
                f"the scene {twin.scene.name!r} is not driven by pressure; give one whose arms have drive: pressure"
            )
        self.twin = twin
        self.squared_residual: dict[str, float] = {}
        warm_up(twin.scene, commanded=True)  # not while a gate waits for its next tick
        # A rig is at rest before its first command; so is its twin.
        self._sent = np.zeros(len(twin.simulation.arm_names))
        twin.receive("pressure_command", pressure_command(self._sent))
        twin.settle()
        arms = twin.simulation.model.arms
        self._limit = np.array([] if arms is None else [own.pressure_limit for own in arms.each])
        self._sent_at = -np.inf
        self._places: deque[tuple[float, dict[str, np.ndarray]]] = deque(maxlen=_HISTORY)
        self._remember()

    @property
    def pressure(self) -> np.ndarray:
        """Gauge pressure in each chamber as the twin has it [Pa], shape (n_arms,)."""
        pressure: np.ndarray = self.twin.simulation.state.pressure
        return pressure

    def command(self, pressure: np.ndarray) -> None:
        """Give the twin the set-points of the rig [Pa], shape (n_arms,), bounded to what its scene allows."""
        bounded = np.clip(pressure, 0.0, self._limit)
        time = self.twin.time
        if np.abs(bounded - self._sent).max() > _SMALLEST_CHANGE and time - self._sent_at >= _SHORTEST_PERIOD:
            self.twin.receive("pressure_command", pressure_command(bounded))
            self._sent, self._sent_at = bounded, time

    def advance(self, time: float) -> None:
        """Bring the twin to a time [s], or a part of the way on a machine that is too slow; raises DivergenceError.

        One call is bounded, so that a loop that is late once does not become later with every pass.
        """
        if time > self.twin.time:
            self.twin.advance_to(min(time, self.twin.time + LONGEST_ADVANCE))
            self._remember()

    def residual(self, point: str, time: float, measured: np.ndarray) -> np.ndarray | None:
        """Return measured minus predicted position of a point at a time [m], shape (3,); None if it is not known."""
        predicted = self._place(point, time)
        if predicted is None:
            return None
        residual: np.ndarray = measured - predicted
        square = float(residual @ residual)
        before = self.squared_residual.get(point, square)
        self.squared_residual[point] = before + 0.02 * (square - before)
        return residual

    def _remember(self) -> None:
        simulation = self.twin.simulation
        position = simulation.state.position
        places = {name: point.position(position) for name, point in simulation.points.items()}
        self._places.append((self.twin.time, places))

    def _place(self, point: str, time: float) -> np.ndarray | None:
        after = None
        for then, places in reversed(self._places):
            if point not in places:
                return None
            if then <= time:
                if after is None:
                    return np.array(places[point])
                fraction = (time - then) / (after[0] - then)
                return np.array((1.0 - fraction) * places[point] + fraction * after[1][point])
            after = (then, places)
        return None
