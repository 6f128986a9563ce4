"""Answers of the standard simulator services: result codes instead of exceptions, and the choice by tags."""

from __future__ import annotations

import re
import traceback
from collections.abc import Awaitable, Callable, Iterable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.lifecycle import LifecycleNode
from simulation_interfaces import srv
from simulation_interfaces.msg import Result, TagsFilter

from ldcs_ros.errors import LdcsError
from ldcs_ros.ros.common.refusals import InactiveNodeError, InvalidStateError


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
    if isinstance(error, InactiveNodeError):
        return Result(result=Result.RESULT_INCORRECT_STATE, error_message=str(error))
    if isinstance(error, (InvalidStateError, LdcsError)):
        return Result(result=Result.RESULT_OPERATION_FAILED, error_message=str(error))
    node.get_logger().error("".join(traceback.format_exception(error)))
    return Result(result=Result.RESULT_OPERATION_FAILED, error_message=f"failed: {error!r}")


class TagChoice:
    """Tells whether tags are wanted; without any that are, all of them pass.

    Args:
        wanted: Message TagsFilter.

    Raises:
        Refused: Its mode is none.
    """

    def __init__(self, wanted: Any) -> None:
        modes = (TagsFilter.FILTER_MODE_ANY, TagsFilter.FILTER_MODE_ALL)
        if wanted.filter_mode not in modes:
            reason = f"tag filter mode {wanted.filter_mode}, expected any ({modes[0]}) or all ({modes[1]})"
            raise Refused(Result.RESULT_OPERATION_FAILED, reason)
        self._tags = frozenset(wanted.tags)
        self._all = wanted.filter_mode == TagsFilter.FILTER_MODE_ALL

    def takes(self, tags: Iterable[str]) -> bool:
        """Return whether something with these tags is wanted."""
        common = self._tags & frozenset(tags)
        return not self._tags or (common == self._tags if self._all else bool(common))
