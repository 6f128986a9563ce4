"""The bag of a live run: begun, begun over, and its trouble told once; a run goes on without one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ldcs_ros.errors import RecordingError
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.twin import Twin


class RecordingSession:
    """Keeps the recorder of a twin.

    Args:
        logger: Where trouble is told.

    Attributes:
        recorder: What records, if anything does.
        error: Why nothing is recorded although it was asked for; '' otherwise.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self.recorder: Recorder | None = None
        self.error = ""

    def start(self, folder: str, twin: Twin, namespace: str) -> None:
        """Record a twin into a bag folder; '' for no bag."""
        self.error = ""
        if not folder:
            return
        try:
            self.recorder = Recorder(folder, twin, namespace=namespace)
            twin.sinks.append(self.recorder)
            self._logger.info(f"recording to {folder}")
        except RecordingError as error:
            self.error = str(error)
            self._logger.error(f"not recording: {error}")

    def watch(self) -> None:
        """Tell that the disk ended the recording: once here, and `error` says it all along."""
        if self.recorder is not None and self.recorder.error is not None and not self.error:
            self.error = self.recorder.error
            self._logger.error(self.error)

    def start_next(self, twin: Twin) -> None:
        """End the bag and begin the next one, as the twin goes back to its start."""
        self._go_on(twin, Recorder.start_next)

    def change_twin(self, old: Twin, new: Twin) -> None:
        """End the bag of a twin and begin one of another."""
        recorder = self.recorder
        if recorder is not None:
            old.sinks.remove(recorder)
            new.sinks.append(recorder)
        self._go_on(new, lambda recorder: recorder.change_twin(new))

    def close(self) -> None:
        """End the bag."""
        if self.recorder is not None:
            self.recorder.close()
            self.recorder = None

    def _go_on(self, twin: Twin, begin: Callable[[Recorder], None]) -> None:
        if self.recorder is None:
            return
        try:
            begin(self.recorder)
            self.error = ""
        except RecordingError as error:
            twin.sinks.remove(self.recorder)
            self.recorder, self.error = None, str(error)
            self._logger.error(f"recording stopped: {error}")
