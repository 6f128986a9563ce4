"""Runner: the thread that owns a twin; everything that touches the twin happens there."""

from __future__ import annotations

import enum
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from functools import partial
from typing import TypeVar

from ldcs_ros.errors import DivergenceError
from ldcs_ros.messages.cdr import nanoseconds
from ldcs_ros.ros.common.refusals import InvalidStateError
from ldcs_ros.ros.sim.pacing import PaceMeter, Pacer
from ldcs_ros.twin.commands import Refusal
from ldcs_ros.twin.twin import Twin

Result = TypeVar("Result")
_IDLE_SLEEP = 0.05
_REQUEST_TIMEOUT = 10.0


class RunMode(enum.Enum):
    """The mode of a runner. STOPPED is the scene's start, before the first run, step or pause."""

    STOPPED = "stopped"
    RUNNING = "running"
    PAUSED = "paused"
    FAILED = "failed"
    FINISHED = "finished"


class PeriodicTask:
    """A periodic task of the runner's thread.

    Args:
        period: Wall time between two calls [s].
        task: The task.
        delay: Wall time before the first call [s].
    """

    def __init__(self, period: float, task: Callable[[], None], *, delay: float = 0.0) -> None:
        self._period = period
        self._task = task
        self._next = time.monotonic() + delay

    def run_if_due(self) -> None:
        """Run the task if it is due; missed times are skipped."""
        now = time.monotonic()
        if now >= self._next:
            self._next = max(self._next + self._period, now)
            self._task()


class Runner:
    """Advances a twin in real time (or as fast as it can) and serves requests in between.

    Commands that arrive take effect after the next event, so that no command acts before its arrival.

    Args:
        twin: The twin.
        pacer: Pacer of its events.
        duration: Simulation time at which it finishes [s]; 0 for never.
        on_failure: Called with the reason when the simulation cannot go on.
        on_finish: Called when the duration is over.
        on_reset: Called on the runner's thread before the twin goes back to its start.

    Attributes:
        mode: Its present mode.
        failure: Reason why the simulation cannot go on; '' while it can.
        refusal_reason: Reason why commands are refused at present; '' while they are taken.
        periodic_tasks: Called on the runner's thread from time to time; filled before `start`.
        meter: Real-time factor and step times.
    """

    def __init__(
        self,
        twin: Twin,
        pacer: Pacer,
        *,
        duration: float = 0.0,
        on_failure: Callable[[str], None],
        on_finish: Callable[[], None],
        on_reset: Callable[[], None],
    ) -> None:
        self.twin = twin
        self.pacer = pacer
        self.duration = duration
        self.mode = RunMode.STOPPED
        self.failure = ""
        self.refusal_reason = ""
        self.periodic_tasks: list[PeriodicTask] = []
        self.meter = PaceMeter()
        self._on_failure = on_failure
        self._on_finish = on_finish
        self._on_reset = on_reset
        self._commands: deque[tuple[str, bytes]] = deque()
        self._requests: deque[tuple[Callable[[], None], Callable[[], bool]]] = deque()  # run, cancel
        self._wake = threading.Event()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)

    def start(self) -> None:
        """Start the thread; time does not run yet."""
        self.twin.watchdog.suspend()
        self._thread.start()

    def stop(self) -> None:
        """Vent the arms and end the thread."""
        self._stopping = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()

    def post(self, topic: str, cdr: bytes) -> None:
        """Submit a command; it is applied, or refused and counted, after the next event."""
        self._commands.append((topic, cdr))

    def submit(self, function: Callable[[], Result]) -> Future[Result]:
        """Run a function on the runner's thread after earlier requests."""
        future: Future[Result] = Future()

        def run() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                future.set_result(function())
            except Exception as error:
                future.set_exception(error)

        self._requests.append((run, future.cancel))
        self._wake.set()
        return future

    def call(self, function: Callable[[], Result], timeout: float = _REQUEST_TIMEOUT) -> Result:
        """Run a function on the runner's thread and return what it returns.

        Raises:
            InvalidStateError: The thread was busy for the timeout [s]. Exceptions of the function pass.
        """
        future = self.submit(function)
        try:
            return future.result(timeout)
        except FutureTimeoutError as error:
            future.cancel()
            raise InvalidStateError(f"the simulation has been busy for {timeout:g} s; try again") from error

    def pause(self) -> None:
        """Stop time; on the runner's thread."""
        if self.mode in (RunMode.RUNNING, RunMode.STOPPED):
            self.mode = RunMode.PAUSED
            self.twin.watchdog.suspend()

    def resume(self) -> None:
        """Let time go on from where it stopped, without making up for the pause; on the runner's thread.

        Raises:
            InvalidStateError: The simulation has failed and was not reset.
        """
        if self.mode is RunMode.FAILED:
            raise InvalidStateError(f"{self.failure}; call reset")
        if self.mode in (RunMode.PAUSED, RunMode.STOPPED):
            self.mode = RunMode.RUNNING
            self.pacer.reset()
            self.meter.restart(self.twin.time)
            self.twin.solver_report.restart()
            self.twin.watchdog.resume()

    def step(self) -> float:
        """Advance by one publish period while paused and return the new time [s]; on the runner's thread.

        Raises:
            InvalidStateError: It is not paused, or the step failed.
        """
        if self.mode is not RunMode.PAUSED:
            raise InvalidStateError(
                f"the simulation is {self.mode.value}; step works while it is paused, call pause first"
            )
        self._attempt(self.twin.advance_to_report)
        if self.failure:
            raise InvalidStateError(f"{self.failure}; call reset")
        return self.twin.time

    def advance_by(self, duration_ns: int, command: bytes | None) -> float:
        """Apply an `arm_command` now, then advance by a duration [ns] while paused; on the runner's thread.

        Nothing else acts in between, so that the same calls give the same states.

        Returns:
            The new time [s].

        Raises:
            InvalidStateError: The command was refused, the mode is another one, or the simulation cannot go on.
        """
        if self.mode is not RunMode.PAUSED:
            raise InvalidStateError(
                f"the simulation is {self.mode.value}; advance works while it is paused, call pause first"
            )
        twin = self.twin
        if command is not None and (refusal := twin.receive("arm_command", command)):
            raise InvalidStateError(refusal)
        end = (nanoseconds(twin.time) + duration_ns) / 1e9
        self._attempt(lambda: twin.advance_to(end))
        if self.failure:
            raise InvalidStateError(f"{self.failure}; call reset")
        return twin.time

    def reset(self) -> None:
        """Back to the scene's start; runs on unless it was paused; on the runner's thread."""
        running = self.mode in (RunMode.RUNNING, RunMode.FAILED)
        self._go_to_start(self.mode if self.mode is RunMode.STOPPED else RunMode.PAUSED)
        if running:
            self.resume()
        else:
            self._show_start()

    def swap_scene(self, twin: Twin, between: Callable[[], None], *, stop: bool = False) -> None:
        """Go on with another twin from its start, running unless the old one was stopped; on the runner's thread.

        Args:
            twin: The new twin.
            between: Called when the old twin has had its last command.
            stop: Stop, also if the old one ran.
        """
        self._apply_commands()
        running = self.mode in (RunMode.RUNNING, RunMode.FAILED) and not stop
        between()
        twin.commands.count_on(self.twin.commands)
        self.twin = twin
        twin.watchdog.suspend()
        self.mode, self.failure = (
            RunMode.STOPPED if stop or self.mode is RunMode.STOPPED else RunMode.PAUSED,
            "",
        )
        if running:
            self.resume()
        else:
            self._show_start()

    def halt(self) -> None:
        """Stop time at the scene's start; on the runner's thread."""
        self._go_to_start(RunMode.STOPPED)
        self._show_start()

    def _go_to_start(self, mode: RunMode) -> None:
        self._on_reset()
        self.twin.reset()
        self.twin.watchdog.suspend()
        self.mode, self.failure = mode, ""

    def _show_start(self) -> None:
        self._attempt(lambda: self.twin.advance_to(self.twin.time))

    def _run(self) -> None:
        while not self._stopping:
            self._wake.clear()
            self._serve_requests()
            for task in self.periodic_tasks:
                task.run_if_due()
            if self.mode is RunMode.RUNNING:
                self._go_on()
            else:
                self._apply_commands()
                self._wake.wait(_IDLE_SLEEP)
        self.twin.vent(0.0)
        for _, cancel in self._requests:
            cancel()

    def _go_on(self) -> None:
        due = self.twin.next_time
        if 0.0 < self.duration < due:
            self._attempt(lambda: self.twin.advance_to(self.duration))
            self.mode = RunMode.FINISHED if not self.failure else self.mode
            self._on_finish()
            return
        if self.pacer.wait(due, self._wake):
            self.twin.overruns = self.pacer.overruns
            self._attempt(self.twin.advance_to_next)
            self._apply_commands()
            self.twin.check_watchdog()

    def _attempt(self, advance: Callable[[], None]) -> None:
        started = time.perf_counter()
        self._guard(advance)
        self.meter.count(time.perf_counter() - started)

    def _guard(self, function: Callable[[], object]) -> None:
        try:
            function()
        except DivergenceError as error:
            self._fail(str(error))
        except Exception as error:  # whatever it is, the last good state stays and the operator is informed
            self._fail(f"the simulation stopped at t = {self.twin.time:g} s: {error!r}")

    def _fail(self, reason: str) -> None:
        self.mode = RunMode.FAILED
        self.failure = reason
        self.twin.watchdog.suspend()
        self._on_failure(reason)

    def _serve_requests(self) -> None:
        while self._requests:
            run, _ = self._requests.popleft()
            run()

    def _apply_commands(self) -> None:
        while self._commands:
            topic, cdr = self._commands.popleft()
            if self.refusal_reason:
                self.twin.commands.refuse(Refusal("inactive", self.refusal_reason), topic)
            else:
                self._guard(partial(self.twin.receive, topic, cdr))
