"""Names of faults: a rig that sends nothing is silent, whichever of its messages was expected first."""

from __future__ import annotations

import re

import pytest

from ldcs_ros.rig.limits import Limits
from ldcs_ros.rig.output.monitor import WriteMonitor

LIMITS = Limits()


class Rig:
    """A rig with a clock; `run` writes at 50 Hz, and the rig answers with what its arguments name."""

    def __init__(self):
        self.now = 100.0
        self.monitor = WriteMonitor(
            LIMITS, lambda: self.now, resolution=100.0, reads_back=True, acknowledges=True
        )

    def run(self, duration, setpoint=50e3, reads=True, reads_back=True, acknowledges=True, refuses=False):
        for _ in range(round(duration / 0.02)):
            self.now += 0.02
            self.monitor.note_sent((setpoint, setpoint))
            for arm in LIMITS.arms:
                if reads_back:
                    self.monitor.note_read_back(arm, setpoint, self.now)
                if reads:
                    self.monitor.note_measured(arm, setpoint, self.now)
            if acknowledges:
                self.monitor.note_acknowledged()
            if refuses:
                self.monitor.note_refused("busy")
        return self.monitor.fault()


NOTHING = {"reads": False, "reads_back": False, "acknowledges": False}


@pytest.mark.parametrize("last", ["acknowledges", "reads", "reads_back"])
def test_a_rig_that_stops_is_silent_whatever_came_last(last):
    rig = Rig()
    assert rig.run(1.0) == ""
    rig.run(0.06, **(NOTHING | {last: True}))
    assert rig.run(0.5 * LIMITS.rig_timeout, **NOTHING) == ""
    assert rig.run(0.6 * LIMITS.rig_timeout, **NOTHING).startswith("the rig is silent for 0.")


def test_a_rig_that_stops_during_a_ramp_is_silent_too():
    rig = Rig()
    rig.run(1.0)
    rig.run(0.06, setpoint=80e3, reads=False, reads_back=False)
    assert rig.run(1.1 * LIMITS.rig_timeout, setpoint=80e3, **NOTHING).startswith("the rig is silent")


@pytest.mark.parametrize(
    ("answers", "fault"),
    [
        ({"acknowledges": False}, "the rig confirms no set-point"),
        ({"acknowledges": False, "reads": False, "reads_back": False, "refuses": True}, "the rig refuses"),
        ({"reads_back": False}, "the rig reports no set-points"),
    ],
)
def test_a_rig_that_answers_in_part_has_a_fault_of_its_own(answers, fault):
    rig = Rig()
    rig.run(1.0)
    # Their time is that since the last good answer.
    assert re.match(f"{fault}.* for 0.4[0-9] s", rig.run(1.1 * LIMITS.rig_timeout, **answers))


def test_a_rig_that_never_answered_is_silent():
    assert Rig().run(1.1 * LIMITS.rig_timeout, **NOTHING).startswith("the rig is silent")
