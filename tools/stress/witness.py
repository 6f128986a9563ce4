"""An empty loop beside a node: what it misses of its deadlines is the machine's doing, not the node's."""

from __future__ import annotations

import subprocess
import sys

from load_session import as_urgent_as_this

LOOP = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background starts with it ignored
period, tolerance = float(sys.argv[1]), float(sys.argv[2])
late = worst = 0.0
start, k, anchor = time.monotonic(), 0, time.monotonic()
try:
    print(flush=True)
    while True:
        k += 1
        time.sleep(max(0.0, anchor + k * period - time.monotonic()))
        behind = time.monotonic() - anchor - k * period
        worst = max(worst, behind)
        if behind > tolerance:
            late, k, anchor = late + 1, 0, time.monotonic()
except KeyboardInterrupt:
    print(int(late), worst)
"""


class Witness:
    """A process that only sleeps from deadline to deadline, as often and as tolerant as the node.

    Args:
        rate: Deadlines a second [Hz].
        tolerance: Lateness that is not yet an overrun [s].
    """

    def __init__(self, rate: float, tolerance: float = 0.02) -> None:
        command = [sys.executable, "-c", LOOP, str(1.0 / rate), str(tolerance)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
        as_urgent_as_this(self._process.pid)
        assert self._process.stdout is not None
        self._process.stdout.readline()

    def end(self) -> tuple[int, float]:
        """Return its overruns and its worst lateness [s]."""
        self._process.send_signal(2)
        late, worst = self._process.communicate(timeout=10.0)[0].split()
        return int(late), float(worst)
