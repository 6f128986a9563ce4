"""Errors of a service with `success` and `message`: the answer holds the reason, no exception leaves the service."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rclpy.node import Node

from ldcs_ros.errors import LdcsError


class InvalidStateError(Exception):
    """A request that does not fit the present mode; the text names the remedy."""


class InactiveNodeError(InvalidStateError):
    """A request to a node that is not in the state of its lifecycle in which it can be granted."""


class SuccessResponse(Protocol):
    """An answer that says whether the request was carried out."""

    success: bool
    message: str


@contextmanager
def report_errors(node: Node, response: SuccessResponse) -> Iterator[None]:
    """Turn the exceptions of a handler into its answer.

    Args:
        node: The node, which logs unexpected exceptions.
        response: Answer with the fields success and message.
    """
    try:
        yield
    except (InvalidStateError, LdcsError) as error:
        response.success, response.message = False, str(error)
    except Exception as error:
        # It would end the process; an unexpected exception is logged, and the run goes on.
        node.get_logger().error(traceback.format_exc())
        response.success, response.message = False, f"failed: {error!r}"
