"""Bridge and mock rig as processes, and a plain ROS user beside them that operates both."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

from live import PlainUser, own_domain
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_msgs.msg import Float64MultiArray

RIG, BRIDGE = "/mock_rig", "/ldcs/ldcs_bridge"


class Process:
    """A node in its own process group."""

    def __init__(self, program, log, domain, **parameters):
        self.log = log
        command = [sys.executable, "-m", "ldcs_ros.ros", program, "--ros-args"]
        for name, value in parameters.items():
            command += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        with open(log, "w") as stream:
            self.process = subprocess.Popen(
                command,
                env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
                stdout=stream,
                stderr=stream,
                start_new_session=True,
            )

    def interrupt(self):
        """Ctrl-C, as a terminal sends it; return the exit status."""
        os.killpg(self.process.pid, signal.SIGINT)
        return self.process.wait(15.0)

    def end(self):
        """End every process."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait(10.0)


class Pair:
    """The mock rig and a bridge to it."""

    def __init__(self, folder, transport, scene, *, mode, controller="remote", **bridge):
        self.domain = own_domain()
        self.rig_file = folder / "rig.yaml"
        self.rig = Process(
            "mock_rig",
            folder / "rig.log",
            self.domain,
            transport=transport,
            controller=controller,
            scene=scene,
            rig_file=self.rig_file,
        )
        self.user = PlainUser(self.domain)
        self.user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
        self.user.listen("/mock_rig/chambers", "std_msgs/Float64MultiArray")
        self.user.until(self.rig_file.exists, 20.0)
        self.bridge = Process(
            "bridge",
            folder / "bridge.log",
            self.domain,
            rig=self.rig_file,
            scene=scene,
            mode=mode,
            **bridge,
        )
        self.commands = self.user.node.create_publisher(Float64MultiArray, "/ldcs/pressure_command", 10)
        self.operator = None
        self.user.node.create_timer(0.02, self._command)

    def close(self):
        for process in (self.bridge, self.rig):
            process.end()
        self.user.close()

    def break_rig(self, name, value):
        """Turn a fault of the rig."""
        parameter = Parameter(f"fault_{name}", value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        response = self.user.call(f"{RIG}/set_parameters", SetParameters, request)
        assert response.results[0].successful, response.results[0].reason

    def call(self, service):
        """Call a service of the bridge."""
        return self.user.call(f"{BRIDGE}/{service}")

    def seen(self):
        """Level, message and values of each entry of the latest diagnostics."""
        messages = self.user.received["/diagnostics"]
        if not messages:
            return {}
        return {
            status.name.removeprefix(f"{BRIDGE}: "): (
                ord(status.level),
                status.message,
                {pair.key: pair.value for pair in status.values},
            )
            for status in messages[-1].status
        }

    def chambers(self):
        """True pressures [Pa]: left, right, the largest so far, smallest and largest set-point asked for."""
        return self.user.next("/mock_rig/chambers").data

    def arm(self, timeout=20.0):
        """Arm as soon as the bridge lets one."""
        end = time.monotonic() + timeout
        while True:
            answer = self.call("arm")
            if answer.success:
                return
            assert time.monotonic() < end, answer.message
            self.user.spin(0.1)

    def _command(self):
        if self.operator is not None:
            self.commands.publish(Float64MultiArray(data=self.operator))
