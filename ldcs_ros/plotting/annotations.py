"""Annotations of a picture from the recorded scene: rest shape, arms and loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ldcs_ros.bags import Recording
from ldcs_ros.errors import RecordingError
from ldcs_ros.messages.display.loads import SceneLoad, scene_loads
from ldcs_ros.physics.effects.arms import Arms
from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.effects.driven_edges import DrivenEdges
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Stencil, stencil_at
from ldcs_ros.schema.fields import SheetPlace
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
        driven: Lines along arms and driven edges, each as the points of the sheet that it joins.
        loads: Loads to mark.
    """

    title: str
    rest: np.ndarray
    point_rest: dict[str, np.ndarray]
    driven: tuple[tuple[Stencil, ...], ...]
    loads: tuple[SceneLoad, ...]


def annotations_of(recording: Recording, track: SurfaceTrack) -> Annotations:
    """Return the annotations of a bag's scene; a bag without one starts at rest, without loads.

    Raises:
        RecordingError: The clouds have another size than the scene.
    """
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
        driven=_driven_lines(effects, lattice),
        loads=tuple(scene_loads(lattice, scene.points, effects)),
    )


def _driven_lines(effects: Sequence[Effect], lattice: Lattice) -> tuple[tuple[Stencil, ...], ...]:
    lines = []
    for effect in effects:
        if isinstance(effect, Arms):
            lines += [(arm.start, arm.end) for arm in effect.placed(lattice)]
        elif isinstance(effect, DrivenEdges):
            length, side = lattice.size[0], 0.5 * lattice.size[1]
            heights = [-side if edge == "y_min" else side for edge in effect.edges]
            lines += [((0.0, y), (length, y)) for y in heights]
    return tuple(_along(lattice, *line) for line in lines)


def _along(lattice: Lattice, start: tuple[float, float], end: tuple[float, float]) -> tuple[Stencil, ...]:
    # As many points as nodes along the longer side; between them the bilinear sheet is nearly straight.
    fractions = np.linspace(0.0, 1.0, max(lattice.nodes))
    places = (np.array(start) + fraction * (np.array(end) - np.array(start)) for fraction in fractions)
    stencils = (stencil_at(lattice, SheetPlace(float(x), float(y))) for x, y in places)
    # A corner of weight 0 may be in a hole.
    return tuple(Stencil(one.nodes[one.weight > 0.0], one.weight[one.weight > 0.0]) for one in stencils)
