"""How a service with `success` and `message` answers what went wrong: with the reason, and never by an exception."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.node import Node

from ldcs_ros.errors import LdcsError
from ldcs_ros.ros.sim.runner import NotNow


@contextmanager
def told(node: Node, response: Any) -> Iterator[None]:
    """Turn what a handler raises into its answer.

    Args:
        node: The node, which logs what is a mistake of ours.
        response: Answer with the fields success and message.
    """
    try:
        yield
    except (NotNow, LdcsError) as error:
        response.success, response.message = False, str(error)
    except Exception as error:
        # It would end the process; a mistake of ours must be seen, and the run goes on.
        node.get_logger().error(traceback.format_exc())
        response.success, response.message = False, f"failed: {error!r}"
