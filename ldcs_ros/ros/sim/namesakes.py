"""Two nodes of one name: ROS allows it, and whoever calls a service of that name gets either of them."""

from __future__ import annotations

from rclpy.node import Node

from ldcs_ros.messages.diagnostics import OK, WARN, Status


class Namesakes:
    """Looks for other nodes of the same full name.

    They are told, not refused: a node that was killed stays in the graph for twenty seconds more, and the one that is
    started in its place has to run.

    Args:
        node: The node whose name is watched.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._told = False

    def look(self) -> Status:
        """Return the state as an entry of the diagnostics; a namesake is also logged, once."""
        own = self._node.get_fully_qualified_name()
        names = self._node.get_node_names_and_namespaces()
        count = sum(f"{namespace.rstrip('/')}/{name}" == own for name, namespace in names)
        trouble = ""
        if count > 1:
            trouble = (
                f"{count} nodes are named {own}: commands reach all of them, services any; end the others, or start "
                "them in namespaces of their own (--ros-args -r __ns:=/second); one that was killed fades in 20 s"
            )
        if trouble and not self._told:
            self._node.get_logger().warning(trouble)
        self._told = bool(trouble)
        return Status(
            "name", WARN if trouble else OK, trouble or "the only one", {"nodes of this name": count}
        )
