"""One attack: device, operator, the bridge as a process, one event, and the times until the chambers are empty."""

from __future__ import annotations

import os
import re
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from bridge_process import BridgeProcess
from island import Island
from operator_node import Operator
from serial_device import SerialDevice
from topic_rig import TopicRig

LIMITS = {
    "pressure": 120e3,
    "slew": 400e3,
    "vent_ramp": 0.3,
    "vent_time": 1.0,
    "command_timeout": 0.4,
    "rig_timeout": 0.4,
}
MARGIN = 0.3  # s: discovery of an event, start of a process, a machine that is busy
PROMISE = LIMITS["command_timeout"] + LIMITS["vent_time"] + MARGIN
END_TIME = 2.0  # s: from Ctrl-C to the end, beside the vent
LIMIT = LIMITS["pressure"] * 1e-2  # mbar
WORKING = 800.0  # mbar
EMPTY = 0.05 * LIMIT
START_TIME = 25.0
SMALL_SCENE = {
    "lattice": {"size": [0.140, 0.140, 0.010], "nodes": [5, 5], "mass": 0.160},
    "points": {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]},
    "effects": [
        {"type": "springs", "law": "axial", "stiffness": 80.0, "damping": 5.0},
        {"type": "gravity"},
        {"type": "clamp", "edge": "x_min"},
        {"type": "arms", "drive": "pressure", "pressure_gain": 1.0e-6},
    ],
    "sensors": {"tracker": {"points": ["P0", "P1"], "rate": 80.0}, "pressure": {"rate": 100.0}},
    "solver": {"integrator": "auto", "accuracy": 1.0e-4},
}

# Phases: the state in which an event strikes.
HOLD, RAMP, VENT, SILENCE, IDLE, HELD, MIRROR, START = (
    "hold",
    "ramp up",
    "vent after disarm",
    "vent after operator silence",
    "before arm",
    "rig holds pressure at the start",
    "mirror",
    "start",
)
# Outcomes that are safe.
VENTS, GOES_ON, EITHER, STAYS_EMPTY, REFUSED, SURVIVES = (
    "vents",
    "goes on",
    "vents or goes on",
    "stays empty",
    "refused at the start",
    "ends no thread",
)


@dataclass(frozen=True)
class Event:
    """One row of the table.

    Attributes:
        what: The event in words.
        transport: 'modbus', 'serial' or 'topics'.
        act: Makes it happen.
        phase: When.
        outcome: Expected safe outcome.
        seen: Pattern of a line that the operator must see; '' for none.
        exits: Exit statuses that are right at the end; None for any but 0.
        heals: The device stops misbehaving 2 s later; without a vent meanwhile, the time counts from there.
        rig: Text of the rig file, or changes of the link's keys.
        parameters: Further parameters of the bridge.
        quick: Belongs to the selection of the test suite.
        slow: Is left out unless asked for.
    """

    what: str
    transport: str
    act: Callable[[Run], None]
    phase: str = HOLD
    outcome: str = VENTS
    seen: str = ""
    exits: tuple[int, ...] | None = (0,)
    heals: bool = False
    rig: dict[str, Any] | Callable[[str], str] | None = None
    parameters: dict[str, Any] = field(default_factory=dict)
    quick: bool = False
    slow: bool = False


@dataclass(frozen=True)
class Row:
    """The measurement of an event: times from the event [s], None for never."""

    what: str
    transport: str
    phase: str
    expected: str
    zero: float | None
    empty: float | None
    seen: str
    exit_status: int | None
    faults: tuple[str, ...]

    @property
    def safe(self) -> bool:
        """Whether every promise was kept."""
        return not self.faults


class Run:
    """The players of one attack.

    Args:
        event: The event.
        folder: Folder of its files.
        domain: ROS domain.
    """

    def __init__(self, event: Event, folder: Path, domain: int) -> None:
        self.event, self.folder, self.domain = event, folder, domain
        folder.mkdir(parents=True, exist_ok=True)
        self.environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_LOG_DIR": str(folder / "log"),
            "FASTDDS_BUILTIN_TRANSPORTS": "SHM",
        }
        self.environment.pop("ROS_AUTOMATIC_DISCOVERY_RANGE", None)
        self.device: Any = self._device()
        self.chambers = self.device.chambers
        self.scene = folder / "scene.yaml"
        self.scene.write_text(yaml.safe_dump(SMALL_SCENE))
        self.rig_file = folder / "rig.yaml"
        self.rig_file.write_text(self._rig_text())
        self.operator = Operator(domain)
        self.bridges: list[BridgeProcess] = []
        self.reference = time.monotonic()
        self.seen_since = 0.0
        self.faults: list[str] = []

    @property
    def bridge(self) -> BridgeProcess:
        """The bridge under attack: the last one that was started."""
        return self.bridges[-1]

    def start(self, **parameters: object) -> BridgeProcess:
        """Start a bridge in mode live."""
        limit = parameters.pop("limit", None)
        given = {"rig": self.rig_file, "scene": self.scene, "mode": "live", **parameters}
        words = ("ldcs_ros.ros", "bridge", "--ros-args")
        self.bridges.append(BridgeProcess(self.environment, *words, limit=limit, **given))
        return self.bridge

    def mark(self) -> None:
        """Let the promised time count from now."""
        self.reference = time.monotonic()

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait for a condition; return whether it came true."""
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                return False
            time.sleep(0.005)
        return True

    def require(self, condition: bool, fault: str) -> None:
        """Note what was not kept."""
        if not condition:
            self.faults.append(fault)

    def arm(self, timeout: float = START_TIME) -> bool:
        """Arm as soon as the bridge accepts it."""
        end = time.monotonic() + timeout
        message = ""
        while time.monotonic() < end and self.bridge.exit_status is None:
            done, message = self.operator.arm(2.0)
            if done or "already" in message:
                self.bridge.children()
                return True
            time.sleep(0.05)
        self.faults.append(f"could not be armed: {message}")
        return False

    def output_process(self) -> int:
        """Return the process that owns the device; raises AssertionError without one."""
        children = self.bridge.children()
        assert children, "there is no process of the output stage"
        return children[0]

    def pressurise(self, pressure: float = WORKING) -> None:
        """Arm and bring both chambers to a pressure [mbar]; a bridge that a busy machine starves is armed again."""
        for _ in range(3):
            if not self.arm():
                return
            self.operator.pressure = [pressure * 100.0] * 2
            if self.until(lambda: min(self.chambers.pressure()) > 0.9 * pressure, 3.0):
                return
            self.operator.pressure = None
        self.faults.append("did not reach the working pressure")

    def measure(self) -> Row:
        """Run the event and return its row."""
        event = self.event
        try:
            self._prepare()
            self.mark()
            if not self.faults:
                event.act(self)
                if event.heals:
                    self._heal()
            return self._judge()
        except AssertionError as error:
            self.faults.append(str(error))
            return self._row(None, None, "", None)
        finally:
            self.close()

    def close(self) -> None:
        """Stop its processes; keep the terminals and the records of the graph beside the other files."""
        terminal = [(moment, line) for bridge in self.bridges for moment, line in bridge.lines]
        lines = sorted([*terminal, *self.operator.heard])
        text = [f"{moment - self.reference:+9.3f} {line}\n" for moment, line in lines]
        (self.folder / "terminal.txt").write_text("".join(text))
        for bridge in self.bridges:
            bridge.end()
        self.operator.close()
        self.device.close()

    def _prepare(self) -> None:
        phase = self.event.phase
        if phase == HELD:
            self.chambers.preset(WORKING, WORKING)
        if phase == START:
            return
        if phase == MIRROR:
            self.device.tracks = True
            self.start(mode="mirror", record=self.folder / "bags")
        else:
            given = dict(self.event.parameters)
            if "record" in given:
                given["record"] = self.folder / str(given["record"])
            self.start(**given)
        if phase in (IDLE, HELD, MIRROR):
            ready = self.until(lambda: self.answers() or self.bridge.exit_status is not None, START_TIME)
            self.require(ready and self.bridge.exit_status is None, "the bridge did not start")
            return
        if phase == RAMP:
            if self.arm():
                self.operator.pressure = [WORKING * 100.0] * 2
                self.until(lambda: max(self.chambers.setpoint()) > 50.0, 4.0)
            return
        self.pressurise()
        if phase == VENT:
            self.operator.disarm()
            self.until(lambda: max(self.chambers.setpoint()) < 0.95 * WORKING, 1.0)
        elif phase == SILENCE:
            self.operator.pressure = None
            self.until(lambda: max(self.chambers.setpoint()) < 0.95 * WORKING, 2.0)
        else:
            time.sleep(0.2)

    def _heal(self) -> None:
        """Let the device misbehave for 2 s; count the time from its end if no vent was possible meanwhile."""
        time.sleep(2.0)
        vented = self.chambers.empty_since(EMPTY, time.monotonic()) is not None
        self.device.heal()
        if self.device.away:
            self.device.listen()
        if not vented:
            self.mark()
            self.seen_since = self.reference - 2.1

    def answers(self) -> bool:
        """Return whether the bridge has printed a line of its status."""
        return any(" s " in line or "live" in line for line in self.bridge.text())

    def _judge(self) -> Row:
        event = self.event
        if event.outcome == REFUSED:
            return self._judge_refusal()
        if event.outcome == GOES_ON:
            time.sleep(1.0)
            self.require(min(self.chambers.pressure()) > 0.8 * WORKING, "did not go on")
            self.mark()
            self.operator.pressure = None
        elif event.outcome == EITHER:
            time.sleep(1.0)
            if min(self.chambers.pressure()) > 0.8 * WORKING:
                self.operator.pressure = None
                self.mark()
        elif event.outcome == STAYS_EMPTY:
            time.sleep(1.0)
            highest = self.chambers.highest(self.reference, time.monotonic())
            self.require(highest <= EMPTY, f"moved to {highest:.0f} mbar")
        time.sleep(max(1.0, self.reference + PROMISE + 0.5 - time.monotonic()))
        watched = time.monotonic()
        status = self._end()
        zero, empty = self.chambers.zero_held_since(), self.chambers.empty_since(EMPTY, watched)
        zero = None if zero is None or zero > watched else max(zero - self.reference, 0.0)
        empty = None if empty is None else max(empty - self.reference, 0.0)
        if event.outcome == STAYS_EMPTY:
            zero = empty = 0.0
        else:
            for what, value in (("set-point zero", zero), ("chambers empty", empty)):
                self.require(
                    value is not None and value <= PROMISE, f"{what}: {shown(value)} > {PROMISE:g} s"
                )
        if event.seen:
            self._require_words(event.seen, self.reference - 10.0)
        self._check_requests()
        right = status != 0 if event.exits is None else status in event.exits
        self.require(right, f"exit status {status}, expected {event.exits or 'not 0'}")
        return self._row(zero, empty, self._seen(), status)

    def _judge_refusal(self) -> Row:
        took = self.bridge.wait(START_TIME) if self.bridges else None
        self.require(took is not None, "the bridge started")
        if took is None:
            self._end()
        status = self.bridge.exit_status
        self.require(status == 2, f"exit status {status}, expected 2")
        # ROS itself logs a parameter file that it cannot parse, before the bridge's own line.
        lines = [line for line in self.bridge.text() if line.strip() and "[rcl]" not in line]
        self.require(len(lines) == 1, f"{len(lines)} lines instead of one")
        if self.event.seen:
            self._require_words(self.event.seen, 0.0)
        self.require(not self.chambers.requests, "a set-point was written")
        return self._row(0.0, 0.0, _plain(lines[-1]) if lines else "nothing", status)

    def _end(self) -> int | None:
        """Interrupt what still runs; return the exit status of the bridge under attack."""
        self.operator.pressure = None
        for bridge in self.bridges:
            if bridge.exit_status is None:
                bridge.send(signal.SIGINT)
                took = bridge.wait(END_TIME + PROMISE)
                self.require(took is not None, f"did not end within {END_TIME + PROMISE:g} s of Ctrl-C")
                if took is None:
                    bridge.end()
        return self.bridge.exit_status

    def _check_requests(self) -> None:
        values = [value for _, *pair in self.chambers.requests for value in pair]
        if values:
            self.require(max(values) <= LIMIT, f"a set-point of {max(values):.1f} mbar was written")
            self.require(min(values) >= 0.0, f"a set-point of {min(values):.1f} mbar was written")

    def _require_words(self, pattern: str, since: float) -> None:
        lines = [line for bridge in self.bridges for line in bridge.text(since)]
        found = any(re.search(pattern, line, re.IGNORECASE) for line in lines)
        self.require(found, f"the terminal does not say {pattern!r}")

    def _seen(self) -> str:
        """Return the first line about the event: of the terminal, of rosout, else of the diagnostics."""
        since = self.seen_since or self.reference
        lines = [line for bridge in self.bridges for line in bridge.text(since)]
        grave = [line for line in lines if re.search(r"\[(WARN|ERROR|FATAL)\]|^bridge: |^output: ", line)]
        heard = [text for moment, text in self.operator.heard if moment >= since]
        rosout = [text for text in heard if text.startswith("rosout")]
        return _plain((grave or rosout or heard or lines or ["nothing"])[0])

    def _row(self, zero: float | None, empty: float | None, seen: str, status: int | None) -> Row:
        event = self.event
        faults = tuple(dict.fromkeys(self.faults))
        return Row(event.what, event.transport, event.phase, event.outcome, zero, empty, seen, status, faults)

    def _device(self) -> Any:  # noqa: ANN401  # a device of each transport
        if self.event.transport == "modbus":
            return Island()
        if self.event.transport == "serial":
            return SerialDevice(self.folder)
        return TopicRig(self.domain)

    def _rig_text(self) -> str:
        link = self.device.link()
        change = self.event.rig
        if isinstance(change, dict):
            link |= change
        text = yaml.safe_dump({"title": "Attacked", "limits": LIMITS, "links": [link]}, sort_keys=False)
        return change(text) if callable(change) else text


def shown(value: float | None) -> str:
    """Return a time in words [s]."""
    return "never" if value is None else f"{value:.2f} s"


def _plain(line: str) -> str:
    """Return a line of a terminal without time, node and colour."""
    line = re.sub(r"\x1b\[[0-9;]*m", "", line)
    line = re.sub(r"\[\d+\.\d+\] \[[\w./]+\]: ", "", line)
    return re.sub(r"/(tmp|dev|home|root)/\S+/", "", line)
