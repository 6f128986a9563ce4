"""Random Modbus answers and random serial lines against the output stage, in process and without waiting.

    python tools/attack/random_answers.py --count 100000

A stage survives when no step raises and a sound device afterwards confirms a set-point of zero.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from island import Island
from serial_device import SerialDevice, line

from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.device import Device
from ldcs_ros.rig.output.modbus import ModbusDevice, ModbusMap
from ldcs_ros.rig.output.serial_line import SerialDevice as SerialClient
from ldcs_ros.rig.output.serial_line import SerialSettings
from ldcs_ros.rig.output.stage import OutputStage

LIMITS = Limits(pressure=120e3)
_KINDS = ("S", "A", "E", "P", "", "s", "\x00", "S" * 300)
_BATCH = 4  # lines: a terminal holds 4 kB
_CONFIRMATION = 20.0  # s


def random_modbus(count: int, seed: int = 1) -> int:
    """Answer a stage with random frames until there were `count`; return how many steps it took.

    Raises:
        AssertionError: Zero was not confirmed by the sound island afterwards, or a set-point left the limits.
    """
    island = Island(seed)
    try:
        registers = ModbusMap("127.0.0.1", island.port, timeout=0.02, clock=10, heartbeat=2)
        stage = _stage(ModbusDevice(registers, LIMITS, time.monotonic))
        island.break_answers("random answers")
        steps = 0
        while island.answered < count:
            stage.set_target([80e3, 80e3], steps, time.monotonic())
            stage.step()
            steps += 1
        island.heal()
        _confirm(stage)
        _check([value for _, *pair in island.chambers.requests for value in pair])
        return steps
    finally:
        island.close()


def random_lines(count: int, seed: int = 1) -> int:
    """Send a stage random lines, most with a valid checksum; return how many lines came.

    Raises:
        AssertionError: Zero was not confirmed by the sound device afterwards, or a set-point left the limits.
    """
    source = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        device = SerialDevice(Path(folder))
        try:
            device.break_answers("silent")
            client = SerialClient(SerialSettings(str(device.path)), LIMITS.arms, time.monotonic)
            stage = _stage(client)
            stage.step()
            received, asked = 0, 0
            while received < count:
                asked += _BATCH
                assert asked < 3 * count, f"only {received} of {asked} lines came"
                stage.set_target([80e3, 80e3], asked, time.monotonic())
                device.say(b"".join(_random_line(source) for _ in range(_BATCH)))
                stage.step()
                received += sum(not packet.sent for packet in stage.exchange().packets)
            assert client.malformed > 0.2 * count, "random lines passed as sound ones"
            device.heal()
            _confirm(stage)
            _check([value for _, *pair in device.chambers.requests for value in pair])
            return received
        finally:
            device.close()


def _stage(device: Device) -> OutputStage:
    return OutputStage(device, LIMITS, time.monotonic, commands=True)


def _confirm(stage: OutputStage) -> None:
    stage.end("the attack is over", _CONFIRMATION)
    while not stage.ended:
        time.sleep(min(stage.step(), 0.02))
    assert stage.confirmed, "the sound device confirmed no zero"


def _check(values: list[float]) -> None:
    assert all(0.0 <= value <= LIMITS.pressure * 1e-2 for value in values), "a set-point left the limits"


def _random_line(source: random.Random) -> bytes:
    if source.random() < 0.2:
        return source.randbytes(source.randrange(1, 80)).replace(b"\n", b"") + b"\n"
    words = [source.choice(_KINDS)]
    for _ in range(source.choice((0, 1, 2, 3, 6, 6, 6, 6, 7, 50))):
        words.append(_random_word(source))
    return line(" ".join(words))


def _random_word(source: random.Random) -> str:
    makers: tuple[Callable[[], str], ...] = (
        lambda: str(source.randrange(-(2**40), 2**40)),
        lambda: f"{source.uniform(-1e4, 1e4):.3f}",
        lambda: "9" * source.choice((1, 15, 16, 400)),
        lambda: source.choice(("nan", "inf", "-inf", "1e999", "0x10", "1_0", "", "*", "-", "٣")),
    )
    return source.choice(makers)()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000)
    arguments = parser.parse_args()
    began = time.monotonic()
    print(
        f"{arguments.count} random Modbus answers in {random_modbus(arguments.count)} steps: the stage goes on"
    )
    print(f"{random_lines(arguments.count)} random lines: the stage goes on")
    print(f"{time.monotonic() - began:.0f} s")
