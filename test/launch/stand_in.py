"""The part of `launch` and `launch_ros` that our launch files use, and a visitor that executes a description with it.

No wheels of these packages exist. Names and arguments are those of launch 3; where the real packages are installed,
a test compares them. Nothing is started: the visitor returns what would be.
"""

from __future__ import annotations

import sys
import types
from dataclasses import dataclass, field
from typing import Any


def perform(value: Any, context: LaunchContext) -> Any:
    """Return the text of a substitution, or of a list of them."""
    if isinstance(value, (list, tuple)):
        return "".join(perform(item, context) for item in value)
    return value.perform(context) if hasattr(value, "perform") else value


class LaunchContext:
    def __init__(self, **given: str) -> None:
        self.launch_configurations = dict(given)
        self.is_shutdown = False


class LaunchDescriptionEntity:
    """Base of what a description holds."""


@dataclass
class ProcessIO:
    """Something that a process printed."""

    text: bytes


@dataclass
class ProcessExited:
    """A process that has ended."""

    returncode: int


class LaunchDescription:
    def __init__(self, initial_entities=None) -> None:
        self.entities = list(initial_entities or ())


@dataclass
class LaunchConfiguration:
    variable_name: str
    default: Any = None

    def perform(self, context):
        return context.launch_configurations[self.variable_name]


@dataclass
class PathJoinSubstitution:
    substitutions: list

    def perform(self, context):
        return "/".join(perform(one, context) for one in self.substitutions)


@dataclass
class FindPackageShare:
    package: str

    def perform(self, context):
        return f"SHARE({self.package})"


@dataclass
class ExecutableInPackage:
    executable: str
    package: str

    def perform(self, context):
        return f"{self.package}:{self.executable}"


class ParameterValue:
    def __init__(self, value, *, value_type=None) -> None:
        self.value, self.value_type = value, value_type

    def perform(self, context):
        text = perform(self.value, context)
        return {"true": True, "false": False}[text] if self.value_type is bool else self.value_type(text)


@dataclass
class IfCondition:
    predicate_expression: Any

    def holds(self, context):
        return {"true": True, "1": True, "false": False, "0": False}[
            perform(self.predicate_expression, context).lower()
        ]


class DeclareLaunchArgument:
    def __init__(self, name, *, default_value=None, description=None, choices=None, condition=None) -> None:
        self.name, self.default_value, self.description, self.choices = (
            name,
            default_value,
            description,
            choices,
        )


class OpaqueFunction:
    def __init__(self, *, function, args=None, kwargs=None, condition=None) -> None:
        self.function, self.condition = function, condition


class Shutdown:
    def __init__(self, *, reason="reason not given", condition=None) -> None:
        self.reason = reason


class LogInfo:
    def __init__(self, *, msg, condition=None) -> None:
        self.msg = msg


class ExecuteProcess:
    def __init__(self, *, cmd, output="log", on_exit=None, condition=None) -> None:
        self.cmd, self.on_exit, self.condition = cmd, on_exit, condition


class Node(ExecuteProcess):
    def __init__(
        self,
        *,
        executable,
        package=None,
        name=None,
        namespace=None,
        parameters=None,
        arguments=None,
        **kwargs,
    ) -> None:
        super().__init__(cmd=[executable], **kwargs)
        self.executable, self.package, self.name, self.namespace = executable, package, name, namespace
        self.parameters, self.arguments = parameters or [], arguments or []


class OnProcessIO:
    def __init__(self, *, target_action=None, on_stdin=None, on_stdout=None, on_stderr=None) -> None:
        self.target_action, self.on_stderr = target_action, on_stderr


class RegisterEventHandler:
    def __init__(self, event_handler, *, condition=None) -> None:
        self.event_handler = event_handler


MODULES = {
    "launch": [LaunchContext, LaunchDescription, LaunchDescriptionEntity],
    "launch.actions": [
        DeclareLaunchArgument,
        ExecuteProcess,
        LogInfo,
        OpaqueFunction,
        RegisterEventHandler,
        Shutdown,
    ],
    "launch.conditions": [IfCondition],
    "launch.event_handlers": [OnProcessIO],
    "launch.events": [],
    "launch.events.process": [ProcessExited, ProcessIO],
    "launch.substitutions": [LaunchConfiguration, PathJoinSubstitution],
    "launch_ros": [],
    "launch_ros.actions": [Node],
    "launch_ros.parameter_descriptions": [ParameterValue],
    "launch_ros.substitutions": [ExecutableInPackage, FindPackageShare],
}


def install(monkeypatch: Any) -> None:
    """Put the stand-ins where imports look, until the test is over."""
    for name, members in MODULES.items():
        module = types.ModuleType(name)
        for member in members:
            setattr(module, member.__name__, member)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "ldcs_ros.ros.common.launching", raising=False)


@dataclass
class Launched:
    """The declarations and processes of a description.

    Attributes:
        context: Its arguments by name.
        declared: Its arguments as declared.
        started: Nodes and processes, as `Started`.
        handlers: Handlers of output by the executable that they listen to.
    """

    context: LaunchContext
    declared: list = field(default_factory=list)
    started: list = field(default_factory=list)
    handlers: dict = field(default_factory=dict)

    def visit(self, entities: Any) -> Launched:
        """Execute entities as a launch would."""
        for entity in entities if isinstance(entities, (list, tuple)) else [entities]:
            condition = getattr(entity, "condition", None)
            if condition is not None and not condition.holds(self.context):
                continue
            if isinstance(entity, DeclareLaunchArgument):
                self._declare(entity)
            elif isinstance(entity, OpaqueFunction):
                self.visit(entity.function(self.context) or [])
            elif isinstance(entity, RegisterEventHandler):
                handler = entity.event_handler
                self.handlers[handler.target_action.executable] = handler.on_stderr
            elif isinstance(entity, ExecuteProcess):
                self.started.append(Started(entity, self.context))
        return self

    def say(self, executable: str, text: bytes) -> None:
        """Let a node print something, and execute what that sets off."""
        self.visit(self.handlers[executable](ProcessIO(text)) or [])

    def _declare(self, argument: DeclareLaunchArgument) -> None:
        self.declared.append(argument)
        values = self.context.launch_configurations
        if argument.name not in values:
            assert argument.default_value is not None, f"{argument.name} must be given"
            values[argument.name] = perform(argument.default_value, self.context)
        assert not argument.choices or values[argument.name] in argument.choices


class Started:
    """A process with its substitutions performed.

    Attributes:
        package: Package of a node; None for another command.
        executable: Executable of a node.
        namespace: Namespace of a node.
        command: The words of another command, or the arguments of a node.
        files: Parameter files of a node.
        parameters: Parameters of a node by name.
        ended: Function that does what the launch does when the process ends with a status.
        ends_all: The launch ends with it.
    """

    def __init__(self, action: ExecuteProcess, context: LaunchContext) -> None:
        is_node = isinstance(action, Node)
        self.package = action.package if is_node else None
        self.executable = action.executable if is_node else None
        self.namespace = perform(action.namespace, context) if is_node else None
        words = action.arguments if is_node else action.cmd
        self.command = [perform(word, context) for word in words]
        given = action.parameters if is_node else []
        self.files = [one for one in given if isinstance(one, str)]
        tables = [one for one in given if isinstance(one, dict)]
        self.parameters = {name: perform(value, context) for table in tables for name, value in table.items()}
        self.ended = lambda status: action.on_exit(ProcessExited(status), context) if action.on_exit else None
        self.ends_all = isinstance((self.ended(0) or [None])[0], Shutdown)
