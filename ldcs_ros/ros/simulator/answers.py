"""How a standard simulator service answers: its result code, and never an exception."""

from __future__ import annotations

import re
import traceback
from collections.abc import Awaitable, Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.lifecycle import LifecycleNode
from simulation_interfaces import srv
from simulation_interfaces.msg import Result

from ldcs_ros.errors import LdcsError
from ldcs_ros.ros.sim.runner import NotActive, NotNow


class Refused(Exception):
    """A call that is answered with a result code; the text says why.

    Attributes:
        code: Code of the result.
    """

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code


def offer(
    node: LifecycleNode,
    service: str,
    handle: Callable[[Any, Any], Awaitable[None] | None],
    *,
    group: CallbackGroup | None = None,
) -> bool:
    """Offer a service under its usual name, '~/get_entities' for GetEntities; return whether its type is installed.

    Args:
        node: The node that offers it.
        service: Name of its type.
        handle: Fills an answer; may raise. A coroutine lets other callbacks have their turn.
        group: Callback group of a coroutine.
    """
    kind = getattr(srv, service, None)
    if kind is None:
        return False

    async def answer(request: Any, response: Any) -> Any:
        try:
            waiting = handle(request, response)
            if waiting is not None:
                await waiting
        except Exception as error:
            response = kind.Response()
            if hasattr(response, "result"):
                response.result = result_of(node, error)
        else:
            if hasattr(response, "result"):
                response.result.result = Result.RESULT_OK
        return response

    node.create_service(kind, f"~/{usual_name(service)}", answer, callback_group=group)
    return True


def usual_name(kind: str) -> str:
    """Return the name under which simulators offer a type: 'get_entities' for GetEntities."""
    return re.sub("(?<!^)(?=[A-Z])", "_", kind).lower()


def result_of(node: LifecycleNode, error: Exception) -> Result:
    """Return the result that tells of an error; one that is a mistake of ours goes into the log."""
    if isinstance(error, Refused):
        return Result(result=error.code, error_message=str(error))
    if isinstance(error, NotActive):
        return Result(result=Result.RESULT_INCORRECT_STATE, error_message=str(error))
    if isinstance(error, (NotNow, LdcsError)):
        return Result(result=Result.RESULT_OPERATION_FAILED, error_message=str(error))
    node.get_logger().error("".join(traceback.format_exception(error)))
    return Result(result=Result.RESULT_OPERATION_FAILED, error_message=f"failed: {error!r}")
