"""Work of a service on a thread of its own, while the node goes on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

from rclpy.node import Node
from rclpy.task import Future

Result = TypeVar("Result")


def in_background(node: Node, work: Callable[[], Result], name: str) -> Future[Result]:
    """Run a function on a thread of its own; return a future that a coroutine of the node's executor can wait for.

    Args:
        node: The node, whose executor the waiting coroutine has.
        work: The function; what it raises is raised where the future is waited for.
        name: Name of the thread.
    """
    future: Future[Result] = Future(executor=node.executor)

    def run() -> None:
        try:
            future.set_result(work())
        except Exception as error:
            future.set_exception(error)

    threading.Thread(target=run, name=name, daemon=True).start()
    return future
