"""The server of the mock rig: a thread that advances it in real time and serves its transports."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from ldcs_ros.mock_rig.rig import MockRig
from ldcs_ros.rig.limits import PerArm
from ldcs_ros.schema.reader import write_yaml

_PERIOD = 0.005


class Transport(Protocol):
    """One transport of the rig."""

    def start(self) -> None: ...
    def stop(self) -> None: ...
    def work(self) -> None: ...
    def describe(self) -> dict[str, Any]: ...


class MockRigServer:
    """A mock rig in real time, with its transports.

    Args:
        rig: The rig.
        transports: Its transports.

    Attributes:
        failure: Reason why the rig stopped; '' while it runs.
    """

    def __init__(self, rig: MockRig, transports: Sequence[Transport]) -> None:
        self.rig, self._transports = rig, transports
        self.failure = ""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rig", daemon=True)

    def start(self) -> None:
        """Open the transports and let time run; raises LinkError."""
        for transport in self._transports:
            transport.start()
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._stopping.set()
        self._thread.join(5.0)
        for transport in self._transports:
            transport.stop()

    def rig_file(self, limits: Mapping[str, PerArm]) -> str:
        """Return the text of a rig file that connects to this rig."""
        links = [transport.describe() for transport in self._transports]
        arms = list(self.rig.simulation.arm_names)
        content = {"title": "The mock rig", "arms": arms, "limits": limits, "links": links}
        return write_yaml(content)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self.rig.advance()
            except Exception as error:  # whatever it is, the operator reads it
                self.failure = str(error)
                return
            for transport in self._transports:
                transport.work()
            self._stopping.wait(max(0.0, _PERIOD - (time.monotonic() % _PERIOD)))
