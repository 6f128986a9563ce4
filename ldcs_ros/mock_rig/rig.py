"""The mock rig: a scene with hidden parameters, valves, a clock of its own, and a local watchdog."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.errors import BridgeError
from ldcs_ros.mock_rig.faults import Faults
from ldcs_ros.mock_rig.valve import ProportionalValve
from ldcs_ros.physics.effects.arms import Arms
from ldcs_ros.scene import load_scene
from ldcs_ros.scene.scene import Scene
from ldcs_ros.sensors import Measurement, Tracker, TrackerParameters

_SMALLEST_CHANGE = 50.0
_LONGEST_STEP = 0.01
LIMIT = 140e3
"""Largest set-point that the rig takes [Pa]; it refuses more."""
REPORT_RATE = 100.0
"""Reports per second [Hz]."""
CONTROLLERS = ("remote", "hold", "wave", "steps")


@dataclass(frozen=True)
class Hidden:
    """The parameters of a rig that its twin does not know.

    Attributes:
        stiffness: Factor on the stiffness of the sheet's springs.
        gain: Factor on the arms' torque for a pressure.
        load: Mass that hangs on the free edge beside the scene's payload [kg].
        tracker_delay: Time from a measurement of the tracker to its delivery [s].
    """

    stiffness: float = 1.2
    gain: float = 0.85
    load: float = 0.02
    tracker_delay: float = 0.02


@dataclass(frozen=True)
class RigStatus:
    """A report of the rig.

    Attributes:
        number: Number of the report.
        stamp: Time on its own clock [s].
        setpoint: Present set-points, gauge [Pa], by arm.
        pressure: Measured gauge pressures [Pa], by arm; NaN for a broken sensor.
    """

    number: int
    stamp: float
    setpoint: tuple[float, ...]
    pressure: tuple[float, ...]


class MockRig:
    """Advances the rig in real time; transports read its reports and give it set-points, from their threads.

    Args:
        scene: The rig's scene, hidden parameters and all; its arms are driven by pressure.
        controller: Source of set-points: 'remote' (a connected controller), or the rig itself: 'hold', 'wave', 'steps'.
        clock: Steady clock [s].
        epoch: Reading of its own clock at the start [s].
        bus_timeout: Silence of a remote controller after which it vents by itself [s].

    Attributes:
        faults: Its faults.
        course_start: Steady time at which its own controller begins [s]; before, it holds no pressure.
        peak: Largest chamber pressure so far [Pa].
        lowest_setpoint: Smallest set-point asked for so far [Pa].
        highest_setpoint: Largest set-point asked for so far [Pa].
    """

    def __init__(
        self,
        scene: Scene,
        *,
        controller: str = "remote",
        clock: Callable[[], float],
        epoch: float = 1000.0,
        bus_timeout: float = 0.4,
    ) -> None:
        if controller not in CONTROLLERS:
            raise BridgeError(f"unknown controller {controller!r}; expected one of {list(CONTROLLERS)}")
        self.simulation = scene.build()
        arms = self.simulation.model.arms
        if arms is None or self.simulation.inputs.pressure is None:
            raise BridgeError(
                f"the scene {scene.name!r} is not driven by pressure; the mock rig needs one that is"
            )
        self.simulation.settle()
        self.controller, self.bus_timeout = controller, bus_timeout
        self.faults = Faults()
        self._clock, self._epoch = clock, epoch
        self._valves = [ProportionalValve() for _ in self.simulation.arm_names]
        n_arms = len(self._valves)
        self._remote = self._zero = (0.0,) * n_arms
        # Its own waves lean: the first arm leads where the last one follows.
        self._lean = np.linspace(1.0, -1.0, n_arms).tolist()
        self._remote_at = -math.inf
        self._start = self._now = clock()
        self.course_start = self._start
        self._given = np.zeros(n_arms)
        self._bound = np.array([own.pressure_limit for own in arms.each])
        self._lock = threading.Lock()
        self._number = 0
        self._history: deque[tuple[float, RigStatus]] = deque(maxlen=2000)
        self.peak = 0.0
        self.lowest_setpoint = math.inf
        self.highest_setpoint = 0.0
        self.refused = 0
        given: dict[str, Any] = dict(
            scene.sensors.get(
                "tracker", {"points": tuple(scene.points), "noise": 0.0, "quantum": 0.0, "seed": 0}
            )
        )
        parameters = TrackerParameters(**given)
        self.tracker_delay = parameters.delay
        self._tracker = Tracker(parameters, np.random.default_rng(parameters.seed + 1000))
        self._tracked: deque[tuple[float, float, Measurement]] = deque(maxlen=2000)
        self._report()

    @property
    def probes(self) -> tuple[str, ...]:
        """Point of each of the tracker's probes, probe 0 first."""
        return self._tracker.parameters.points

    @property
    def pressure(self) -> np.ndarray:
        """True chamber pressures [Pa], shape (n_arms,)."""
        return np.array([valve.pressure for valve in self._valves])

    @property
    def setpoint(self) -> tuple[float, ...]:
        """Set-points that it works to now [Pa]."""
        if self.controller == "remote":
            return self._remote
        time = self._now - self.course_start
        if self.controller == "hold" or time < 0.0:
            return self._zero
        if self.controller == "steps":
            level = (0.3, 0.7, 0.5, 0.0)[int(time / 1.5) % 4] * LIMIT
            return (level,) * len(self._zero)
        swing = 0.5 * (1.0 - math.cos(2.0 * math.pi * 0.2 * time))
        lean = 0.15 * math.sin(2.0 * math.pi * 0.13 * time)
        return tuple(LIMIT * swing * (0.75 + side * lean) for side in self._lean)

    def rig_time(self) -> float:
        """Return the time on the rig's own clock [s]."""
        return self._epoch + self._now - self._start + self.faults.clock_jump

    def set_fault(self, name: str, value: object) -> None:
        """Set one of its faults; raises BridgeError for an unknown fault, arm or value."""
        self.faults.set(name, value, self.simulation.arm_names)

    def command(self, pressure: Sequence[float]) -> str:
        """Take set-points [Pa] from outside, one an arm; return '' or the reason of a refusal."""
        values = tuple(pressure)
        if len(values) != len(self._zero):
            self.refused += 1
            return "wrong size"
        if all(math.isfinite(value) for value in values):
            self.lowest_setpoint = min(self.lowest_setpoint, *values)
            self.highest_setpoint = max(self.highest_setpoint, *values)
        if self.controller != "remote":
            return "local control"
        # Registers are whole millibars: half of one is no excess.
        if not all(math.isfinite(value) and 0.0 <= value <= LIMIT + 50.0 for value in values):
            self.refused += 1
            return "out of range"
        self._remote, self._remote_at = values, self._clock()
        return ""

    def advance(self) -> None:
        """Go on to the present."""
        now = self._clock()
        while self._now < now:
            step = min(now - self._now, _LONGEST_STEP)
            self._now += step
            self._step(step)

    def statuses(self, after: int) -> list[RigStatus]:
        """Return the reports past a number that are due by now, oldest first, with what faults do to them."""
        if self.faults.mute or self.faults.drop:
            return []
        due = self._clock() - self.faults.delay
        with self._lock:
            fresh = [status for made, status in self._history if made <= due and status.number > after]
        return [status for status in fresh for _ in range(1 + self.faults.duplicates)]

    def latest(self) -> RigStatus:
        """Return the newest report that is due by now."""
        due = self._clock() - self.faults.delay
        with self._lock:
            status = self._history[0][1]
            for made, one in reversed(self._history):
                if made <= due:
                    return one
        return status

    def tracked(self) -> list[tuple[float, Measurement]]:
        """Return the tracker's deliveries that are due, each once: stamp [s of the rig's clock], measurement."""
        due = self._clock() - self.faults.delay
        out = []
        with self._lock:
            while self._tracked and self._tracked[0][0] <= due:
                _, stamp, measured = self._tracked.popleft()
                out += [(stamp, measured)] * (1 + self.faults.duplicates)
        return [] if self.faults.mute or self.faults.drop else out

    def _step(self, duration: float) -> None:
        time = self._now - self._start
        if self.controller == "remote" and self._now - self._remote_at > self.bus_timeout:
            self._remote = self._zero
        before = self.pressure
        for arm, valve, setpoint in zip(self.simulation.arm_names, self._valves, self.setpoint, strict=True):
            stuck, leak = self.faults.stuck == arm, self.faults.leak == arm
            valve.advance(self._now, duration, setpoint, stuck=stuck, leak=leak)
        pressure = self.pressure
        self.peak = max(self.peak, float(pressure.max()))
        # Held over the step: the mean, so that the sheet does not run ahead of its chambers.
        held = 0.5 * (before + pressure)
        if np.abs(held - self._given).max() > _SMALLEST_CHANGE:
            self.simulation.inputs.set_pressure(np.clip(held, 0.0, self._bound))
            self._given = held
        while self._tracker.next_tick <= time:
            self.simulation.advance_to(max(self._tracker.next_tick, self.simulation.time))
            self._tracker.measure(self.simulation.pose)
        self.simulation.advance_to(max(time, self.simulation.time))
        with self._lock:
            for measured in self._tracker.deliver(time):
                stamp = self.rig_time() - (time - measured.delivered)
                self._tracked.append((self._now, stamp, measured))
        if not self._history or self._now - self._history[-1][0] >= 1.0 / REPORT_RATE - 1e-6:
            self._report()

    def _report(self) -> None:
        broken = self.faults.nan
        pressure = [
            math.nan if arm == broken else valve.pressure
            for arm, valve in zip(self.simulation.arm_names, self._valves, strict=True)
        ]
        self._number += 1
        status = RigStatus(self._number, self.rig_time(), self.setpoint, tuple(pressure))
        with self._lock:
            self._history.append((self._now, status))


def hidden_scene(scene: Scene, hidden: Hidden) -> Scene:
    """Return a rig's scene: another one's with hidden parameters, valves left to the rig, and no schedule."""
    content = scene.stiffened(hidden.stiffness).content
    for effect in content["effects"]:
        if effect["type"] == "arms":
            shared = effect.get("pressure_gain", Arms.pressure_gain)
            for block in (effect, *effect.get("arms", ())):
                block["pressure_gain"] = hidden.gain * block.get("pressure_gain", shared)
                block.update(fill_time=0.001, vent_time=0.001, dead_time=0.0)
    if hidden.load > 0.0:
        content["effects"].append({"type": "payload", "at": ["mid", "free_edge"], "mass": hidden.load})
    tracker = content.get("sensors", {}).get("tracker")
    if tracker is not None:
        tracker["delay"] = hidden.tracker_delay
    content.pop("inputs", None)
    content.setdefault("solver", {"integrator": "auto", "accuracy": 1e-4})
    return load_scene(content)
