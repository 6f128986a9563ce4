"""From a shipped name, a path or a dict to a `Scene`; every error is one line with the path of the key."""

from __future__ import annotations

import importlib.resources
import os
from pathlib import Path
from typing import Any

import yaml

from ldcs_ros.errors import SceneError
from ldcs_ros.scene import schema
from ldcs_ros.scene.scene import Scene, Solver
from ldcs_ros.schema.fields import did_you_mean

MOST_BYTES = 1_000_000
MOST_SHOWN = 200


def shipped_scenes() -> dict[str, Path]:
    """Return the shipped scenes by name."""
    folder = Path(str(importlib.resources.files("ldcs_ros"))) / "scenes"
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_scene(source: str | os.PathLike[str] | dict[str, Any]) -> Scene:
    """Return the scene of a shipped name, a YAML file or a dict with the same keys.

    Raises:
        SceneError: It cannot be found, read or understood; nothing was built.
    """
    if isinstance(source, dict):
        _refuse_cycles(source, "the scene")
        return _scene("scene", source, yaml.safe_dump(source, sort_keys=False), "")
    shipped = shipped_scenes()
    path = Path(source)
    if str(source) in shipped:
        path = shipped[str(source)]
    elif not os.path.isfile(path):  # Path.is_file fails at names that no file can have
        hint = did_you_mean(str(source), shipped)
        shown = f"{str(source)[:MOST_SHOWN]!r}{'...' if len(str(source)) > MOST_SHOWN else ''}"
        raise SceneError(
            f"no scene {shown}: neither a file nor a shipped scene out of {list(shipped)}.{hint}"
        )
    return parse_scene(_read(path), name=path.stem, origin=path.name)


def parse_scene(text: str, *, name: str, origin: str) -> Scene:
    """Return the scene of a YAML text; `origin` names the source in errors.

    Raises:
        SceneError: The text is not a sound scene.
    """
    try:
        content = yaml.load(text, Loader=_StrictLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise SceneError(f"not valid YAML: {problem} @ {origin}{where}") from error
    except RecursionError as error:
        raise SceneError(f"nested too deeply @ {origin}") from error
    try:
        _refuse_cycles(content, origin)
        return _scene(name, content, text, origin)
    except SceneError as error:
        message = str(error)
        raise SceneError(
            message if origin in message else message.replace(" @ ", f" @ {origin}: ", 1)
        ) from error


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise SceneError(
                f"{path.name} has {path.stat().st_size} bytes, expected a scene of at most {MOST_BYTES}"
            )
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise SceneError(f"cannot read the scene {str(path)!r}: {reason}") from error


def _scene(name: str, content: Any, text: str, origin: str) -> Scene:
    block = schema.check_mapping(content, schema.TOP_KEYS, "", required=("lattice", "effects"))
    material = schema.check_material(block["material"], "material") if "material" in block else None
    lattice = schema.check_lattice(block["lattice"], material, "lattice")
    points = schema.check_points(block.get("points", {}), lattice, "points")
    title = block.get("title", name)
    if not isinstance(title, str):
        raise SceneError(f"got {title!r}, expected text @ title")
    scene = Scene(
        name=name,
        title=title,
        lattice=lattice,
        points=points,
        effects=schema.check_effects(block["effects"], lattice, points, "effects"),
        inputs=schema.check_inputs(block.get("inputs", []), "inputs"),
        sensors=schema.check_sensors(block.get("sensors", {}), lattice, points, "sensors"),
        solver=schema.check_solver(block["solver"], "solver") if "solver" in block else Solver(),
        material=material,
        text=text,
    )
    return scene


class _StrictLoader(yaml.SafeLoader):  # type: ignore[misc]  # the library has no types
    """YAML without duplicate keys."""


def _mapping_without_duplicates(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        if isinstance(key_node, yaml.ScalarNode):
            if key_node.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key_node.value!r} occurs twice", key_node.start_mark
                )
            seen.add(key_node.value)
    mapping: dict[Any, Any] = yaml.SafeLoader.construct_mapping(loader, node, deep=True)
    return mapping


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_duplicates)


def _refuse_cycles(content: Any, origin: str, above: tuple[int, ...] = ()) -> None:
    if isinstance(content, (dict, list)):
        if id(content) in above or len(above) > 50:
            raise SceneError(f"a value contains itself (a cycle of aliases, or nesting above 50) @ {origin}")
        for item in content.values() if isinstance(content, dict) else content:
            _refuse_cycles(item, origin, (*above, id(content)))
