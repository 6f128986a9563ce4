"""The service `~/load_scene`: another scene without a restart."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNode
from rclpy.task import Future

from ldcs_ros.errors import LdcsError
from ldcs_ros.interface.scene_source import scene_of
from ldcs_ros.interface.twin import Twin
from ldcs_ros.ros.runner import NotNow, Runner
from ldcs_ros.scene.scene import Scene


class SceneService:
    """Serves `~/load_scene`, ldcs_msgs/LoadScene.

    The new twin is built on a thread of its own while the old one runs on and takes commands; the two are
    exchanged only when the new one stands.

    Args:
        node: The node that offers it.
        service_type: The class LoadScene.
        runner: Returns the runner, or raises NotNow while the node is not active.
        build: Returns the twin of a scene; may be called on any thread.
        exchange: Lets a twin take the place of the present one; returns what went wrong beside it, or ''.
    """

    def __init__(
        self,
        node: LifecycleNode,
        service_type: Any,
        runner: Callable[[], Runner],
        *,
        build: Callable[[Scene], Twin],
        exchange: Callable[[Twin], str],
    ) -> None:
        self._node = node
        self._runner = runner
        self._build = build
        self._exchange = exchange
        self._busy = False
        # Others are served while this one waits for the new twin.
        node.create_service(
            service_type, "~/load_scene", self._handle, callback_group=ReentrantCallbackGroup()
        )

    async def _handle(self, request: Any, response: Any) -> Any:
        try:
            twin, trouble = await self._load(request.scene)
            title = twin.scene.title or twin.scene.name
            response.success, response.message = True, f"{title}; {trouble}" if trouble else str(title)
            response.effects = list(twin.simulation.effects)
        except (NotNow, LdcsError) as error:
            response.success, response.message = False, str(error)
        except Exception as error:
            # It would end the process; a mistake of ours must be seen, and the old scene goes on.
            self._node.get_logger().error(traceback.format_exc())
            response.success, response.message = False, f"failed: {error!r}"
        return response

    async def _load(self, source: str) -> tuple[Twin, str]:
        if self._busy:
            raise NotNow("another scene is being loaded; try again")
        runner = self._runner()
        self._busy = True
        try:
            twin = await self._built(source)
            if twin is None or self._runner() is not runner:
                raise NotNow("the node was configured anew meanwhile; the scene was not loaded")
            return twin, self._exchange(twin)
        finally:
            self._busy = False

    def _built(self, source: str) -> Future[Twin]:
        future: Future[Twin] = Future(executor=self._node.executor)

        def build() -> None:
            try:
                future.set_result(self._build(scene_of(source)))
            except Exception as error:
                future.set_exception(error)

        threading.Thread(target=build, name="load_scene", daemon=True).start()
        return future
