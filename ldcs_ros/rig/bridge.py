"""Bridge: links, validator, gate and the twin beside the rig, in one pass that a thread repeats."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ldcs_ros.errors import BridgeError, DivergenceError
from ldcs_ros.rig.follower import Follower
from ldcs_ros.rig.gate import Gate, GateState, Mode
from ldcs_ros.rig.link import Link
from ldcs_ros.rig.output.monitor import EMPTY
from ldcs_ros.rig.reading import RawReading
from ldcs_ros.rig.reading_validator import Reading, ReadingValidator
from ldcs_ros.rig.rig_bag import RigBag
from ldcs_ros.rig.rig_file import RigFile
from ldcs_ros.rig.rig_report import RigReport
from ldcs_ros.rig.state_estimator import StateEstimator
from ldcs_ros.rig.topics import bridge_topics
from ldcs_ros.rig.valve_monitor import ValveMonitor
from ldcs_ros.scene.scene import Scene
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin

_TOLERANCE = 0.08  # fraction of the largest pressure by which a sound valve may be off


LONGEST_LAG = 1.0
"""Time by which the twin may be late while the rig is armed [s]."""


class Bridge:
    """Runs beside a rig; commands it only in mode live, armed, within limits, while everything is sound.

    Args:
        scene: Scene of the twin; its arms are driven by pressure.
        rig: The rig.
        mode: Mode of the bridge.
        clock: Steady clock [s].
        settings: Settings of the twin's run.
        links: Links to the rig; None for those of the rig file.

    Attributes:
        twin: The twin; its time counts from the bridge's start.
        gate: The gate for commands.
        validator: Checks and counts of the readings.
        links: The links.
        valve_monitor: Comparison of measured with expected pressures.
        follower: The twin's runner.
        estimator: The estimator, in mode mirror.
        bag: Bag of the rig's side; None for none.
        failure: Reason why the twin stopped; '' while it runs. Links and gate work on without it.
        unvented: Arms that may hold pressure after the end, in words; '' for none.
    """

    def __init__(
        self,
        scene: Scene,
        rig: RigFile,
        *,
        mode: Mode,
        clock: Callable[[], float],
        settings: RunSettings | None = None,
        links: list[Link] | None = None,
    ) -> None:
        self.rig, self.mode = rig, mode
        self._clock = clock
        self.twin = Twin(scene.without_schedule(), settings, diagnostics=False)
        self.follower = Follower(self.twin)
        arms, points = self.twin.simulation.arm_names, tuple(self.twin.simulation.points)
        self._check_arms(arms)
        self.twin.topics |= bridge_topics(points, arms, estimate=mode is Mode.MIRROR)
        self.estimator = StateEstimator(self.twin) if mode is Mode.MIRROR else None
        commands = mode is Mode.LIVE
        self.links: list[Link] = rig.connect(clock, commands=commands) if links is None else links
        self.start_time = clock()
        self.gate = Gate(mode, rig.limits, clock)
        self.validator = ReadingValidator(4.0 * max(rig.limits.highest), self.start_time)
        for link in self.links:
            if link.clock_estimate is not None:
                self.validator.clocks[link.name] = link.clock_estimate
        patience = rig.limits.command_timeout
        tolerance = {arm: _TOLERANCE * rig.limits.of(arm) for arm in arms}
        self.valve_monitor = ValveMonitor(tolerance=tolerance, patience=patience)
        self._report = RigReport(self.twin)
        self.bag: RigBag | None = None
        self.failure = ""
        self.unvented = ""
        self.measured: dict[str, float] = {}
        self._valid_readings: list[Reading] = []
        self._setpoints: dict[str, float] = {}

    def start(self) -> None:
        """Let time begin, and the links."""
        for link in self.links:
            link.start()
        for link in self.links:
            link.wait_until_ready()
        self.start_time = self._clock()
        self.validator.restart(self.start_time)

    def stop(self) -> None:
        """Vent in mode live, wait until the rig has confirmed zero, and disconnect; `unvented` says what is left."""
        self.gate.disarm("the bridge ends")
        if self.estimator is not None:
            self.estimator.close()
        self.unvented = "; ".join(filter(None, [link.stop() for link in self.links]))
        if self.bag is not None:
            self._record_packets()
            self.bag.close()

    def protect(self) -> None:
        """Take the readings, judge them, and hand on set-points or a vent; this part waits for no simulation."""
        now = self._clock()
        for link in self.links:
            link.check()
        self._valid_readings += [
            reading for reading in map(self.validator.validate, self._readings()) if reading is not None
        ]
        for reading in self._valid_readings:
            self._note(reading)
        self._guard(now)
        self._set_setpoints()

    def follow(self) -> None:
        """Bring the twin to the present, report and record."""
        readings, self._valid_readings = self._valid_readings, []
        self._follow(self._clock(), readings)
        self._record_packets()

    def step(self) -> None:
        """Do one pass: protect, then follow."""
        self.protect()
        self.follow()

    def command(self, pressure: Sequence[float] | np.ndarray, heard: float | None = None) -> None:
        """Take an operator's command [Pa], shape (n_arms,), heard at a steady time [s].

        Raises:
            BridgeError: The command is refused.
        """
        self.gate.command(pressure, heard)

    def arm(self) -> None:
        """Let commands through from now; raises BridgeError with each precondition that does not hold."""
        self.gate.arm(self.preconditions())

    def preconditions(self) -> list[str]:
        """Return the preconditions of arming that do not hold, in words."""
        limits, now = self.rig.limits, self._clock()
        found = [f"{link.name}: {link.error}" for link in self.links if not link.connected]
        if not self.rig.takes_setpoints:
            found.append("no link of the rig file takes set-points")
        stale = self._staleness(now)
        if stale:
            found.append(stale)
        for arm in self.twin.simulation.arm_names:
            if arm not in self.measured:
                found.append(f"no pressure of {arm} has been measured yet")
        if self.failure:
            found.append(f"the twin stopped: {self.failure}")
        found += filter(None, [self._lag(now)])
        full = {arm: value for arm, value in self.measured.items() if value > EMPTY * limits.of(arm)}
        found += [
            f"{arm} holds {value / 1e3:.1f} kPa; call disarm, which vents it" for arm, value in full.items()
        ]
        if not full and self.holding():
            found.append(f"{self.holding()}; call disarm, which vents it")
        found += [f"{arm} {fault}" for arm, fault in self.valve_monitor.faults.items()]
        return found

    def holding(self) -> str:
        """Return the arms that hold pressure or work to a set-point, as the link that commands reports; '' for none."""
        return ", ".join(filter(None, (link.status.holding for link in self.links if link.commands)))

    def alarm(self) -> str:
        """Return the alarm beside trips, in words; '' for none.

        It is a rig that holds pressure before the first arming, or a vent without a confirmed zero in time.
        """
        gate, limits = self.gate, self.rig.limits
        if gate.state is GateState.DISARMED and self.holding():
            return f"{self.holding()} before the first arming: call disarm, which vents"
        vented_for = gate.venting_for
        if gate.state is not GateState.VENTED or vented_for is None or vented_for < limits.vent_time:
            return ""
        full = [arm for arm, value in self.measured.items() if value > 0.1 * limits.of(arm)]
        if full:
            return f"{', '.join(full)} still holds pressure: cut the supply"
        missing = [link for link in self.links if link.commands and not link.status.zero_confirmed]
        if missing and vented_for > limits.command_timeout + limits.vent_time:
            why = missing[0].error or missing[0].status.holding or "no read-back of zero"
            return f"the rig has not confirmed a set-point of zero ({why}): cut the supply"
        return ""

    def now(self) -> float:
        """Return the steady time [s]."""
        return self._clock()

    def time_of(self, moment: float) -> float:
        """Return a steady time on the twin's time axis [s]."""
        return moment - self.start_time

    def _check_arms(self, arms: tuple[str, ...]) -> None:
        """Check that the rig file names the scene's arms: a vent without a scene must reach each of them."""
        named = self.rig.limits.arms
        if named != arms:
            scene = f"those of the scene {self.twin.scene.name!r} in their order: [{', '.join(arms)}]"
            raise BridgeError(f"got [{', '.join(named)}], expected {scene} @ arms of the rig file")

    def _readings(self) -> list[RawReading]:
        return [reading for link in self.links for reading in link.take_readings()]

    def _note(self, reading: Reading) -> None:
        if reading.kind == "pressure":
            self.measured[reading.name] = float(reading.value)
        elif reading.kind == "pressure_command":
            self._setpoints[reading.name] = float(reading.value)

    def _guard(self, now: float) -> None:
        """Vent on a fault that commands cannot repair."""
        if self.gate.state is not GateState.ARMED:
            return
        for link in self.links:
            if not link.connected:
                self.gate.trip(f"{link.name}: {link.error}")
        stale = self._staleness(now)
        if stale:
            self.gate.trip(stale)
        for link in self.links:
            # The stage vents set-points of an earlier arming too: only the present epoch is a fault.
            if link.vented_because and link.status.epoch >= self.gate.epoch:
                self.gate.trip(link.vented_because)
        for arm, fault in self.valve_monitor.faults.items():
            self.gate.trip(f"{arm} {fault}")
        lag = self._lag(now)
        if lag:
            self.gate.trip(lag)
        if self.failure:
            # Only the twin distinguishes a sound valve from a stuck one.
            self.gate.trip(f"the twin stopped: {self.failure}")

    def _lag(self, now: float) -> str:
        """Return the delay of the twin that is too large to judge valves, in words; '' for none."""
        lag = self.time_of(now) - self.twin.time
        if lag <= LONGEST_LAG:
            return ""
        return f"the twin is {lag:.1f} s late: the machine is too slow to judge the valves"

    def _staleness(self, now: float) -> str:
        return self.validator.staleness(now, "pressure", self.rig.limits.rig_timeout)

    def _set_setpoints(self) -> None:
        setpoint = self.gate.tick()
        if setpoint is None:
            return
        for link in self.links:
            if self.gate.state is GateState.ARMED:
                link.send(setpoint, self.gate.epoch)
            else:
                link.vent(self.gate.reason, self.gate.epoch)

    def _follow(self, now: float, readings: list[Reading]) -> None:
        if self.failure:
            return
        try:
            self.follower.command(self._expected_pressure())
            self.follower.advance(self.time_of(now))
        except DivergenceError as error:
            self.failure = str(error)
            return
        for reading in readings:
            time = self.time_of(reading.time)
            self._report.reading(reading, time)
            if self.bag is not None:
                self.bag.reading(reading, time, self.time_of(reading.received))
            if reading.kind == "position":
                residual = self.follower.residual(reading.name, time, reading.value)
                if residual is not None:
                    self._report.residual(reading.name, time, residual)
            elif reading.kind == "pressure":
                self._monitor_valve(reading.name, now)
        if self.estimator is not None:
            self.estimator.take([(reading, self.time_of(reading.time)) for reading in readings])
            self.estimator.report(self.time_of(now))

    def _expected_pressure(self) -> np.ndarray:
        """Return the pressures for the twin [Pa]: the rig's set-points, else the gate's, else the measured ones."""
        arms = self.twin.simulation.arm_names
        if self._setpoints:
            source: dict[str, float] = self._setpoints
        elif self.mode is Mode.LIVE:
            source = dict(zip(arms, self.gate.setpoint, strict=True))
        else:
            source = self.measured
        return np.array([source.get(arm, 0.0) for arm in arms])

    def _monitor_valve(self, arm: str, now: float) -> None:
        # Without set-points of the rig the twin follows the measurement itself: nothing to compare.
        if self._setpoints or self.mode is Mode.LIVE:
            expected = float(self.follower.pressure[self.twin.simulation.arm_names.index(arm)])
            self.valve_monitor.take(arm, now, self.measured[arm], expected)

    def _record_packets(self) -> None:
        packets = [packet for link in self.links for packet in link.take_packets()]
        if self.bag is not None:
            for packet in packets:
                self.bag.packet(packet, self.time_of(packet.time))


def mode_of(word: str) -> Mode:
    """Return the mode of a word; raises BridgeError."""
    try:
        return Mode(word)
    except ValueError as error:
        raise BridgeError(
            f"unknown mode {word!r}; expected one of {[mode.value for mode in Mode]}"
        ) from error
