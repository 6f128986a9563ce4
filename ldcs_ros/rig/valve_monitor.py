"""The valve monitor: stuck valves, leaks and chambers that keep pressure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

_LONGEST_GAP = 0.5  # s: after longer silence it starts again


@dataclass
class _Arm:
    since: float | None = None
    last: float = 0.0
    measured: tuple[float, float] = (0.0, 0.0)
    expected: tuple[float, float] = (0.0, 0.0)


class ValveMonitor:
    """A comparison of measured pressures with those that a sound valve would give.

    A deviation beyond the tolerance that lasts longer than the patience is a fault. Over that time, a
    measured pressure that hardly moves while the expected one does means a stuck valve, one that is too low a leak;
    one that is too high does not vent.

    Args:
        tolerance: Deviation that is still sound, by arm [Pa].
        patience: Time for which it may be larger [s].

    Attributes:
        faults: Present faults by arm, in words.
        deviation: Present measured minus expected pressure by arm [Pa].
    """

    def __init__(self, *, tolerance: Mapping[str, float], patience: float) -> None:
        self.tolerance, self.patience = tolerance, patience
        self.faults: dict[str, str] = {}
        self.deviation: dict[str, float] = {}
        self._arms: dict[str, _Arm] = {}

    def take(self, arm: str, time: float, measured: float, expected: float) -> None:
        """Take a measured and an expected gauge pressure [Pa] of an arm at a steady time [s]."""
        state, tolerance = self._arms.setdefault(arm, _Arm()), self.tolerance[arm]
        self.deviation[arm] = measured - expected
        if abs(measured - expected) <= tolerance or time - state.last > _LONGEST_GAP:
            state.since = None
            self.faults.pop(arm, None)
        state.last = time
        if abs(measured - expected) <= tolerance:
            return
        if state.since is None:
            state.since = time
            state.measured, state.expected = (measured, measured), (expected, expected)
        state.measured = (min(state.measured[0], measured), max(state.measured[1], measured))
        state.expected = (min(state.expected[0], expected), max(state.expected[1], expected))
        if time - state.since > self.patience:
            self.faults[arm] = self._judge(state, tolerance, measured, expected)

    def _judge(self, state: _Arm, tolerance: float, measured: float, expected: float) -> str:
        moved, asked = state.measured[1] - state.measured[0], state.expected[1] - state.expected[0]
        numbers = f"measured {measured / 1e3:.1f} kPa, expected {expected / 1e3:.1f} kPa"
        if asked > tolerance and moved < 0.1 * asked:
            return f"does not move: stuck valve? ({numbers})"
        if measured < expected:
            return f"too low: leak or stuck valve? ({numbers})"
        return f"too high: does not vent? ({numbers})"
