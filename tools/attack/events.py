"""The events of the attack table: signals, starvation, operator, rig, wire, files."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable

from acts import (
    TRANSPORTS,
    answers,
    command,
    command_beside,
    delayed,
    disarm,
    early_commands,
    fall_silent,
    full_disk,
    held_disarm,
    held_vent,
    hit_output,
    ignored,
    killed_then,
    late_answers,
    late_command_after_vent,
    late_first_command,
    mirror_under_load,
    pause,
    pulled,
    restart_disarm,
    restarted,
    second_bridge,
    send,
    send_group,
    start_only,
    start_with_file,
    starved,
    throttled,
    to_the_limit,
)
from attack_run import (
    EITHER,
    GOES_ON,
    HELD,
    HOLD,
    IDLE,
    LIMITS,
    MIRROR,
    RAMP,
    REFUSED,
    SILENCE,
    START,
    STAYS_EMPTY,
    VENT,
    Event,
)


def _refused_file(what: str, seen: str, rig: object, transport: str = "modbus") -> Event:
    return Event(f"rig file: {what}", transport, start_only(), START, REFUSED, seen, (2,), rig=rig)  # type: ignore[arg-type]


def _replaced(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new, 1)


def events() -> list[Event]:
    """Return all events, in the order of the table."""
    return [
        *_signals(),
        *_starvation(),
        *_operator(),
        *_held(),
        *_modbus(),
        *_serial(),
        *_topics(),
        *_files(),
    ]


def _signals() -> list[Event]:
    out = []
    for transport in TRANSPORTS:
        out += [
            Event("SIGINT (Ctrl-C) to the node", transport, send(signal.SIGINT)),
            Event("SIGTERM to the node", transport, send(signal.SIGTERM)),
            Event(
                "SIGHUP (terminal closed, ssh lost)",
                transport,
                send(signal.SIGHUP),
                quick=transport == "serial",
            ),
            Event(
                "kill -9 of the node",
                transport,
                send(signal.SIGKILL),
                exits=(-9,),
                quick=transport != "serial",
            ),
            Event("node stopped for 1 s, then continued", transport, pause(1.0), seen="vented"),
            Event("kill -9 of the output process", transport, hit_output(signal.SIGKILL), seen="vented"),
        ]
    m = "modbus"
    out += [
        Event("SIGQUIT to the node", m, send(signal.SIGQUIT)),
        Event("SIGUSR1 to the node", m, send(signal.SIGUSR1), outcome=EITHER),
        Event("Ctrl-C to the whole group", m, send_group(signal.SIGINT)),
        Event("SIGHUP to the whole group", m, send_group(signal.SIGHUP)),
        Event("SIGTERM to the whole group", m, send_group(signal.SIGTERM)),
        Event("output process stopped for 1 s", m, hit_output(signal.SIGSTOP, signal.SIGCONT), seen="vented"),
        Event("SIGTERM to the output process", m, hit_output(signal.SIGTERM), outcome=EITHER),
        Event("SIGINT to the node", m, send(signal.SIGINT), RAMP),
        Event("kill -9 of the node", m, send(signal.SIGKILL), RAMP, exits=(-9,)),
        Event("node stopped for 1 s, then continued", m, pause(1.0), RAMP),
    ]
    for transport, phase in ((m, VENT), (m, SILENCE), ("serial", VENT), ("topics", SILENCE)):
        out += [
            Event(
                "SIGINT to the node",
                transport,
                send(signal.SIGINT),
                phase,
                quick=(transport, phase) == (m, VENT),
            ),
            Event("SIGTERM to the node", transport, send(signal.SIGTERM), phase),
        ]
    out += [
        Event("SIGHUP to the node", m, send(signal.SIGHUP), VENT),
        Event("kill -9 of the node", m, send(signal.SIGKILL), VENT, exits=(-9,)),
        Event("kill -9 of the node", m, send(signal.SIGKILL), SILENCE, exits=(-9,)),
        Event("node stopped for 1 s, then continued", m, pause(1.0), SILENCE),
    ]
    return out


def _starvation() -> list[Event]:
    m = "modbus"
    return [
        Event("node stopped for 0.3 s, then operator silence", m, pause(0.3), seen="no command"),
        Event("node stopped for 5 s, then continued", m, pause(5.0), seen="vented"),
        Event("node stopped 0.3 s out of each 0.4 s, then operator silence", m, throttled),
        Event("4 busy loops for 8 s, operator silence in between", m, starved(4, 8.0)),
        Event("12 busy loops for 60 s, operator silence in between", m, starved(12, 60.0), slow=True),
    ]


def _operator() -> list[Event]:
    out = [Event("operator silent", one, fall_silent, seen="no command") for one in TRANSPORTS]
    m, limit = "modbus", LIMITS["pressure"]
    nonsense = (math.nan, math.nan)
    out += [
        Event("disarm", m, disarm, seen="vent"),
        Event("command at the limit", m, to_the_limit, outcome=GOES_ON),
        Event("command 1 Pa above the limit alone", m, command(limit + 1.0, limit + 1.0), seen="over limit"),
        Event(
            "command 1 Pa above the limit beside sound ones",
            m,
            command_beside(limit + 1.0, 8e4),
            outcome=GOES_ON,
            seen="over limit",
        ),
        Event("command of NaN alone", m, command(*nonsense), seen="not a number"),
        Event("command of three values alone", m, command(8e4, 8e4, 8e4), seen="wrong size"),
        Event("negative command alone", m, command(-1.0, -1.0), seen="over limit"),
        Event("2000 commands before arm, none after", m, early_commands, IDLE, STAYS_EMPTY, quick=True),
        Event("armed, no command for 6 s, then one", m, late_first_command, IDLE, STAYS_EMPTY),
        Event("commands again after a vent, without arm", m, late_command_after_vent, HOLD, STAYS_EMPTY),
    ]
    return out


def _held() -> list[Event]:
    out = []
    for transport in TRANSPORTS:
        out.append(
            Event(
                "arm is refused with the pressure, disarm vents", transport, held_disarm, HELD, seen="holds"
            )
        )
    m = "modbus"
    out += [
        Event("Ctrl-C", m, send(signal.SIGINT), HELD),
        Event("one-shot vent: -p mode:=vent", m, held_vent, HELD),
        Event("kill -9, a new bridge, disarm", m, killed_then(restart_disarm)),
        Event("a second bridge on the same device", m, second_bridge, outcome=EITHER),
    ]
    return out


def _modbus() -> list[Event]:
    m = "modbus"
    once = ("one register", "five registers", "odd byte count", "other function", "exception")
    out = [
        Event(f"one answer: {fault}", m, answers(fault, 1), outcome=EITHER, quick=fault == "five registers")
        for fault in once
    ]
    out += [
        Event("answers: one register, for 2 s", m, answers("one register"), heals=True),
        Event("answers: exception, for 2 s", m, answers("exception"), heals=True),
        Event("one answer: other transaction", m, answers("other transaction", 1), outcome=EITHER),
        Event("one answer: other unit", m, answers("other unit", 1), outcome=EITHER),
        Event("one answer: truncated", m, answers("truncated", 1), outcome=EITHER),
        Event(
            "connection closed in the middle of an answer",
            m,
            answers("closed in the middle", 1),
            outcome=EITHER,
        ),
        Event("answers of random bytes, for 2 s", m, answers("random bytes"), heals=True),
        Event("answers split into bytes", m, answers("split"), outcome=GOES_ON),
        Event("each answer late by 0.3 s, for 2 s", m, late_answers, heals=True),
        Event("silent island, for 2 s", m, answers("silent"), heals=True, seen="vented"),
        Event("cable pulled, for 2 s", m, pulled, heals=True, seen="vented"),
        Event("island restarted, its valves keep their set-point", m, restarted),
        Event("island refuses writes, for 2 s", m, answers("refuses writes"), heals=True, seen="refuse"),
        Event("island ignores writes, for 2 s", m, ignored("ignores writes"), heals=True, seen="vented"),
        Event("read-back 300 mbar off, for 2 s", m, answers("other read-back"), heals=True, seen="vented"),
        Event(
            "island works to 1950 mbar and says so",
            m,
            answers("works to 1950 mbar"),
            seen="vented",
        ),
        Event("measured pressure above the limit", m, answers("above limit"), seen="vented"),
        Event("measured pressures of -32768 and 32767", m, answers("not a number"), seen="vented"),
        Event("clock of the island stuck", m, answers("clock stuck"), outcome=EITHER),
        Event("clock of the island jumps at random", m, answers("clock jumps"), outcome=EITHER),
        Event("readings late by 100 ms more each second", m, delayed(0.1), seen="old"),
        Event("readings late by 10 ms more each second", m, delayed(0.01), seen="old", slow=True),
    ]
    return out


def _serial() -> list[Event]:
    s = "serial"
    return [
        Event("no acknowledgements", s, answers("no acknowledgements"), seen="vented"),
        Event("wrong checksums, for 2 s", s, answers("wrong checksum"), heals=True, seen="vented"),
        Event(
            "valid checksum, 400 digits, for 2 s",
            s,
            answers("400 digits"),
            heals=True,
            seen="vented",
            quick=True,
        ),
        Event("controller refuses, for 2 s", s, answers("refuses"), heals=True, seen="refuse"),
        Event("endless line, for 2 s", s, answers("endless line"), heals=True, seen="vented"),
        Event("garbage, for 2 s", s, answers("garbage"), heals=True, seen="vented"),
        Event("echo of what it gets", s, answers("echo"), outcome=EITHER),
        Event("status stuck, for 2 s", s, answers("stuck status"), heals=True, seen="vented"),
        Event("silent controller, for 2 s", s, answers("silent"), heals=True, seen="vented"),
        Event("plug pulled, for 2 s", s, pulled, heals=True, seen="vented"),
        Event("measured pressure above the limit", s, answers("above limit"), seen="vented"),
        Event("read-back 300 mbar off, for 2 s", s, answers("other read-back"), heals=True, seen="vented"),
        Event("measured pressures nan and inf", s, answers("not a number"), seen="vented"),
        Event("readings late by 100 ms more each second", s, delayed(0.1), seen="old"),
    ]


def _topics() -> list[Event]:
    t = "topics"
    return [
        Event("silent rig, for 2 s", t, answers("silent"), heals=True, seen="vented"),
        Event("rig dies, for 2 s", t, pulled, heals=True, seen="vented"),
        Event("read-back of a wrong size, for 2 s", t, answers("wrong sizes"), heals=True, seen="vented"),
        Event("pressures of NaN and infinity", t, answers("not a number"), seen="vented"),
        Event("stamps stuck", t, answers("stale stamps"), seen="vented"),
        Event("no read-back, for 2 s", t, answers("no read-back"), heals=True, seen="vented"),
        Event(
            "another publisher on the set-point topic, for 2 s",
            t,
            answers("another publisher"),
            heals=True,
            seen="vented",
        ),
        Event("rig ignores set-points, for 2 s", t, ignored("ignores"), heals=True, seen="vented"),
        Event("measured pressure above the limit", t, answers("above limit"), seen="vented"),
        Event("read-back 300 mbar off, for 2 s", t, answers("other read-back"), heals=True, seen="vented"),
        Event("messages of random bytes, for 2 s", t, answers("random bytes"), heals=True, seen="vented"),
        Event("readings late by 100 ms more each second", t, delayed(0.1), seen="old"),
        Event("4 busy loops, a tracker that leaps, Ctrl-C", t, mirror_under_load, MIRROR, STAYS_EMPTY),
    ]


def _files() -> list[Event]:
    twice = f"limits: {{pressure: 500.0e+3, slew: {LIMITS['slew']}}}\n"
    return [
        _refused_file("heartbeat names the set-point's register", "heartbeat", {"heartbeat": 0}),
        _refused_file("heartbeat names the right arm's set-point", "heartbeat", {"heartbeat": 1}),
        _refused_file("clock overlaps the measured pressures", "clock", {"clock": 1}),
        _refused_file("rate 0.2 Hz", "rate", {"rate": 0.2}),
        _refused_file("rate 0.001 Hz", "rate", {"rate": 0.001}),
        _refused_file("device 300", "device", {"device": 300}),
        _refused_file("port 70000", "port", {"port": 70000}),
        _refused_file("register -1", "setpoint", {"setpoint": -1}),
        _refused_file("register 65535 for two arms", "setpoint", {"setpoint": 65535}),
        _refused_file("baud -1", "baud", {"baud": -1}, "serial"),
        _refused_file("unit overflows the register", "unit", {"unit": "Pa"}),
        _refused_file("limits given twice", "limits.*twice|twice.*limits", lambda text: text + twice),
        _refused_file(
            "pressure given twice",
            "pressure.*twice|twice.*pressure",
            _replaced("  slew:", "  pressure: 500000.0\n  slew:"),
        ),
        _refused_file("port: 0502", "0502", _octal),
        _refused_file(
            "vent time that cannot be kept", "vent_time", _replaced("vent_time: 1.0", "vent_time: 0.3")
        ),
        Event("parameter file: no YAML", "modbus", start_with_file("{: ["), START, REFUSED, exits=(2,)),
        Event("parameter: unknown mode", "modbus", start_only(mode="life"), START, REFUSED, "mode", (2,)),
        Event(
            "parameter: no such rig",
            "modbus",
            start_only(rig="nowhere.yaml"),
            START,
            REFUSED,
            "nowhere",
            (2,),
        ),
        Event(
            "disk full while recording",
            "modbus",
            full_disk,
            outcome=EITHER,
            parameters={"record": "bags"},
        ),
    ]


def _octal(text: str) -> str:
    lines = text.splitlines()
    return "\n".join("  port: 0502" if line.startswith("  port:") else line for line in lines) + "\n"
