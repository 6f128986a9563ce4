"""The process around a node: stop signals, security of its environment, rclpy, spinning, exit status."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from types import FrameType
from typing import TYPE_CHECKING, Protocol, cast

from ldcs_ros import extras
from ldcs_ros.errors import LdcsError, one_line

if TYPE_CHECKING:
    from rclpy.node import Node

    from ldcs_ros.ros.common.log import Logger
    from ldcs_ros.ros.common.parameters import NodeParameter


def _present(*names: str) -> tuple[signal.Signals, ...]:
    # Windows has few of them.
    return tuple(getattr(signal, name) for name in names if hasattr(signal, name))


STOP_SIGNALS = _present("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
"""Ctrl-C, an orderly end, a closed terminal, Ctrl-\\: each ends the node in order."""
IGNORED_SIGNALS = _present("SIGUSR1", "SIGUSR2")
"""By default they would kill the process, and with it the order of its end."""


class StopSignals:
    """A record of stop signals; nothing is interrupted.

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
        for number in IGNORED_SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def ignore(self) -> None:
        """Ignore further signals: the interpreter, while it ends, would let them kill the process."""
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.loading:
            os._exit(0)
        self.requested.set()


def check_security(environment: Mapping[str, str]) -> str:
    """Return a warning, or ''.

    With ROS_SECURITY_STRATEGY=Enforce ROS refuses to run unprotected; otherwise it runs unprotected silently.

    Raises:
        LdcsError: Security is enforced without a keystore, which ROS does not report clearly.
    """
    if environment.get("ROS_SECURITY_ENABLE") != "true":
        return ""
    enforced = environment.get("ROS_SECURITY_STRATEGY") == "Enforce"
    if not environment.get("ROS_SECURITY_KEYSTORE"):
        trouble = "ROS_SECURITY_ENABLE is true, but ROS_SECURITY_KEYSTORE names no keystore"
        if enforced:
            raise LdcsError(f"{trouble}; make one, see docs/security.md, or unset ROS_SECURITY_ENABLE")
        return f"{trouble}: this node runs unprotected; ROS_SECURITY_STRATEGY=Enforce refuses that"
    if not enforced:
        return (
            "ROS_SECURITY_STRATEGY is not Enforce: a node that finds no keys of its enclave runs unprotected; "
            "set ROS_SECURITY_STRATEGY=Enforce"
        )
    return ""


# Longest time that a thread keeps the interpreter from one with a deadline [s].
_SWITCH_INTERVAL = 5e-4
_SPIN_PERIOD = 0.1


class RunnableNode(Protocol):
    """A node that `run` can run."""

    finished: threading.Event

    @property
    def failure(self) -> str:
        """The reason of a failure; '' otherwise."""

    def stop(self) -> None:
        """End the work; may be called again."""

    def destroy_node(self) -> None:
        """Leave the graph."""

    def get_logger(self) -> Logger:
        """Return the log of the node."""


def own_words(arguments: list[str]) -> list[str]:
    """Return the words outside of `--ros-args ... --`, which are not for ROS."""
    own, for_ros = [], False
    for word in arguments:
        if word in ("--ros-args", "--"):
            for_ros = word == "--ros-args"
        elif not for_ros:
            own.append(word)
    return own


def unknown_word(words: list[str]) -> str:
    """Return the error of the first of some words; '' without words. ROS would drop them silently."""
    if not words:
        return ""
    name, assigned, value = words[0].partition(":=")
    if assigned:
        form = "-r" if name.startswith("__") else "-p"
        return f"got {words[0]!r}, expected --ros-args {form} {name}:={value}"
    return f"got {words[0]!r}, expected --help, or --ros-args with -p NAME:=VALUE or --params-file FILE"


def help_text(name: str, parameters: Mapping[str, NodeParameter]) -> str:
    """Return usage and parameters of a node."""
    lines = [
        f"usage: {name} [--help] [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r __ns:=NAMESPACE]]",
        "",
        "parameters:",
    ]
    for parameter in parameters.values():
        default = (
            str(parameter.default).lower() if isinstance(parameter.default, bool) else repr(parameter.default)
        )
        lines.append(f"  {parameter.name} (default {default})\n      {parameter.description}")
    return "\n".join(lines)


class _RosMissing(Exception):
    """A package of ROS, or one that a node needs, cannot be imported."""


@contextlib.contextmanager
def _imports_of_ros() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        # An import that fails in C says so in several lines.
        raise _RosMissing(one_line(error)) from error


def run(
    name: str,
    load: Callable[[], Callable[[], RunnableNode]],
    arguments: list[str] | None,
    parameters: Callable[[], Mapping[str, NodeParameter]],
) -> int:
    """Run a node until it has finished, Ctrl-C or SIGTERM; return the exit status. `--help` starts nothing.

    Args:
        name: Prefix of errors.
        load: Imports the modules of the node and returns its constructor.
        arguments: Arguments for ROS; None for those of the process.
        parameters: Imports and returns the parameters of the node, for the help.

    Returns:
        0 after a clean end, also by a signal; 1 when the node failed; 2 for invalid input.
    """
    signals = StopSignals()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    words = own_words(sys.argv[1:] if arguments is None else arguments)
    try:
        if "--help" in words or "-h" in words:
            with _imports_of_ros():
                known = parameters()
            print(help_text(name, known))
            return 0
        if unknown := unknown_word(words):
            print(f"{name}: {unknown}", file=sys.stderr)
            return 2
        return _run(name, load, arguments, signals)
    except _RosMissing as error:
        print(f"{name}: {error}; {ros_advice()}", file=sys.stderr)
        return 2
    finally:
        signals.ignore()


def ros_advice() -> str:
    """Return what this user can run where packages of ROS are missing."""
    command = "make setup" if extras.in_checkout() else extras.advice("ros", "ros-rclpy")
    return f"source a ROS 2 distribution that has the packages of package.xml, or run `{command}`"


def _run(
    name: str,
    load: Callable[[], Callable[[], RunnableNode]],
    arguments: list[str] | None,
    signals: StopSignals,
) -> int:
    with _imports_of_ros():
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        make = load()
    signals.loading = False
    node = None
    try:
        # Every refusal of ROS itself is one of these: bad arguments, bad names, bad parameters.
        try:
            warning = check_security(os.environ)
            if warning:
                print(f"{name}: {warning}", file=sys.stderr)
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            node = make()
        except (LdcsError, RuntimeError, ValueError, TypeError, rclpy.exceptions.ParameterException) as error:
            print(f"{name}: {error}", file=sys.stderr)
            return 2
        executor = SingleThreadedExecutor()
        executor.add_node(cast("Node", node))
        while not signals.requested.is_set() and not node.finished.is_set():
            try:
                executor.spin_once(timeout_sec=_SPIN_PERIOD)
            except Exception:
                # Any node sends requests, and rclpy's own services raise on some: that ends no run.
                if not rclpy.ok():
                    raise
                node.get_logger().error(traceback.format_exc())
        before = node.failure
        node.stop()
        if node.failure != before:
            # The end itself failed: the last line on the terminal says so.
            with contextlib.suppress(OSError):  # the terminal may be gone
                print(f"{name}: {node.failure}", file=sys.stderr, flush=True)
        return 1 if node.failure else 0
    finally:
        if node is not None:
            node.stop()
            node.destroy_node()
        rclpy.try_shutdown()
