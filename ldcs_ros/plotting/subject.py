"""The subject of a picture: what the recorded scene says about rest shape, arms and loads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.signals.tracks import SurfaceTrack


@dataclass(frozen=True)
class Load:
    """A load to mark.

    Attributes:
        point: Where it acts.
        label: What to write beside it, with unit.
        direction: Unit vector of a force in ldcs_base, shape (3,); None for a mass.
    """

    point: Point
    label: str
    direction: np.ndarray | None


@dataclass(frozen=True)
class Subject:
    """What is known about the recorded system.

    Attributes:
        title: Title of its scene; the bag's name if it does not say.
        rest: Rest positions [m], shape (2, nx, ny, 3).
        point_rest: Rest positions of named points [m], shape (3,) each.
        driven: Border rows j that arms or driven edges hold, to be drawn as black lines.
        loads: Loads to mark.
    """

    title: str
    rest: np.ndarray
    point_rest: dict[str, np.ndarray]
    driven: tuple[int, ...]
    loads: tuple[Load, ...]


def subject_of(recording: Any, track: SurfaceTrack) -> Subject:
    """Return what a bag says about its scene; a bag without one starts at rest and has nothing to mark."""
    text = recording.custom_data.get("scene")
    if text is None:
        return Subject(recording.name, track.position(0), {}, (), ())
    from ldcs_ros.scene.load import parse_scene

    scene = parse_scene(text, name=recording.custom_data.get("scene_name", ""), origin=recording.name)
    return subject_of_scene(scene, title=scene.title or recording.name)


def subject_of_scene(scene: Any, *, title: str) -> Subject:
    """Return what a scene says, under a title."""
    lattice: Lattice = scene.lattice
    effects = scene.effects
    rest = lattice.rest_position
    return Subject(
        title=title,
        rest=rest.reshape(2, *lattice.nodes, 3),
        point_rest={name: point.position(rest) for name, point in scene.points.items()},
        driven=_driven_rows(effects, lattice.nodes[1]),
        loads=tuple(_loads(effects, lattice, scene.points)),
    )


def _driven_rows(effects: Any, ny: int) -> tuple[int, ...]:
    rows: set[int] = set()
    for effect in effects:
        if effect.name == "arms":
            rows |= {0, ny - 1}
        elif effect.name == "driven_edges":
            rows |= {0 if edge == "y_min" else ny - 1 for edge in effect.edges}
    return tuple(sorted(rows))


def _loads(effects: Any, lattice: Lattice, points: dict[str, Point]) -> list[Load]:
    loads = []
    for effect in effects:
        if effect.name == "payload":
            loads.append(Load(point_at(lattice, effect.at, points), f"{1e3 * effect.mass:g} g", None))
        elif effect.name == "force":
            value = np.asarray(effect.value, dtype=float)
            size = float(np.linalg.norm(value))
            if size > 0.0:
                loads.append(Load(point_at(lattice, effect.at, points), f"{size:g} N", value / size))
    return loads
