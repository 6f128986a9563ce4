"""Health of the twin and its solver: entries as data, DiagnosticArray, SolverStatus."""

from __future__ import annotations

import time as wall
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from ldcs_ros.messages.cdr import encode, header, message_class
from ldcs_ros.simulation.simulation import Simulation

PACE_PERIOD = 1.0
"""Wall time over which the real-time factor is measured [s]."""
OK, WARN, ERROR = 0, 1, 2


@dataclass(frozen=True)
class Status:
    """One entry of the diagnostics.

    Attributes:
        name: Its subject, one or two words.
        level: OK, WARN or ERROR.
        message: The state in a few words.
        values: Numbers and words by name, unit in the name.
    """

    name: str
    level: int
    message: str
    values: Mapping[str, object] = field(default_factory=dict)


def diagnostic_array(time_ns: int, owner: str, statuses: Iterable[Status]) -> bytes:
    """Return a DiagnosticArray; `owner` (a node's full name) precedes each name."""
    key_value = message_class("diagnostic_msgs/msg/KeyValue")
    status_message = message_class("diagnostic_msgs/msg/DiagnosticStatus")
    array = message_class("diagnostic_msgs/msg/DiagnosticArray")
    entries = [
        status_message(
            level=status.level,
            name=f"{owner}: {status.name}",
            message=status.message,
            hardware_id="ldcs",
            values=[key_value(key=key, value=_text(value)) for key, value in status.values.items()],
        )
        for status in statuses
    ]
    return encode(array(header=header(time_ns, ""), status=entries))


class SolverReport:
    """Builds `solver_status`, and measures the pace on a steady clock.

    Args:
        clock: Steady clock [s].
    """

    def __init__(self, clock: Callable[[], float] = wall.perf_counter) -> None:
        self._clock = clock
        self._seen: deque[tuple[float, float]] = deque()

    def restart(self) -> None:
        """Restart the measurement of the pace, as after a pause."""
        self._seen.clear()

    def build(self, time_ns: int, simulation: Simulation, *, overruns: int, refused: int) -> bytes:
        """Return a SolverStatus of the present."""
        specs, step = simulation.statistics, simulation.last_step
        return encode(
            message_class("ldcs_msgs/msg/SolverStatus")(
                header=header(time_ns, ""),
                integrator=simulation.integrator.name,
                real_time_factor=self._real_time_factor(simulation.time),
                step=step.right.time - step.left.time,
                error_estimate=specs.error_estimate,
                wall_time=specs.wall_time,
                steps=specs.steps,
                rejected_steps=specs.rejected_steps,
                evaluations=specs.evaluations,
                factorisations=specs.factorisations,
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


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
