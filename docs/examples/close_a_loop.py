"""A closed loop on a running twin: a node brings a point to a height by the pressure of the arms.

Start a twin whose scene has a tracker in one terminal, and this in another one:

    make sim SCENE=rig
    .venv/bin/python docs/examples/close_a_loop.py --point P1 --height 0.030
"""

from __future__ import annotations

import argparse

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

LARGEST = 150e3  # Pa, gauge


class HeightLoop(Node):
    """An integral controller: the pressure rises with the error of the height over simulation time."""

    def __init__(self, point: str, height: float, gain: float) -> None:
        super().__init__("height_loop")
        self.height, self.gain = height, gain
        self.pressure, self.before, self.printed = 0.0, 0.0, 0.0
        self.command = self.create_publisher(Float64MultiArray, "/ldcs/pressure_command", 10)
        self.create_subscription(PoseStamped, f"/ldcs/{point}/pose", self.measured, 10)

    def measured(self, message: PoseStamped) -> None:
        """Answer a measurement of the tracker with a pressure for every arm."""
        time = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        error = self.height - message.pose.position.z
        step = min(max(time - self.before, 0.0), 0.1)  # s; none after a reset, little after a pause
        self.before = time
        self.pressure = min(max(self.pressure + self.gain * error * step, 0.0), LARGEST)
        self.command.publish(Float64MultiArray(data=[self.pressure]))
        if not self.printed <= time < self.printed + 1.0:
            self.printed = time
            print(f"{time:8.2f} s {1e3 * error:+8.2f} mm off {1e-3 * self.pressure:8.1f} kPa", flush=True)


def main() -> None:
    """Run until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--point", default="P1")
    parser.add_argument("--height", type=float, default=0.030, help="in ldcs_base [m]")
    parser.add_argument("--gain", type=float, default=4e6, help="[Pa / (m s)]")
    asked = parser.parse_args()
    rclpy.init()
    try:
        rclpy.spin(HeightLoop(asked.point, asked.height, asked.gain))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
