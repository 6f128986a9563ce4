"""The arguments that say which scene: SCENE or --scene, changed by --set; to a checked Scene."""

from __future__ import annotations

import argparse
import copy
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ldcs_ros.cli.arguments import CommandLineError
from ldcs_ros.errors import SceneError

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


def add_map(parser: argparse.ArgumentParser, side: str = "") -> None:
    """Declare `--map FILE` and `--columns NAME=COLUMN,...:UNIT ...`, with `-a` or `-b` behind for one of two sides."""
    end, whose = (f"-{side}", f" of {side.upper()}") if side else ("", "")
    parser.add_argument(
        f"--map{end}",
        metavar="FILE",
        type=Path,
        help=f"meaning of the topics of a rig's bag, or of a table's columns{whose} (YAML)",
    )
    parser.add_argument(
        f"--columns{end}",
        metavar="NAME=COLUMN,..:UNIT",
        nargs="+",
        default=[],
        help=f"the same for a table{whose} in words: time=t:ms pressure_command=p1,p2:kPa P1=x,y,z:mm",
    )


def given_mapping(arguments: argparse.Namespace, side: str = "") -> Mapping | None:
    """Return the mapping of `--map` or `--columns`; None without them.

    Raises:
        MappingError: The file or a word is not sound.
        CommandLineError: Both are given.
    """
    from ldcs_ros.signals import load_mapping
    from ldcs_ros.signals.tables import columns_mapping

    end = f"_{side}" if side else ""
    file, words = getattr(arguments, f"map{end}"), getattr(arguments, f"columns{end}")
    if file is not None and words:
        raise CommandLineError("got a mapping file and --columns, expected one of them")
    if words:
        return columns_mapping(words)
    return None if file is None else load_mapping(file)


def scene_of(bag: Path, arguments: argparse.Namespace) -> Scene:
    """Return the scene of `--scene`, or else the one that a bag carries, with the changes of `--set`.

    Raises:
        SceneError: There is none, or it is not valid, before or after the changes.
        RecordingError: The bag cannot be read.
    """
    from ldcs_ros.bags import read_bag
    from ldcs_ros.signals.topics import recorded_scene
    from ldcs_ros.tables.read import is_table

    if arguments.scene is not None:
        return scene_with(arguments.scene, arguments.overrides)
    scene = None if is_table(bag) else recorded_scene(read_bag(bag))
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


def apply_overrides(content: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Return a copy of a scene's content with each `path=value` put in.

    A path names keys joined by dots; a list takes an index, `effects[0].stiffness`, or an entry's type,
    `effects.springs.stiffness`.
    Unknown keys are left to the scene's own check, which knows what is allowed.

    Raises:
        SceneError: The text is not `path=value`, or the path leads nowhere.
    """
    from ldcs_ros.schema.paths import put_value

    changed = copy.deepcopy(content)
    for override in overrides:
        path, equals, text = override.partition("=")
        if not equals or not path.strip():
            raise SceneError(
                f"--set '{override}' is not path=value; write for example --set lattice.nodes=[17,17]"
            )
        try:
            put_value(changed, path.strip(), parse_value(text.strip()), said=override)
        except SceneError as error:
            raise SceneError(f"--set {error}") from error
    return changed


def parse_value(text: str) -> object:
    """Return the value of a text in a scene file: number, list, word, true / false, null."""
    from ldcs_ros.schema.reader import read_yaml

    try:
        return read_yaml(text, origin="--set", error=SceneError)
    except SceneError as error:
        raise SceneError(f"{error}; quote lists as in --set 'lattice.nodes=[17,17]'") from error
