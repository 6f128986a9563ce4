"""Health of the bridge for the operator: one status for each part that can fail."""

from __future__ import annotations

import math

from ldcs_ros.messages.diagnostics import ERROR, OK, WARN, Status
from ldcs_ros.rig.bridge import Bridge
from ldcs_ros.rig.gate import GateState, Mode

_LATE = 0.1  # s: latency that is worth a warning


class Health:
    """The state of a bridge as diagnostics; counts in the messages are since the last reading.

    Args:
        bridge: The bridge.
    """

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge
        self._dropped: dict[str, int] = {}
        self._jumps: dict[str, int] = {}
        self._lost = 0

    def read(self) -> list[Status]:
        """Return all statuses and begin the next period."""
        bridge = self._bridge
        statuses = [self._gate(), self._links(), self._readings(), self._clock(), self._valves()]
        statuses.append(self._residuals())
        if bridge.estimator is not None:
            statuses.append(bridge.estimator.status())
        if bridge.failure:
            statuses.append(Status("twin", ERROR, bridge.failure))
        return statuses

    def _gate(self) -> Status:
        gate, limits = self._bridge.gate, self._bridge.rig.limits
        level, words = OK, f"{gate.mode.value}: commands nothing"
        if gate.state is GateState.DISARMED:
            level, words = OK, "live, not armed: call arm"
            if self._bridge.alarm():
                level, words = ERROR, self._bridge.alarm()
        elif gate.state is GateState.ARMED:
            level, words = OK, "live, armed"
        elif gate.state is GateState.VENTED:
            level, words = ERROR, f"vented: {gate.reason}; call arm after the repair"
            if self._bridge.alarm():
                words = f"{self._bridge.alarm()}; {words}"
        values: dict[str, object] = {"mode": gate.mode.value, "state": gate.state.value, "trips": gate.trips}
        for arm, setpoint, limit in zip(limits.arms, gate.setpoint, limits.highest, strict=True):
            values[f"set-point {arm} [Pa]"] = setpoint
            values[f"limit {arm} [Pa]"] = limit
        values["accepted"] = gate.accepted
        values["refused"] = sum(gate.refused.values())
        values["last refusal"] = gate.last_refusal or "none"
        values["clipped by the output stage"] = sum(link.status.clipped for link in self._bridge.links)
        return Status("gate", level, words, values)

    def _links(self) -> Status:
        links = self._bridge.links
        broken = [f"{link.name}: {link.error}" for link in links if not link.connected]
        drops = sum(link.drops for link in links)
        lost, self._lost = drops - self._lost, drops
        values: dict[str, object] = {}
        for link in links:
            values[f"{link.name} connected"] = link.connected
            values[f"{link.name} drops"] = link.drops
            values[f"{link.name} malformed"] = link.malformed
            values[f"{link.name} heartbeats sent"] = link.heartbeats
            values[f"{link.name} writes refused"] = link.status.refusals
            values[f"{link.name} output processes lost"] = link.replaced
        if broken:
            return Status("links", ERROR, "; ".join(broken), values)
        if lost:
            return Status("links", WARN, f"a connection was lost {lost} times and is back", values)
        return Status("links", OK, "connected", values)

    def _readings(self) -> Status:
        bridge, validator = self._bridge, self._bridge.validator
        now = bridge.now()
        silence = validator.silence(now, "pressure")
        new = {reason: count - self._dropped.get(reason, 0) for reason, count in validator.dropped.items()}
        new = {reason: count for reason, count in new.items() if count}
        self._dropped = dict(validator.dropped)
        values: dict[str, object] = {"accepted": validator.accepted, "age of pressures [s]": silence}
        values |= {f"dropped, {reason}": count for reason, count in sorted(validator.dropped.items())}
        for arm, pressure in bridge.measured.items():
            values[f"measured {arm} [Pa]"] = pressure
        dropped = ", ".join(f"{count} {reason}" for reason, count in new.items())
        detail = f"dropped {dropped} (last: {validator.last_drop})" if dropped else ""
        words = validator.staleness(now, "pressure", bridge.rig.limits.rig_timeout)
        if words:
            return Status("readings", ERROR, f"{words}; {detail}" if detail else words, values)
        if detail:
            return Status("readings", WARN, detail, values)
        return Status("readings", OK, "sound", values)

    def _clock(self) -> Status:
        values: dict[str, object] = {}
        jumped, late = [], []
        for source, clock in self._bridge.validator.clocks.items():
            if clock.offset is None:
                continue
            worst = clock.take_worst_latency()
            values[f"{source} offset [s]"] = clock.offset
            values[f"{source} latency [s]"] = clock.latency
            values[f"{source} worst latency [s]"] = worst
            values[f"{source} jumps"] = clock.jumps
            if clock.jumps > self._jumps.get(source, 0):
                jumped.append(f"the clock of {source} jumped by {clock.last_jump:+.2f} s")
            self._jumps[source] = clock.jumps
            if worst > _LATE:
                late.append(f"{source} up to {worst:.2f} s late")
        if jumped or late:
            return Status("clocks", WARN, "; ".join(jumped + late), values)
        return Status("clocks", OK, "steady" if values else "the rig sends no stamps", values)

    def _valves(self) -> Status:
        valves = self._bridge.valve_monitor
        values = {f"deviation {arm} [Pa]": value for arm, value in valves.deviation.items()}
        if valves.faults:
            words = "; ".join(f"{arm} {fault}" for arm, fault in valves.faults.items())
            return Status("valves", ERROR, words, values)
        return Status("valves", OK, "pressures follow their set-points" if values else "not compared", values)

    def _residuals(self) -> Status:
        squares = self._bridge.follower.squared_residual
        values = {f"{point} [mm]": 1e3 * math.sqrt(square) for point, square in squares.items()}
        if not values:
            return Status("residuals", OK, "no positions measured")
        words = ", ".join(f"{point} {values[f'{point} [mm]']:.2f} mm" for point in squares)
        return Status("residuals", OK, f"twin against rig: {words}", values)


def headline(bridge: Bridge) -> str:
    """Return mode, pressures and residuals in one line for a terminal."""
    kilopascals = " ".join(
        f"{arm} {bridge.measured[arm] / 1e3:6.1f} kPa"
        for arm in bridge.rig.limits.arms
        if arm in bridge.measured
    )
    residuals = " ".join(
        f"{point} {1e3 * math.sqrt(square):5.2f} mm"
        for point, square in bridge.follower.squared_residual.items()
    )
    state = bridge.gate.state.value if bridge.mode is Mode.LIVE else "listening"
    if bridge.gate.state is GateState.VENTED:
        state = f"vented, call arm ({bridge.gate.reason})"
    return f"t {bridge.twin.time:8.2f} s | {bridge.mode.value}, {state} | {kilopascals} | off by {residuals}"
