"""Mirror: in mode mirror, measurements pull an estimate of the whole surface to the rig."""

from __future__ import annotations

from ldcs_ros.bridge.intake import Sample
from ldcs_ros.interface.diagnostics import OK, Status
from ldcs_ros.interface.twin import Twin


class Mirror:
    def __init__(self, twin: Twin) -> None:
        self._twin = twin

    def take(self, sample: Sample, time: float) -> None: ...

    def report(self, time: float) -> None: ...

    def status(self) -> Status:
        return Status("mirror", OK, "")
