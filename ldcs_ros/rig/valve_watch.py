"""Watches whether measured pressures follow their set-points: stuck valve, leak, a chamber that keeps pressure."""

from __future__ import annotations

from dataclasses import dataclass

_LONGEST_GAP = 0.5  # s: after longer silence it starts over


@dataclass
class _Arm:
    since: float | None = None
    last: float = 0.0
    measured: tuple[float, float] = (0.0, 0.0)
    called: tuple[float, float] = (0.0, 0.0)


class ValveWatch:
    """Compares measured pressures with what their set-points call for through a sound valve.

    A deviation beyond the tolerance that lasts longer than the patience is a fault. Over that time, a
    pressure that hardly moved while the one called for did is a stuck valve; one that is too low is a leak;
    one that is too high does not vent.

    Args:
        tolerance: Deviation that is still sound [Pa].
        patience: How long it may be larger [s].

    Attributes:
        faults: What is wrong now, by arm, in words.
        deviation: Present measured minus called-for pressure by arm [Pa].
    """

    def __init__(self, *, tolerance: float, patience: float) -> None:
        self.tolerance, self.patience = tolerance, patience
        self.faults: dict[str, str] = {}
        self.deviation: dict[str, float] = {}
        self._arms: dict[str, _Arm] = {}

    def take(self, arm: str, time: float, measured: float, called: float) -> None:
        """Take a measured and a called-for gauge pressure [Pa] of an arm at a steady time [s]."""
        state = self._arms.setdefault(arm, _Arm())
        self.deviation[arm] = measured - called
        if abs(measured - called) <= self.tolerance or time - state.last > _LONGEST_GAP:
            state.since = None
            self.faults.pop(arm, None)
        state.last = time
        if abs(measured - called) <= self.tolerance:
            return
        if state.since is None:
            state.since = time
            state.measured, state.called = (measured, measured), (called, called)
        state.measured = (min(state.measured[0], measured), max(state.measured[1], measured))
        state.called = (min(state.called[0], called), max(state.called[1], called))
        if time - state.since > self.patience:
            self.faults[arm] = self._judge(state, measured, called)

    def _judge(self, state: _Arm, measured: float, called: float) -> str:
        moved, asked = state.measured[1] - state.measured[0], state.called[1] - state.called[0]
        numbers = f"measured {measured / 1e3:.1f} kPa, called for {called / 1e3:.1f} kPa"
        if asked > self.tolerance and moved < 0.1 * asked:
            return f"does not move: stuck valve? ({numbers})"
        if measured < called:
            return f"too low: leak or stuck valve? ({numbers})"
        return f"too high: does not vent? ({numbers})"
