"""The wall clock of the machine jumps: time in the twin, its watchdog and its bag go by the steady clock."""

from __future__ import annotations

import shutil
import signal
import struct
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from load_session import CLOUD, Session, counts

from ldcs_ros.bags import read_bag
from ldcs_ros.messages import messages

pytestmark = pytest.mark.timed

COMPILER = shutil.which("cc")
JUMPS = (3600, -86_400, 0)  # s off the true time: an hour on, a day and an hour back, right again


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_jumps_of_the_wall_clock_change_neither_pace_nor_watchdog_nor_bag(tmp_path, monkeypatch):
    library, offset = tmp_path / "jumping_clock.so", tmp_path / "offset"
    source = Path(__file__).with_name("jumping_clock.c")
    subprocess.run([COMPILER, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    offset.write_bytes(struct.pack("<q", 0))
    with monkeypatch.context() as patch:
        patch.setenv("LD_PRELOAD", str(library))
        patch.setenv("JUMPING_CLOCK", str(offset))
        session = Session(tmp_path, scene="rig", record="bag", command_timeout=2.0)
    with session:
        stamps = []
        session.user.node.create_subscription(
            CLOUD, "/ldcs/nodes", lambda cdr, info: stamps.append(info["source_timestamp"]), 10, raw=True
        )
        publisher = session.publisher("pressure_command", "std_msgs/msg/Float64MultiArray")
        before, start = session.health()["simulation"], time.monotonic()
        for k, jump in enumerate(JUMPS):
            publisher.publish(messages.pressure_command([1e4 * (k + 1)]))
            session.user.until(lambda: stamps)
            with open(offset, "r+b") as file:
                file.write(struct.pack("<q", jump))
            known = stamps[-1]
            session.user.until(lambda known=known: abs(stamps[-1] - known) > 1e9 * 1000)  # it has jumped
            publisher.publish(messages.pressure_command([1e4 * (k + 1) + 1.0]))
            session.user.spin(0.4)
        health, elapsed = session.settled(2 * len(JUMPS)), time.monotonic() - start
        advanced = float(health["simulation"]["simulation time [s]"]) - float(before["simulation time [s]"])
        lost = int(health["simulation"]["overruns"]) - int(before["overruns"])
        assert advanced == pytest.approx(elapsed, abs=0.15 + 0.1 * lost)
        assert health["watchdog"]["trips"] == "0"
        assert counts(health) == (2 * len(JUMPS), 0, 0)
        assert session.node.stop(signal.SIGINT) == 0
    times = read_bag(tmp_path / "bag").channels["/ldcs/nodes"].times
    assert np.array_equal(np.diff(times), np.full(len(times) - 1, 20_000_000))
