"""How a service with `success` and `message` answers what went wrong: with the reason, and never by an exception."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.node import Node

from ldcs_ros.errors import LdcsError


class InvalidStateError(Exception):
    """A request that does not fit the present mode; the text says what to do."""


class InactiveNodeError(InvalidStateError):
    """A request to a node that is not in the state of its lifecycle in which it can be granted."""


@contextmanager
def report_errors(node: Node, response: Any) -> Iterator[None]:
    """Turn what a handler raises into its answer.

    Args:
        node: The node, which logs what is a mistake of ours.
        response: Answer with the fields success and message.
    """
    try:
        yield
    except (InvalidStateError, LdcsError) as error:
        response.success, response.message = False, str(error)
    except Exception as error:
        # It would end the process; a mistake of ours must be seen, and the run goes on.
        node.get_logger().error(traceback.format_exc())
        response.success, response.message = False, f"failed: {error!r}"
