"""`ros2 run ldcs_ros sim`: starts the live twin, spins it and ends it cleanly."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from ldcs_ros.ros.stop_signals import StopSignals

if TYPE_CHECKING:
    from ldcs_ros.ros.simulation_node import SimulationNode

# How long a thread may hold the interpreter while another one, with a deadline, waits for it [s].
_SWITCH_INTERVAL = 5e-4
_SPIN_PERIOD = 0.1


def main(arguments: list[str] | None = None) -> int:
    """Run the node until its duration is over, Ctrl-C or SIGTERM; return the exit status.

    0 after a clean end, also by a signal; 2 for input that cannot be used.
    """
    signals = StopSignals()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        return _run(arguments, signals)
    finally:
        signals.ignore()


def _run(arguments: list[str] | None, signals: StopSignals) -> int:
    # They take a second to load: a signal meanwhile must find its handler.
    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from ldcs_ros.ros.simulation_node import SimulationNode
    except ImportError as error:
        advice = "run `make setup`, or source a ROS 2 distribution that has the packages of package.xml"
        print(f"sim: {error}; {advice}", file=sys.stderr)
        return 2
    signals.loading = False
    node = None
    try:
        # Every refusal of ROS itself is one of these: bad arguments, bad names, bad parameters.
        try:
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            node = SimulationNode()
        except (RuntimeError, ValueError, TypeError, rclpy.exceptions.ParameterException) as error:
            print(f"sim: {error}", file=sys.stderr)
            return 2
        return _spin(node, signals)
    finally:
        if node is not None:
            node.stop()
            node.destroy_node()
        rclpy.try_shutdown()


def _spin(node: SimulationNode, signals: StopSignals) -> int:
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.lifecycle import TransitionCallbackReturn

    done = TransitionCallbackReturn.SUCCESS
    if node.get_parameter("autostart").value:
        if node.trigger_configure() is not done or node.trigger_activate() is not done:
            print(f"sim: {node.problem or 'the node could not be started'}", file=sys.stderr)
            return 2
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not signals.requested.is_set() and not node.finished.is_set():
        executor.spin_once(timeout_sec=_SPIN_PERIOD)
    return 0


if __name__ == "__main__":
    sys.exit(main())
