"""The arguments that say which scene: SCENE or --scene, changed by --set; to a checked Scene."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ldcs_ros.cli.overrides import apply_overrides

if TYPE_CHECKING:
    from ldcs_ros.scene.scene import Scene
    from ldcs_ros.signals import Mapping


def add_set(parser: argparse.ArgumentParser) -> None:
    """Declare `--set PATH=VALUE`."""
    parser.add_argument(
        "--set",
        metavar="PATH=VALUE",
        dest="overrides",
        action="append",
        default=[],
        help="change a key of the scene: lattice.nodes=[17,17], effects.springs.stiffness=139; repeatable",
    )


def add_map(parser: argparse.ArgumentParser) -> None:
    """Declare `--map FILE`."""
    parser.add_argument(
        "--map", metavar="FILE", dest="mapping", type=Path, help="meaning of the topics of a rig's bag (YAML)"
    )


def given_mapping(arguments: argparse.Namespace) -> Mapping | None:
    """Return the mapping of `--map`; None without it.

    Raises:
        MappingError: The file is not sound.
    """
    from ldcs_ros.signals import load_mapping

    return None if arguments.mapping is None else load_mapping(arguments.mapping)


def scene_of(bag: Path, arguments: argparse.Namespace) -> Scene:
    """Return the scene of `--scene`, or else the one that a bag carries, with the changes of `--set`.

    Raises:
        SceneError: There is none, or it is not valid, before or after the changes.
        RecordingError: The bag cannot be read.
    """
    from ldcs_ros.bags import read_bag
    from ldcs_ros.errors import SceneError
    from ldcs_ros.signals.topics import recorded_scene

    if arguments.scene is not None:
        return scene_with(arguments.scene, arguments.overrides)
    scene = recorded_scene(read_bag(bag))
    if scene is None:
        raise SceneError(f"{bag} does not say what it is a recording of; name a scene with --scene")
    return changed_scene(scene, arguments.overrides)


def scene_with(source: str, overrides: Sequence[str]) -> Scene:
    """Return the scene of a shipped name or path with `path=value` changes, checked as a whole.

    Raises:
        SceneError: There is no such scene, or it is not valid, before or after the changes.
    """
    from ldcs_ros.scene.load import load_scene

    return changed_scene(load_scene(source), overrides)


def changed_scene(scene: Scene, overrides: Sequence[str]) -> Scene:
    """Return a scene with `path=value` changes, checked as a whole.

    Raises:
        SceneError: It is not valid after the changes.
    """
    from ldcs_ros.scene.load import parse_scene
    from ldcs_ros.scene.mesh_change import carry_places
    from ldcs_ros.schema.reader import write_yaml

    if not overrides:
        return scene
    before = scene.content
    content = apply_overrides(before, overrides)
    for line in carry_places(before, content):
        print(f"ldcs: note: {line}", file=sys.stderr)
    return parse_scene(write_yaml(content), name=scene.name, origin=f"{scene.name} with --set")
