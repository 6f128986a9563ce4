"""Ctrl-C and SIGTERM as a request that the node grants when it can."""

from __future__ import annotations

import os
import signal
import threading
from types import FrameType

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """Notes that somebody wants the process to end; nothing is interrupted.

    Under make or `ros2 run` a Ctrl-C comes twice: the second one must not cut short what the first one began.

    Attributes:
        requested: Set by the first signal.
        loading: While True, a signal ends the process at once: there is nothing to close, and an exception out
            of the middle of an import would end in a traceback, or be lost.
    """

    def __init__(self) -> None:
        self.requested = threading.Event()
        self.loading = True
        for number in STOP_SIGNALS:
            signal.signal(number, self._handle)

    def ignore(self) -> None:
        """Ignore further signals: the interpreter, while it ends, would let them kill the process."""
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.loading:
            os._exit(0)
        self.requested.set()
