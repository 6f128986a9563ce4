"""GetAvailableWorlds, GetCurrentWorld and LoadWorld: a world is a scene."""

from __future__ import annotations

import os
from functools import cache, partial
from typing import TYPE_CHECKING

from simulation_interfaces.msg import Result, WorldResource
from simulation_interfaces.srv import GetCurrentWorld, LoadWorld

from ldcs_ros.errors import LdcsError, SceneError
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.sim.scene_loader import SceneLoader
from ldcs_ros.ros.simulator.answers import ResultError, TagFilter
from ldcs_ros.ros.simulator.control import Host
from ldcs_ros.scene.load import load_scene, shipped_scenes
from ldcs_ros.scene.scene import Scene

if TYPE_CHECKING:
    from simulation_interfaces.msg import Resource
    from simulation_interfaces.srv import GetAvailableWorlds

_SUFFIXES = ("", ".yaml", ".yml")
_SCHEME = "file://"


class Worlds:
    """The scenes as worlds; each is tagged with its effects.

    Args:
        host: The node.
        loader: Loader of scenes.
        files: Resolver of paths.
    """

    def __init__(self, host: Host, loader: SceneLoader, files: GraphFiles) -> None:
        self._host = host
        self._loader = loader
        self._files = files

    def available(self, request: GetAvailableWorlds.Request, response: GetAvailableWorlds.Response) -> None:
        """List the shipped scenes, and those in further folders."""
        choice = TagFilter(request.filter)
        found, trouble = {name: _shipped(name) for name in shipped_scenes()}, []
        for source in request.additional_sources:
            try:
                folder = self._files.path(source.removeprefix(_SCHEME))
                if not os.path.isdir(folder):  # a name that is too long is no error to it
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
            raise ResultError(Result.RESULT_OPERATION_FAILED, "; ".join(trouble))
        response.result.error_message = "; ".join(trouble)
        worlds = [_world(scene, uri=uri) for uri, scene in found.items()]
        response.worlds = [world for world in worlds if choice.matches(world.tags)]

    def current(self, request: GetCurrentWorld.Request, response: GetCurrentWorld.Response) -> None:
        """Report the loaded scene, whole; ResultError without one."""
        runner = self._host.runner
        if runner is None:
            reason = "no scene is loaded; configure the node first"
            raise ResultError(GetCurrentWorld.Response.NO_WORLD_LOADED, reason)
        response.world = _world(runner.twin.scene)

    async def load(self, request: LoadWorld.Request, response: LoadWorld.Response) -> None:
        """Load a scene by name, path or text, and leave it stopped."""
        self._host.active_runner()
        # Version 1 of the interfaces has the two fields of the resource in the request itself.
        source = self._source(getattr(request, "world_resource", request))
        try:
            twin, trouble = await self._loader.load(partial(self._files.scene, source), stop=True)
        except SceneError as error:
            raise ResultError(LoadWorld.Response.RESOURCE_PARSE_ERROR, str(error)) from error
        response.result.error_message = trouble
        response.world = _world(twin.scene)

    def _source(self, resource: Resource) -> str:
        uri, text = resource.uri.removeprefix(_SCHEME), resource.resource_string
        if not uri and not text.strip():
            reason = f"no resource, expected a name out of {list(shipped_scenes())}, a path, or the text of a scene"
            raise ResultError(LoadWorld.Response.NO_RESOURCE, reason)
        if not uri:
            return str(text)
        if uri in shipped_scenes():
            return str(uri)
        try:
            path = self._files.path(uri)
        except SceneError as error:
            raise ResultError(Result.RESULT_NOT_FOUND, str(error)) from error
        if not os.path.isfile(path):
            reason = f"{resource.uri!r} is neither a file nor a shipped scene out of {list(shipped_scenes())}"
            raise ResultError(Result.RESULT_NOT_FOUND, reason)
        if path.suffix.lower() not in _SUFFIXES:
            raise ResultError(
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
