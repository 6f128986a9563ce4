"""The process around a node: signals, rclpy, spinning, exit status."""

from __future__ import annotations

import os
import sys
import threading
import traceback
from collections.abc import Callable
from typing import Any, Protocol

from ldcs_ros.errors import LdcsError
from ldcs_ros.ros.common.security import check_security
from ldcs_ros.ros.common.stop_signals import StopSignals

# How long a thread may hold the interpreter while another one, with a deadline, waits for it [s].
_SWITCH_INTERVAL = 5e-4
_SPIN_PERIOD = 0.1


class Stoppable(Protocol):
    """What `run` expects of a node."""

    finished: threading.Event
    failure: str

    def stop(self) -> None:
        """End the work; may be called again."""

    def destroy_node(self) -> None:
        """Leave the graph."""


def run(name: str, load: Callable[[], Callable[[], Any]], arguments: list[str] | None) -> int:
    """Run a node until it has finished, Ctrl-C or SIGTERM; return the exit status.

    Args:
        name: What errors are prefixed with.
        load: Imports what the node needs and returns what makes it.
        arguments: Arguments for ROS; None for those of the process.

    Returns:
        0 after a clean end, also by a signal; 1 when the node failed; 2 for input that cannot be used.
    """
    signals = StopSignals()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        return _run(name, load, arguments, signals)
    finally:
        signals.ignore()


def _run(
    name: str, load: Callable[[], Callable[[], Any]], arguments: list[str] | None, signals: StopSignals
) -> int:
    try:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        make = load()
    except ImportError as error:
        advice = "run `make setup`, or source a ROS 2 distribution that has the packages of package.xml"
        print(f"{name}: {error}; {advice}", file=sys.stderr)
        return 2
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
        executor.add_node(node)
        while not signals.requested.is_set() and not node.finished.is_set():
            try:
                executor.spin_once(timeout_sec=_SPIN_PERIOD)
            except Exception:
                # Requests come from anybody, and rclpy's own services fail at some: that ends no run.
                if not rclpy.ok():
                    raise
                node.get_logger().error(traceback.format_exc())
        return 1 if node.failure else 0
    finally:
        if node is not None:
            node.stop()
            node.destroy_node()
        rclpy.try_shutdown()
