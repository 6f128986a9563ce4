"""Acts of the events: signals, starvation, commands, faults of the device, files."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable

from attack_run import (
    END_TIME,
    LIMITS,
    PROMISE,
    WORKING,
    Run,
)

Act = Callable[[Run], None]
TRANSPORTS = ("modbus", "serial", "topics")
FULL = [WORKING * 100.0] * 2
BUSY = "while True: pass"


def send(number: int) -> Act:
    """Send a signal to the node."""
    return lambda run: run.bridge.send(number)


def send_group(number: int) -> Act:
    """Send a signal to the whole group, as a terminal does."""
    return lambda run: run.bridge.send_all(number)


def pause(duration: float) -> Act:
    """Stop the node for a duration [s] and continue it; the operator goes on commanding."""

    def act(run: Run) -> None:
        run.bridge.send(signal.SIGSTOP)
        time.sleep(duration)
        run.bridge.send(signal.SIGCONT)
        if duration < LIMITS["command_timeout"]:
            time.sleep(1.0)
            run.operator.pressure = None
            run.mark()

    return act


def hit_output(number: int, then: int | None = None) -> Act:
    """Send a signal to the process of the output stage, and another one 1 s later."""

    def act(run: Run) -> None:
        pid = run.output_process()
        os.kill(pid, number)
        if then is not None:
            time.sleep(1.0)
            try:
                os.kill(pid, then)
            except ProcessLookupError:
                pass  # the node has replaced it

    return act


def answers(fault: str, count: int | None = None) -> Act:
    """Let the device misbehave."""
    return lambda run: run.device.break_answers(fault, count)


def pulled(run: Run) -> None:
    """Pull the cable."""
    run.device.refuse()


def restarted(run: Run) -> None:
    """Restart the device at once; its valves keep their set-points."""
    run.device.refuse()
    time.sleep(0.15)
    run.device.listen()


CLOCK_DRIFT = 1e-3
"""Rate at which two clocks may part [s/s]."""


def delayed(rate: float) -> Act:
    """Let the readings age by a rate [s/s]; the promise counts from when they are older than rig_timeout.

    A clock that drifts by 1e-3 looks the same as an age that grows so fast: only the rest of the rate is age.
    """

    def act(run: Run) -> None:
        run.device.drift_from = time.monotonic()
        run.device.drift = rate
        time.sleep(LIMITS["rig_timeout"] / (rate - CLOCK_DRIFT))
        run.mark()

    return act


def fall_silent(run: Run) -> None:
    """Stop commanding."""
    run.operator.pressure = None


def disarm(run: Run) -> None:
    """Call disarm."""
    run.operator.disarm()


def command(*values: float) -> Act:
    """Send a command that must be refused, instead of sound ones; refused ones do not feed the watchdog."""

    def act(run: Run) -> None:
        run.operator.pressure = list(values)

    return act


def command_beside(*values: float) -> Act:
    """Send a command that must be refused beside sound ones."""
    return lambda run: run.operator.publish(list(values), 20)


def to_the_limit(run: Run) -> None:
    """Command the limit itself, which passes."""
    run.operator.pressure = [LIMITS["pressure"]] * 2
    reached = run.until(lambda: min(run.chambers.pressure()) > 0.97e-2 * LIMITS["pressure"], 3.0)
    run.require(reached, "the limit itself was refused")


def early_commands(run: Run) -> None:
    """Send 2000 commands before arm, then arm and command nothing."""
    run.operator.publish([110e3, 110e3], 2000)
    run.arm(5.0)
    time.sleep(0.5)


def late_first_command(run: Run) -> None:
    """Arm, command nothing for 6 s, then send one message."""
    if run.arm():
        time.sleep(6.0)
        run.operator.publish(FULL)


def late_command_after_vent(run: Run) -> None:
    """Fall silent until it is vented, then command again."""
    run.operator.pressure = None
    time.sleep(2.0)
    run.mark()
    run.operator.pressure = FULL


def held_disarm(run: Run) -> None:
    """Arm, which is refused with the pressure, then disarm, which vents."""
    answer = [run.operator.arm()]
    # The link opens a moment after the bridge has started.
    run.until(lambda: "holds" in answer[-1][1] or answer.append(run.operator.arm()), 8.0)
    done, message = answer[-1]
    run.require(not done and "holds 80.0 kPa" in message, f"arm says {message!r}")
    run.mark()
    run.operator.disarm()


def held_vent(run: Run) -> None:
    """Start the one-shot vent."""
    run.start(mode="vent")
    run.mark()
    took = run.bridge.wait(15.0)
    run.require(took is not None, "the one-shot vent did not end")
    # The import of rclpy precedes the vent: the promise counts from the first write.
    if run.chambers.requests:
        run.reference = run.chambers.requests[0][0]


def killed_then(again: Act) -> Act:
    """Kill the node, start another one, and go on with it."""

    def act(run: Run) -> None:
        run.bridge.children()
        run.bridge.send(signal.SIGKILL)
        run.operator.pressure = None
        again(run)

    return act


def restart_disarm(run: Run) -> None:
    """Start a bridge again and disarm."""
    run.start()
    run.until(lambda: run.answers() or run.bridge.exit_status is not None, 20.0)
    run.operator.disarm()


def second_bridge(run: Run) -> None:
    """Start a second bridge to the same device under another name; its arm must be refused."""
    first = run.bridge
    second = run.start()
    second_ready = run.until(lambda: len(second.text()) > 0, 10.0)
    run.require(second_ready, "the second bridge says nothing")
    time.sleep(3.0)
    run.bridges.remove(second)
    run.bridges.insert(0, second)
    assert run.bridge is first


def starved(loops: int, seconds: float) -> Act:
    """Starve the node and its children beside busy loops, with silence of the operator in between."""

    def act(run: Run) -> None:
        busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(loops)]
        try:
            time.sleep(0.3 * seconds)
            run.mark()
            run.operator.pressure = None
            time.sleep(max(0.2 * seconds, PROMISE))
            vented = time.monotonic()
            run.operator.pressure = FULL
            time.sleep(0.5 * seconds)
            highest = run.chambers.highest(vented, time.monotonic())
            run.require(highest < 60.0, f"{highest:.0f} mbar returned without arming")
            run.operator.pressure = None
            run.mark()
        finally:
            for process in busy:
                process.kill()
                process.wait()

    return act


def mirror_under_load(run: Run) -> None:
    """Let the tracker leap beside busy loops, press Ctrl-C, and look at the bags."""
    busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(4)]
    try:
        time.sleep(10.0)
        run.bridge.send(signal.SIGINT)
        took = run.bridge.wait(10.0)
        run.require(took is not None and took <= END_TIME, f"it ended {took} s after Ctrl-C")
    finally:
        for process in busy:
            process.kill()
            process.wait()
    for bag in ("twin", "rig"):
        metadata = run.folder / "bags" / bag / "metadata.yaml"
        run.require(metadata.exists(), f"the bag {bag} has no metadata")


def throttled(run: Run) -> None:
    """Stop and continue the node in turn, 0.3 s of 0.4 s, for 4 s."""
    for _ in range(10):
        run.bridge.send(signal.SIGSTOP)
        time.sleep(0.3)
        run.bridge.send(signal.SIGCONT)
        time.sleep(0.1)
    run.operator.pressure = None
    run.mark()


def full_disk(run: Run) -> None:
    """Let no file of the node grow beyond 100 kB, as on a full disk; the arms go on or vent."""
    resource.prlimit(run.bridge.process.pid, resource.RLIMIT_FSIZE, (100_000, 100_000))
    time.sleep(3.0)


def start_only(**parameters: object) -> Act:
    """Start a bridge that must refuse to."""
    return lambda run: run.start(**parameters) and None


def start_with_file(text: str) -> Act:
    """Start a bridge with a parameter file."""

    def act(run: Run) -> None:
        path = run.folder / "bridge.yaml"
        path.write_text(text)
        words = ("ldcs_ros.ros", "bridge", "--ros-args", "--params-file", str(path))
        from bridge_process import BridgeProcess

        run.bridges.append(BridgeProcess(run.environment, *words))

    return act


def late_answers(run: Run) -> None:
    """Let each answer come 0.3 s late."""
    run.device.delay = 0.3
    run.device.break_answers("delayed")


def ignored(fault: str) -> Act:
    """Let the device ignore set-points, by the name of its fault, and command others."""

    def act(run: Run) -> None:
        run.device.break_answers(fault)
        run.operator.pressure = [40e3, 40e3]

    return act
