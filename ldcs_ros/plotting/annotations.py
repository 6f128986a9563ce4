"""Annotations of a picture from the recorded scene: rest shape, arms and loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.display.loads import SceneLoad, scene_loads
from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.effects.driven_edges import DrivenEdges
from ldcs_ros.signals.topics import recorded_scene
from ldcs_ros.signals.tracks import SurfaceTrack
from ldcs_ros.simulation.problem import Problem


@dataclass(frozen=True)
class Annotations:
    """Rest shape, arms and loads of the recorded system.

    Attributes:
        title: Title of its scene, or the bag's name.
        rest: Rest positions [m], shape (2, nx, ny, 3).
        point_rest: Rest positions of named points [m], shape (3,) each.
        driven: Border rows j that arms or driven edges hold, to be drawn as black lines.
        loads: Loads to mark.
    """

    title: str
    rest: np.ndarray
    point_rest: dict[str, np.ndarray]
    driven: tuple[int, ...]
    loads: tuple[SceneLoad, ...]


def annotations_of(recording: Recording, track: SurfaceTrack) -> Annotations:
    """Return the annotations of a bag's scene; a bag without one starts at rest, without loads."""
    scene = recorded_scene(recording)
    if scene is None:
        return Annotations(recording.name, track.position(0), {}, (), ())
    if tuple(scene.lattice.nodes) != track.nodes:
        raise RecordingError(
            f"{recording.name} has clouds of {track.nodes} nodes, its scene has {tuple(scene.lattice.nodes)}"
        )
    return annotations_of_scene(scene, title=scene.title or recording.name)


def annotations_of_scene(scene: Problem, *, title: str) -> Annotations:
    """Return the annotations of a scene, under a title."""
    lattice = scene.lattice
    effects = scene.effects
    rest = lattice.reference_position
    return Annotations(
        title=title,
        rest=rest.reshape(2, *lattice.nodes, 3),
        point_rest={name: point.position(rest) for name, point in scene.points.items()},
        driven=_driven_rows(effects, lattice.nodes[1]),
        loads=tuple(scene_loads(lattice, scene.points, effects)),
    )


def _driven_rows(effects: Sequence[Effect], ny: int) -> tuple[int, ...]:
    rows: set[int] = set()
    for effect in effects:
        if effect.name == "arms":
            rows |= {0, ny - 1}
        elif isinstance(effect, DrivenEdges):
            rows |= {0 if edge == "y_min" else ny - 1 for edge in effect.edges}
    return tuple(sorted(rows))
