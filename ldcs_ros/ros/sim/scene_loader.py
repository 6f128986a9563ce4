"""Another scene without a restart: its twin is built beside the old one, which it then takes the place of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from rclpy.lifecycle import LifecycleNode

from ldcs_ros.ros.common.background import in_background
from ldcs_ros.ros.common.refusals import InvalidStateError
from ldcs_ros.ros.sim.runner import Runner
from ldcs_ros.scene.scene import Scene
from ldcs_ros.twin.twin import Twin


class SwapScene(Protocol):
    """Lets a twin take the place of the present one."""

    def __call__(self, twin: Twin, *, stop: bool) -> str:
        """Return the error beside it, or ''; with `stop`, time does not run on."""


class SceneLoader:
    """Loads scenes, one at a time.

    The new twin is built on a thread of its own while the old one runs on and takes commands; the two are
    exchanged when the new one is ready.

    Args:
        node: The node whose executor others wait with.
        runner: Returns the runner, or raises InactiveNodeError while the node is not active.
        build: Returns the twin of a scene; may be called on any thread.
        swap_scene: Lets a twin take the place of the present one.
    """

    def __init__(
        self,
        node: LifecycleNode,
        runner: Callable[[], Runner],
        *,
        build: Callable[[Scene], Twin],
        swap_scene: SwapScene,
    ) -> None:
        self._node = node
        self._runner = runner
        self._build = build
        self._swap_scene = swap_scene
        self._busy = False

    async def load(self, scene: Callable[[], Scene], *, stop: bool = False) -> tuple[Twin, str]:
        """Load a scene; return its twin and the error beside it, or ''.

        Args:
            scene: Returns the scene; called on a thread of its own.
            stop: Leave time stopped at the start; otherwise it runs if it ran before.

        Raises:
            InvalidStateError: Another one is being loaded, or the node is not active.
            LdcsError: The scene cannot be built; the old one goes on.
        """
        if self._busy:
            raise InvalidStateError("another scene is being loaded; try again")
        runner = self._runner()
        self._busy = True
        try:
            twin = await in_background(self._node, lambda: self._build(scene()), "scene")
            if twin is None or self._runner() is not runner:
                raise InvalidStateError("the node was configured again meanwhile; the scene was not loaded")
            return twin, self._swap_scene(twin, stop=stop)
        finally:
            self._busy = False
