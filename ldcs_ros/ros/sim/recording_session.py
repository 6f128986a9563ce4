"""The bag of a live run, and the next one after a reset; its errors are reported once and end no run."""

from __future__ import annotations

from collections.abc import Callable

from ldcs_ros.errors import RecordingError
from ldcs_ros.ros.common.log import Logger
from ldcs_ros.twin.recorder import Recorder
from ldcs_ros.twin.twin import Twin


class RecordingSession:
    """The recorder of a live twin, bag after bag.

    Args:
        logger: Logger of errors.

    Attributes:
        recorder: The recorder; None for none.
        error: Reason why not all is recorded although a recording was asked for; '' otherwise.
        failure: The first such error of all recordings; '' while there was none.
    """

    def __init__(self, logger: Logger) -> None:
        self._logger = logger
        self.recorder: Recorder | None = None
        self.error = ""
        self.failure = ""

    def start(self, folder: str, twin: Twin, namespace: str) -> None:
        """Record a twin into a bag folder; '' for no bag.

        Raises:
            RecordingError: The recording cannot begin.
        """
        self.error = ""
        if folder:
            self.recorder = Recorder(folder, twin, namespace=namespace)
            twin.sinks.append(self.recorder)
            self._logger.info(f"recording to {folder}")

    def watch(self) -> None:
        """Log once that the disk ended the recording; `error` keeps the reason."""
        if self.recorder is not None and self.recorder.error is not None and not self.error:
            self._report(self.recorder.error)

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
            self.watch()
            self.recorder = None

    def _go_on(self, twin: Twin, begin: Callable[[Recorder], None]) -> None:
        if self.recorder is None:
            return
        try:
            self.watch()
            begin(self.recorder)
            self.error = ""
        except RecordingError as error:
            twin.sinks.remove(self.recorder)
            self.recorder = None
            self._report(f"recording stopped: {error}")

    def _report(self, error: str) -> None:
        self.error, self.failure = error, self.failure or error
        self._logger.error(error)
