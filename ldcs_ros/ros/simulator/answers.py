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


class ResultError(Exception):
    """A refused call that is answered with a result code; the text gives the reason.

    Attributes:
        code: Code of the result.
    """

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code


def offer_service(
    node: LifecycleNode,
    service: str,
    handle: Callable[..., Awaitable[None] | None],
    *,
    group: CallbackGroup | None = None,
) -> bool:
    """Offer a service under its usual name, '~/get_entities' for GetEntities; return whether its type is installed.

    Args:
        node: The node that offers it.
        service: Name of its type.
        handle: Fills the answer to a request, `handle(request, response)`; may raise. A coroutine lets other
            callbacks run in between.
        group: Callback group of a coroutine.
    """
    kind = getattr(srv, service, None)
    if kind is None:
        return False

    async def answer(request: object, response: Any) -> Any:  # of the types of the service
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
    """Return the result of an error; an unexpected exception goes into the log."""
    if isinstance(error, ResultError):
        return Result(result=error.code, error_message=str(error))
    if isinstance(error, InactiveNodeError):
        return Result(result=Result.RESULT_INCORRECT_STATE, error_message=str(error))
    if isinstance(error, (InvalidStateError, LdcsError)):
        return Result(result=Result.RESULT_OPERATION_FAILED, error_message=str(error))
    node.get_logger().error("".join(traceback.format_exception(error)))
    return Result(result=Result.RESULT_OPERATION_FAILED, error_message=f"failed: {error!r}")


class TagFilter:
    """A filter by tags; one without tags lets everything pass.

    Args:
        tags_filter: The tags and the mode.

    Raises:
        ResultError: The mode is unknown.
    """

    def __init__(self, tags_filter: TagsFilter) -> None:
        modes = (TagsFilter.FILTER_MODE_ANY, TagsFilter.FILTER_MODE_ALL)
        if tags_filter.filter_mode not in modes:
            reason = (
                f"tag filter mode {tags_filter.filter_mode}, expected any ({modes[0]}) or all ({modes[1]})"
            )
            raise ResultError(Result.RESULT_OPERATION_FAILED, reason)
        self._tags = frozenset(tags_filter.tags)
        self._all = tags_filter.filter_mode == TagsFilter.FILTER_MODE_ALL

    def matches(self, tags: Iterable[str]) -> bool:
        """Return whether something with these tags passes."""
        common = self._tags & frozenset(tags)
        return not self._tags or (common == self._tags if self._all else bool(common))
