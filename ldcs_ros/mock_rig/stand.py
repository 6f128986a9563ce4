"""The stand-in rig at work: a thread that keeps it at the present and lets its transports speak."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any, Protocol

from ldcs_ros.mock_rig.rig import MockRig
from ldcs_ros.schema.reader import write_yaml

_PERIOD = 0.005


class Speaker(Protocol):
    """One transport of the rig."""

    def start(self) -> None: ...
    def stop(self) -> None: ...
    def work(self) -> None: ...
    def describe(self) -> dict[str, Any]: ...


class Stand:
    """Runs a rig and its speakers.

    Args:
        rig: The rig.
        speakers: Its transports.

    Attributes:
        failure: Why the rig stopped; '' while it runs.
    """

    def __init__(self, rig: MockRig, speakers: Sequence[Speaker]) -> None:
        self.rig, self._speakers = rig, speakers
        self.failure = ""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rig", daemon=True)

    def start(self) -> None:
        """Open the transports and let time run; raises LinkError."""
        for speaker in self._speakers:
            speaker.start()
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._stopping.set()
        self._thread.join(5.0)
        for speaker in self._speakers:
            speaker.stop()

    def rig_file(self, limits: dict[str, float]) -> str:
        """Return the text of a rig file that connects to this rig."""
        links = [speaker.describe() for speaker in self._speakers]
        content = {"title": "The stand-in rig", "limits": limits, "links": links}
        return write_yaml(content)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self.rig.advance()
            except Exception as error:  # whatever it is, the operator of the stand is told
                self.failure = str(error)
                return
            for speaker in self._speakers:
                speaker.work()
            self._stopping.wait(max(0.0, _PERIOD - (time.monotonic() % _PERIOD)))
