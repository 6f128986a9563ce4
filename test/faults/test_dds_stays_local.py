"""Without NETWORK=1 no socket of the node can be reached from another machine; with shared memory there is none."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import pytest
from live import LiveNode, own_domain

ROOT = Path(__file__).resolve().parents[2]
PROFILE = ROOT / "ldcs_ros/config/fastdds_local.xml"


def sockets(pid):
    """Return protocol and local address of each network socket of a process."""
    folder = Path(f"/proc/{pid}/fd")
    links = [os.readlink(link) for link in folder.iterdir()]
    own = {match[1] for link in links if (match := re.fullmatch(r"socket:\[(\d+)\]", link))}
    found = set()
    for kind in ("udp", "udp6", "tcp", "tcp6", "raw", "raw6"):
        table = Path(f"/proc/{pid}/net/{kind}")
        lines = table.read_text().splitlines()[1:] if table.exists() else []
        for fields in map(str.split, lines):
            if fields[9] in own:
                number = fields[1].partition(":")[0]
                # Four bytes of an address, in the order of the machine.
                found.add((kind, ".".join(str(byte) for byte in bytes.fromhex(number)[::-1])))
    return found


@pytest.mark.parametrize(
    ("setting", "value", "addresses"),
    [
        ("FASTDDS_BUILTIN_TRANSPORTS", "SHM", set()),
        # The group of DDS discovery is joined on the loopback interface.
        ("FASTDDS_DEFAULT_PROFILES_FILE", str(PROFILE), {("udp", "127.0.0.1"), ("udp", "239.255.0.1")}),
    ],
)
def test_sockets_are_none_or_on_this_machine(tmp_path, monkeypatch, setting, value, addresses):
    with monkeypatch.context() as patch:
        patch.delenv("FASTDDS_BUILTIN_TRANSPORTS", raising=False)
        patch.setenv(setting, value)
        node = LiveNode(tmp_path / "node.log", own_domain(), scene="single_spring")
    try:
        end = time.monotonic() + 20.0
        while " running" not in node.output and time.monotonic() < end:
            time.sleep(0.05)
        assert sockets(node.process.pid) == addresses
        assert node.stop(signal.SIGINT) == 0
    finally:
        node.end()


def test_make_sim_uses_the_profile_unless_it_is_told_otherwise():
    script = (ROOT / "tools/sim.sh").read_text(encoding="utf-8")
    condition = script.index('if [ "${NETWORK:-0}" != 1 ]; then')
    assert condition < script.index("ldcs_ros/config/fastdds_local.xml") < script.index("exec ")
