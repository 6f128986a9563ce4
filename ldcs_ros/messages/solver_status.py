"""What the twin says of itself in our own messages: the whole state, and how the solver is doing."""

from __future__ import annotations

import time as wall
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from ldcs_ros.messages.cdr import encode, header, message_class
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.state import State
from ldcs_ros.simulation.simulation import Simulation

PACE_PERIOD = 1.0
"""Wall time over which the real-time factor is measured [s]."""


def lattice_state(time_ns: int, frame: str, lattice: Lattice, arms: Sequence[str], state: State) -> bytes:
    """Return a LatticeState of a state in float64, in a frame; `arms` holds the names of the arms."""
    nx, ny = lattice.nodes
    return encode(
        message_class("ldcs_msgs/msg/LatticeState")(
            header=header(time_ns, frame),
            nodes_x=nx,
            nodes_y=ny,
            position=_flat(state.position),
            velocity=_flat(state.velocity),
            arms=list(arms),
            links=state.link_angle.shape[1] if arms else 0,
            link_angle=_flat(state.link_angle),
            link_rate=_flat(state.link_rate),
            pressure=_flat(state.pressure),
        )
    )


class SolverReport:
    """Builds `solver_status`, and measures the pace on a steady clock.

    Args:
        clock: Steady clock [s].
    """

    def __init__(self, clock: Callable[[], float] = wall.perf_counter) -> None:
        self._clock = clock
        self._seen: deque[tuple[float, float]] = deque()

    def restart(self) -> None:
        """Measure the pace anew, as after a pause."""
        self._seen.clear()

    def build(self, time_ns: int, simulation: Simulation, *, overruns: int, refused: int) -> bytes:
        """Return a SolverStatus of the present."""
        figures, step = simulation.statistics, simulation.last_step
        return encode(
            message_class("ldcs_msgs/msg/SolverStatus")(
                header=header(time_ns, ""),
                integrator=simulation.integrator.name,
                real_time_factor=self._real_time_factor(simulation.time),
                step=step.right.time - step.left.time,
                error_estimate=figures.error_estimate,
                wall_time=figures.wall_time,
                steps=figures.steps,
                rejected_steps=figures.rejected_steps,
                evaluations=figures.evaluations,
                factorisations=figures.factorisations,
                overruns=overruns,
                rejected_commands=refused,
            )
        )

    def _real_time_factor(self, time: float) -> float:
        now = self._clock()
        self._seen.append((now, time))
        while len(self._seen) > 2 and now - self._seen[1][0] >= PACE_PERIOD:
            self._seen.popleft()
        since, simulated = self._seen[0]
        return (time - simulated) / (now - since) if now > since else 0.0


def _flat(values: np.ndarray) -> np.ndarray:
    return np.ravel(np.asarray(values, dtype=np.float64))
