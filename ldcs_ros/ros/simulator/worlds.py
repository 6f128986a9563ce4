"""GetAvailableWorlds, GetCurrentWorld and LoadWorld: a world is a scene."""

from __future__ import annotations

import os
from functools import cache, partial
from typing import Any

from simulation_interfaces.msg import Result, WorldResource
from simulation_interfaces.srv import GetCurrentWorld, LoadWorld

from ldcs_ros.errors import LdcsError, SceneError
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.sim.scene_loader import SceneLoader
from ldcs_ros.ros.simulator.answers import Refused, TagChoice
from ldcs_ros.ros.simulator.control import Host
from ldcs_ros.scene.load import load_scene, shipped_scenes
from ldcs_ros.scene.scene import Scene

_SUFFIXES = ("", ".yaml", ".yml")
_SCHEME = "file://"


class Worlds:
    """Answers for the scenes that there are; each is tagged with the effects that it names.

    Args:
        host: The node.
        loader: What loads scenes.
        files: Resolver of paths.
    """

    def __init__(self, host: Host, loader: SceneLoader, files: GraphFiles) -> None:
        self._host = host
        self._loader = loader
        self._files = files

    def available(self, request: Any, response: Any) -> None:
        """List the shipped scenes, and those in further folders."""
        choice = TagChoice(request.filter)
        found, trouble = {name: _shipped(name) for name in shipped_scenes()}, []
        for source in request.additional_sources:
            try:
                folder = self._files.path(source.removeprefix(_SCHEME))
                if not folder.is_dir():
                    raise SceneError(f"no folder {source[:200]!r}")
            except LdcsError as error:
                trouble.append(str(error))
                continue
            for path in sorted(folder.glob("*.yaml")):
                try:
                    found[str(path)] = self._files.scene_file(str(path))
                except LdcsError as error:
                    trouble.append(str(error))
        if trouble and not request.continue_on_error:
            raise Refused(Result.RESULT_OPERATION_FAILED, "; ".join(trouble))
        response.result.error_message = "; ".join(trouble)
        worlds = [_world(scene, uri=uri) for uri, scene in found.items()]
        response.worlds = [world for world in worlds if choice.takes(world.tags)]

    def current(self, request: Any, response: Any) -> None:
        """Tell the scene that is loaded, whole."""
        runner = self._host.runner
        if runner is None:
            reason = "no scene is loaded; configure the node first"
            raise Refused(GetCurrentWorld.Response.NO_WORLD_LOADED, reason)
        response.world = _world(runner.twin.scene)

    async def load(self, request: Any, response: Any) -> None:
        """Load a scene by name, path or text, and leave it stopped."""
        self._host.active_runner()
        # Version 1 of the interfaces has the two fields of the resource in the request itself.
        source = self._source(getattr(request, "world_resource", request))
        try:
            twin, trouble = await self._loader.load(partial(self._files.scene, source), stop=True)
        except SceneError as error:
            raise Refused(LoadWorld.Response.RESOURCE_PARSE_ERROR, str(error)) from error
        response.result.error_message = trouble
        response.world = _world(twin.scene)

    def _source(self, resource: Any) -> str:
        uri, text = resource.uri.removeprefix(_SCHEME), resource.resource_string
        if not uri and not text.strip():
            reason = f"no resource, expected a name out of {list(shipped_scenes())}, a path, or the text of a scene"
            raise Refused(LoadWorld.Response.NO_RESOURCE, reason)
        if not uri:
            return str(text)
        if uri in shipped_scenes():
            return str(uri)
        try:
            path = self._files.path(uri)
        except SceneError as error:
            raise Refused(Result.RESULT_NOT_FOUND, str(error)) from error
        if not os.path.isfile(path):
            reason = f"{resource.uri!r} is neither a file nor a shipped scene out of {list(shipped_scenes())}"
            raise Refused(Result.RESULT_NOT_FOUND, reason)
        if path.suffix.lower() not in _SUFFIXES:
            raise Refused(
                LoadWorld.Response.UNSUPPORTED_FORMAT, f"{resource.uri!r}, expected a scene in YAML"
            )
        return str(path)


@cache
def _shipped(name: str) -> Scene:
    return load_scene(name)


def _world(scene: Scene, uri: str = "") -> WorldResource:
    if scene.name in shipped_scenes() and scene.text == _shipped(scene.name).text:
        uri = scene.name
    world = WorldResource(name=scene.name, description=str(scene.title))
    world.world_resource.uri = uri
    world.world_resource.resource_string = "" if uri else scene.text
    world.tags = sorted({effect.name for effect in scene.effects})
    return world
