"""A one-shot vent of a rig: no twin, no arming; it ends with a confirmed zero, or says what is left."""

from __future__ import annotations

import time
from collections.abc import Callable

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.output.limiter import OutputState
from ldcs_ros.rig.rig_file import RigFile

START_TIME = 20.0
"""Time that an output process may take to start on a busy machine [s]."""
CONNECT_TIME = 2.0
"""Time from then on to the connection with the device [s]."""


def vent_rig(
    rig: RigFile,
    *,
    show: Callable[[str], None] = lambda line: None,
) -> str:
    """Ramp a rig's set-points to zero and wait until the rig confirms zero.

    Args:
        rig: The rig.
        show: Takes a line on what is going on, twice per second.

    Returns:
        Which arms may hold pressure, in words; '' after a confirmed zero.

    Raises:
        BridgeError: No link of the rig file takes set-points.
    """
    clock = time.monotonic
    links = [link for link in rig.connect(clock, commands=True) if link.commands]
    if not links:
        raise BridgeError(
            "no link of the rig file takes set-points; expected modbus, serial, or topics with send"
        )
    (link,) = links
    link.start(vent="vent asked for by the operator")
    patience = CONNECT_TIME + rig.limits.command_timeout + rig.limits.vent_time
    end, started = clock() + START_TIME + patience, False
    next_line = clock()
    try:
        while clock() < end and not link.status.zero_confirmed:
            if not started and link.status.state == OutputState.VENTED.value:
                started, end = True, clock() + patience
            if clock() >= next_line:
                next_line += 0.5
                show(link.status.holding or link.error or "waiting for a confirmed zero")
            time.sleep(0.02)
    except KeyboardInterrupt:
        show("the vent goes on to its end")
    return link.stop()
