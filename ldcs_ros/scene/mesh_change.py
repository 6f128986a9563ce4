"""Places that are given as node numbers, carried over to another number of nodes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from ldcs_ros.errors import SceneError
from ldcs_ros.physics.effects import EFFECTS, effect_class
from ldcs_ros.physics.points import NODE_NAME

_ALIGNED = "_aligned"


def carry_places(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Give the places of a changed scene the node numbers that they have on its new mesh, in place.

    A place that the change itself gives stays unchanged.

    Args:
        before: Content of the scene with the old `lattice.nodes`.
        after: Content with the new ones.

    Returns:
        Lines that name each place that was converted, and each width that counts cells; empty for the same mesh.

    Raises:
        SceneError: A place has no node on the new mesh.
    """
    old, new = _nodes(before), _nodes(after)
    if old is None or new is None or old == new:
        return []
    known = {path: holder[key] for path, holder, key in _places(before)}
    lines = []
    for path, holder, key in _places(after):
        place = holder[key]
        if known.get(path) != place:
            continue
        moved = _moved(place, old, new, path)
        if moved != place:
            lines.append(f"{path}: {_shown(place)} is {_shown(moved)} on {new[0]} x {new[1]} nodes")
            holder[key] = moved
    for index, effect in enumerate(_mappings(after.get("effects"))):
        if isinstance(effect.get("width"), int):
            lines.append(
                f"effects[{index}].width: {effect['width']} counts cells, which have another size now"
            )
    return lines


def _nodes(content: dict[str, Any]) -> tuple[int, int] | None:
    lattice = content.get("lattice")
    nodes = lattice.get("nodes") if isinstance(lattice, dict) else None
    if isinstance(nodes, (list, tuple)) and len(nodes) == 2 and all(type(n) is int and n >= 2 for n in nodes):
        return nodes[0], nodes[1]
    return None  # the check of the whole scene names the problem


def _places(content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    # Path, holder and key of each value that may hold node numbers.
    points = content.get("points")
    if isinstance(points, dict):
        for name in points:
            yield f"points.{name}", points, name
    for index, effect in enumerate(_mappings(content.get("effects"))):
        if effect.get("type") in EFFECTS:
            for field in dataclasses.fields(effect_class(effect["type"])):
                if "location" in field.metadata and field.name in effect:
                    yield f"effects[{index}].{field.name}", effect, field.name
    for index, command in enumerate(_mappings(content.get("inputs"))):
        wrench = command.get("wrench")
        if isinstance(wrench, dict) and "frame" in wrench:
            yield f"inputs[{index}].wrench.frame", wrench, "frame"


def _mappings(value: object) -> list[dict[str, Any]]:
    # Entries that are no mappings keep their index.
    return [item if isinstance(item, dict) else {} for item in value] if isinstance(value, list) else []


def _moved(place: object, old: tuple[int, int], new: tuple[int, int], path: str) -> object:
    if isinstance(place, str):
        match = NODE_NAME.match(place.removesuffix(_ALIGNED))
        if match is None:
            return place
        i, j = _numbers((int(match[2]), int(match[3])), old, new, place, path)
        return f"node_{match[1]}_{i}_{j}{_ALIGNED if place.endswith(_ALIGNED) else ''}"
    if isinstance(place, (list, tuple)) and len(place) == 3 and all(type(n) is int for n in place[1:]):
        return [place[0], *_numbers((place[1], place[2]), old, new, place, path)]
    return place


def _numbers(
    node: tuple[int, int], old: tuple[int, int], new: tuple[int, int], place: object, path: str
) -> tuple[int, int]:
    moved = []
    for number, before, after in zip(node, old, new, strict=True):
        whole, rest = divmod(number * (after - 1), before - 1)
        if rest:
            raise SceneError(
                f"got {old[0]} x {old[1]} nodes changed to {new[0]} x {new[1]}, which have no node at "
                f"{_shown(place)}; expected a mesh with one there, or {path} given along with the nodes "
                f"(centre and free_edge hold on any mesh) @ {path}"
            )
        moved.append(whole)
    return moved[0], moved[1]


def _shown(place: object) -> str:
    return f"[{', '.join(map(str, place))}]" if isinstance(place, (list, tuple)) else str(place)
