"""Checks of a rig file as a whole: a file whose registers, rates or times cannot keep the promise is refused."""

from __future__ import annotations

from collections.abc import Sequence

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.modbus import ModbusMap
from ldcs_ros.rig.output.serial_line import SerialSettings
from ldcs_ros.rig.topic_link import TopicSettings
from ldcs_ros.rig.units import PressureUnit

LinkSettings = ModbusMap | SerialSettings | TopicSettings
"""Settings of one link."""
HIGHEST_ADDRESS = 0xFFFF
HIGHEST_DEVICE = 247
"""Largest device identifier of the Modbus specification; 255 names a device without one (TCP)."""
ANY_DEVICE = 255
HIGHEST_VALUE = 0x7FFF
"""Largest pressure in a register: above it a signed register is negative."""
BAUD_RATES = (
    *(1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 576000),
    *(921600, 1000000, 1152000, 1500000, 2000000, 2500000, 3000000, 3500000, 4000000),
)
BITS_PER_EXCHANGE = 10 * 64
"""A status line and its answer, ten bits per byte."""
EXCHANGES_PER_TIMEOUT = 4
"""Exchanges that fit into each timeout: one lost answer must not be a silent rig."""
VALVE_TIME = 0.1
"""Shortest time in which a chamber empties after the ramp [s]."""


def check_rig(links: Sequence[LinkSettings], limits: Limits) -> None:
    """Check settings of the links against each other and against the limits.

    Args:
        links: Settings of each link, in the order of the file.
        limits: Limits that hold.

    Raises:
        BridgeError: A number is out of its range, registers overlap, or the vent time cannot be kept.
    """
    for index, link in enumerate(links):
        path = f"links[{index}]"
        if isinstance(link, ModbusMap):
            _check_registers(link, len(limits.arms), path)
            _check_register_values(link.unit, limits, path)
            longest = 0.5 * min(limits.command_timeout, limits.rig_timeout)
            if not 0.001 <= link.timeout <= longest:
                _refuse(
                    link.timeout, f"0.001 ... {longest:g} s, half of the shorter timeout", f"{path}.timeout"
                )
        elif isinstance(link, SerialSettings):
            _check_baud(link, path)
        if not isinstance(link, TopicSettings) or link.send is not None:
            _check_rate(link.rate, limits, path)


def _check_registers(link: ModbusMap, n_arms: int, path: str) -> None:
    if not link.host.strip():
        _refuse(link.host, "a host name or an address", f"{path}.host")
    if not 1 <= link.port <= 0xFFFF:
        _refuse(link.port, "1 ... 65535", f"{path}.port")
    if not 0 <= link.device <= HIGHEST_DEVICE and link.device != ANY_DEVICE:
        _refuse(link.device, f"0 ... {HIGHEST_DEVICE}, or {ANY_DEVICE}", f"{path}.device")
    holding = {"setpoint": (link.setpoint, n_arms), "heartbeat": (link.heartbeat, 1)}
    inputs = {"actual": (link.actual, n_arms), "clock": (link.clock, 2)}
    for space in (holding, inputs):
        used: dict[int, str] = {}
        for name, (first, count) in space.items():
            if first == -1 and name in ("clock", "heartbeat"):
                continue
            highest = HIGHEST_ADDRESS - count + 1
            if not 0 <= first <= highest:
                none = ", or -1 for none" if name in ("clock", "heartbeat") else ""
                _refuse(first, f"0 ... {highest} for {count} register(s){none}", f"{path}.{name}")
            for address in range(first, first + count):
                if address in used:
                    taken = used[address]
                    _refuse(
                        first,
                        f"registers beside those of {taken}: register {address} is {taken}'s",
                        f"{path}.{name}",
                    )
                used[address] = name


def _check_register_values(unit: PressureUnit, limits: Limits, path: str) -> None:
    for arm, pressure in zip(limits.arms, limits.highest, strict=True):
        value = unit.from_pascal(pressure)
        if not 1.0 <= value <= HIGHEST_VALUE:
            what = f"limits.pressure ({pressure:g} Pa for {arm}) as 1 ... {HIGHEST_VALUE} in a register"
            _refuse(f"{value:.6g} {unit.name}", what, f"{path}.unit")


def _check_baud(link: SerialSettings, path: str) -> None:
    if link.baud not in BAUD_RATES:
        _refuse(link.baud, f"one of {', '.join(map(str, BAUD_RATES))}", f"{path}.baud")
    highest = link.baud / BITS_PER_EXCHANGE
    if link.rate > highest:
        _refuse(link.rate, f"at most {highest:.3g} Hz at {link.baud} baud", f"{path}.rate")


def _check_rate(rate: float, limits: Limits, path: str) -> None:
    shortest = min(limits.command_timeout, limits.rig_timeout)
    lowest = EXCHANGES_PER_TIMEOUT / shortest
    if not lowest <= rate <= 1000.0:
        what = f"{lowest:g} ... 1000 Hz, {EXCHANGES_PER_TIMEOUT} exchanges in the shorter timeout ({shortest:g} s)"
        _refuse(rate, what, f"{path}.rate")
    least = limits.vent_ramp + VALVE_TIME + 2.0 / rate
    if limits.vent_time < least:
        parts = f"vent_ramp {limits.vent_ramp:g} + valve {VALVE_TIME:g} + two exchanges {2.0 / rate:g}"
        _refuse(limits.vent_time, f"at least {least:.3g} s ({parts})", "limits.vent_time")


def _refuse(got: object, expected: str, path: str) -> None:
    raise BridgeError(f"got {got if isinstance(got, str) else f'{got:g}'}, expected {expected} @ {path}")
