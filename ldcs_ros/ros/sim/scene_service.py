"""The service `~/load_scene`: another scene without a restart."""

from __future__ import annotations

from functools import partial
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode

from ldcs_ros.ros.common.refusals import told
from ldcs_ros.ros.sim.scene_loader import SceneLoader
from ldcs_ros.scene.scene_source import scene_of


class SceneService:
    """Serves `~/load_scene`, ldcs_msgs/LoadScene.

    Args:
        node: The node that offers it.
        service_type: The class LoadScene.
        loader: What loads the scenes.
    """

    def __init__(self, node: LifecycleNode, service_type: Any, loader: SceneLoader) -> None:
        self._node = node
        self._loader = loader
        # Others are served while this one waits for the new twin.
        node.create_service(
            service_type, "~/load_scene", self._handle, callback_group=ReentrantCallbackGroup()
        )

    async def _handle(self, request: Any, response: Any) -> Any:
        with told(self._node, response):
            twin, trouble = await self._loader.load(partial(scene_of, request.scene))
            title = twin.scene.title or twin.scene.name
            response.success, response.message = True, f"{title}; {trouble}" if trouble else str(title)
            response.effects = list(twin.simulation.effects)
        return response
