"""Files that requests of the graph name: only below one folder, and no refusal quotes what a file holds."""

from __future__ import annotations

from pathlib import Path

from ldcs_ros.errors import LdcsError, SceneError
from ldcs_ros.ros.common.log import Logger
from ldcs_ros.scene.load import load_scene, scene_of, shipped_scenes
from ldcs_ros.scene.scene import Scene

MAX_SHOWN = 200


class GraphFiles:
    """Resolver of the paths that other nodes send.

    Args:
        folder: Folder below which they may lie; '' for no files at all.
        logger: Log of the node, which may quote a file.
    """

    def __init__(self, folder: str, logger: Logger) -> None:
        self._folder = Path(folder).expanduser().resolve() if folder else None
        self._logger = logger

    def path(self, text: str) -> Path:
        """Return the resolved path of a text; a relative one begins at the folder, links count where they lead.

        Raises:
            SceneError: The path lies elsewhere. The answer is the same whether or not there is such a file.
        """
        shown = f"{text[:MAX_SHOWN]!r}{'...' if len(text) > MAX_SHOWN else ''}"
        if self._folder is None:
            raise SceneError(
                f"got the path {shown}, expected a shipped scene out of {list(shipped_scenes())} or the text of one; "
                "start the node with the parameter graph_folder to allow files below it"
            )
        try:
            path = (self._folder / text).resolve()
        except (OSError, ValueError, RuntimeError):
            path = None
        if path is None or not path.is_relative_to(self._folder):
            raise SceneError(f"got the path {shown}, expected one below the node's graph_folder")
        return path

    def scene(self, source: str) -> Scene:
        """Return the scene that a request names by a shipped name or a path, or that it is itself.

        Raises:
            SceneError: The path lies elsewhere, or the scene is not valid; the reason of a file is logged only.
        """
        name = source.strip()
        if name in shipped_scenes():
            return load_scene(name)
        if "\n" in name or name.startswith("{"):
            return scene_of(source)
        return self.scene_file(name)

    def scene_file(self, text: str) -> Scene:
        """Return the scene of a file below the folder.

        Raises:
            SceneError: The path lies elsewhere, or the file is not a valid scene; the reason is logged only.
        """
        path = self.path(text)
        try:
            return load_scene(path)
        except LdcsError as error:
            self._logger.error(str(error))
            raise SceneError(
                f"{path.name!r} is not a valid scene file; the log of the node says why"
            ) from error
