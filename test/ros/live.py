"""A node under test in a process of its own, and a plain ROS user beside it that knows nothing of this package."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from collections import defaultdict
from importlib import import_module

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

_numbers = itertools.count()


def own_domain():
    """A ROS domain of this test alone, also beside other test runs on the machine."""
    return 10 + (os.getpid() * 13 + next(_numbers)) % 220


class LiveNode:
    """`sim` in its own process and process group; `program` is a file to run instead, `arguments` are for ROS."""

    def __init__(self, log, domain, *, program=None, arguments=(), **parameters):
        self.log = log
        self.domain = domain
        module = ["-m", "ldcs_ros.ros", "sim"] if program is None else [str(program)]
        command = [sys.executable, *module, "--ros-args", *arguments]
        for name, value in parameters.items():
            command += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
        with open(log, "w") as stream:
            self.process = subprocess.Popen(
                command, env=environment, stdout=stream, stderr=stream, start_new_session=True
            )

    def stop(self, *signals, pause=0.05):
        """Send signals to the whole group, as a terminal does, and return the exit status."""
        for number in signals:
            os.killpg(self.process.pid, number)
            time.sleep(pause)
        return self.process.wait(10.0)

    def end(self):
        """End every process."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait(10.0)

    @property
    def output(self):
        return self.log.read_text()


class PlainUser:
    """A ROS node that only uses the standard message packages."""

    def __init__(self, domain):
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("plain_user", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.received = defaultdict(list)
        self._clients = {}

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def follower(self):
        """A node of the same user that takes its time from /clock."""
        sim_time = [Parameter("use_sim_time", value=True)]
        node = Node("follower", context=self._context, parameter_overrides=sim_time)
        self._executor.add_node(node)
        return node

    def listen(self, topic, message_type):
        package, kind = message_type.split("/")
        self.node.create_subscription(
            getattr(import_module(f"{package}.msg"), kind), topic, self.received[topic].append, 50
        )

    def until(self, condition, timeout=30.0):
        """Spin until the condition holds and return it; AssertionError after the timeout."""
        end = time.monotonic() + timeout
        while not (value := condition()):
            assert time.monotonic() < end, f"{condition} did not come true in {timeout} s"
            self._executor.spin_once(timeout_sec=0.02)
        return value

    def spin(self, duration):
        end = time.monotonic() + duration
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)

    def next(self, topic):
        """The next message that comes."""
        self.received[topic].clear()
        return self.until(lambda: self.received[topic] and self.received[topic][-1])

    def publisher(self, topic, message_class):
        publisher = self.node.create_publisher(message_class, topic, 10)
        self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def call(self, name, service=Trigger, request=None, timeout=30.0):
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service, name)
        client = self._clients[name]
        self.until(client.service_is_ready)
        future = client.call_async(request or service.Request())
        self.until(future.done, timeout)
        return future.result()

    def change_state(self, transition):
        """Send the simulation node's lifecycle a transition, by its number; return whether it was made."""
        request = ChangeState.Request(transition=Transition(id=transition))
        return self.call("/ldcs/ldcs_sim/change_state", ChangeState, request).success

    def set_parameters(self, *, node="/ldcs/ldcs_sim", atomically=False, **values):
        service = SetParametersAtomically if atomically else SetParameters
        name = "set_parameters_atomically" if atomically else "set_parameters"
        request = service.Request(parameters=[_parameter(*item) for item in values.items()])
        return self.call(f"{node}/{name}", service, request)

    def diagnostics(self, entry):
        """The values of an entry in the next diagnostics message, with its message and level."""
        message = self.next("/diagnostics")
        status = next(one for one in message.status if one.name == f"/ldcs/ldcs_sim: {entry}")
        values = {pair.key: pair.value for pair in status.values}
        return {**values, "message": status.message, "level": ord(status.level)}


def stamp(message):
    """Stamp of a message in nanoseconds."""
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def _parameter(name, value):
    kinds = {
        bool: ("bool_value", ParameterType.PARAMETER_BOOL),
        int: ("integer_value", ParameterType.PARAMETER_INTEGER),
        float: ("double_value", ParameterType.PARAMETER_DOUBLE),
        str: ("string_value", ParameterType.PARAMETER_STRING),
    }
    field, kind = kinds[type(value)]
    return ParameterMessage(name=name, value=ParameterValue(type=kind, **{field: value}))
