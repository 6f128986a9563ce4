"""The loads on the sheet as arrows, spheres and labels for viewers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from ldcs_ros.messages.display import colours
from ldcs_ros.messages.display.colours import Colour
from ldcs_ros.messages.display.marker import ARROW, SPHERE, TEXT, MarkerSpec
from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.effects.force import Force
from ldcs_ros.physics.effects.gravity import Gravity
from ldcs_ros.physics.effects.payload import Payload
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point, point_at

METRES_PER_NEWTON = 0.1
METRES_PER_NEWTON_METRE = 1.0
_SHAFT, _HEAD, _HEAD_LENGTH = 0.002, 0.005, 0.008
_TEXT_HEIGHT, _TEXT_LIFT = 0.008, 0.008
_ABOVE = np.array([0.0, 0.0, 0.014])
_STEEL = 7850.0  # kg/m^3: a payload is drawn as the steel ball that weighs as much
_SMALLEST = 1e-9  # N, N m: less is no arrow


@dataclass(frozen=True)
class Load:
    """A load on the sheet.

    Attributes:
        name: Name in viewers that list markers.
        position: Point of application in ldcs_base [m], shape (3,).
        force: Force in ldcs_base [N], shape (3,).
        torque: Torque in ldcs_base [N m], shape (3,).
        mass: Mass that is fixed there [kg].
    """

    name: str
    position: np.ndarray
    force: np.ndarray
    torque: np.ndarray = field(default_factory=lambda: np.zeros(3))
    mass: float = 0.0


@dataclass(frozen=True)
class SceneLoad:
    """A load that a scene names: it stays, only its point moves.

    Attributes:
        name: Name in viewers.
        point: Point of application.
        force: Force in ldcs_base [N], shape (3,).
        mass: Mass that is fixed there [kg].
    """

    name: str
    point: Point
    force: np.ndarray
    mass: float = 0.0

    def at(self, position: np.ndarray) -> Load:
        """Return the load for node positions [m] of shape (n_nodes, 3)."""
        return Load(self.name, self.point.position(position), self.force, mass=self.mass)


def scene_loads(lattice: Lattice, points: dict[str, Point], effects: Iterable[Effect]) -> list[SceneLoad]:
    """Return the point forces of a scene, and its payloads with their weight."""
    effects = tuple(effects)
    gravity = sum(
        (np.array(one.acceleration, dtype=float) for one in effects if isinstance(one, Gravity)), np.zeros(3)
    )
    loads = []
    for effect in effects:
        if isinstance(effect, Force):
            where = point_at(lattice, effect.at, points)
            loads.append(SceneLoad("force", where, np.array(effect.value, dtype=float)))
        elif isinstance(effect, Payload):
            where = point_at(lattice, effect.at, points)
            loads.append(SceneLoad("payload", where, effect.mass * gravity, effect.mass))
    return loads


def wrench_loads(
    lattice: Lattice, points: dict[str, Point], wrenches: Mapping[str, Wrench], position: np.ndarray
) -> list[Load]:
    """Return commanded wrenches as loads in the axes of ldcs_base.

    Args:
        lattice: The lattice.
        points: The scene's named points.
        wrenches: Wrenches by frame; in the frame's axes, or with `_aligned` in those
            of ldcs_base.
        position: Node positions [m], shape (n_nodes, 3).
    """
    loads = []
    for frame, wrench in wrenches.items():
        place, orientation = point_at(lattice, frame.removesuffix("_aligned"), points).pose(position)
        force, torque = (np.asarray(vector, dtype=float) for vector in (wrench.force, wrench.torque))
        if not frame.endswith("_aligned"):
            force, torque = rotate(orientation, force), rotate(orientation, torque)
        loads.append(Load(frame, place, force, torque))
    return loads


def load_specs(loads: Iterable[Load]) -> list[MarkerSpec]:
    """Return what is drawn of loads.

    A force is an arrow of 0.1 m per newton, a torque one of 1 m per newton metre along its axis, both with the
    size written beside them; a mass is a steel ball of that weight.
    """
    return [spec for load in loads for spec in _drawn(load)]


def rotate(quaternion: np.ndarray, vector: Iterable[float]) -> np.ndarray:
    """Return a vector turned by a unit quaternion x, y, z, w, shape (3,)."""
    axis, scalar = np.asarray(quaternion[:3], dtype=float), float(quaternion[3])
    vector = np.asarray(tuple(vector), dtype=float)
    across = np.cross(axis, vector)
    return vector + 2.0 * (scalar * across + np.cross(axis, across))


def _drawn(load: Load) -> Iterator[MarkerSpec]:
    force, torque = float(np.linalg.norm(load.force)), float(np.linalg.norm(load.torque))
    label = []
    if load.mass > 0.0:
        size = 2.0 * (0.75 * load.mass / (np.pi * _STEEL)) ** (1.0 / 3.0)
        yield MarkerSpec(load.name, SPHERE, (size, size, size), colours.PAYLOAD, position=load.position)
        label.append(f"{1e3 * load.mass:.3g} g")
    if force > _SMALLEST:
        yield _arrow(load.name, load.position, METRES_PER_NEWTON * load.force, colours.FORCE)
        label += [f"{force:.3g} N"] if load.mass == 0.0 else []
    if torque > _SMALLEST:
        name = f"{load.name}/torque"
        yield _arrow(name, load.position, METRES_PER_NEWTON_METRE * load.torque, colours.TORQUE)
        label.append(f"{torque:.3g} N m")
    if label:
        # At the arrow's tip, where no other name is written; that of a torque alone above its place.
        tip = METRES_PER_NEWTON * load.force
        place = load.position + (tip * (1.0 + _TEXT_LIFT / np.linalg.norm(tip)) if tip.any() else _ABOVE)
        size_of_text = (0.0, 0.0, _TEXT_HEIGHT)
        name = f"{load.name}/label"
        yield MarkerSpec(name, TEXT, size_of_text, colours.TEXT, position=place, text=", ".join(label))


def _arrow(name: str, start: np.ndarray, reach: np.ndarray, colour: Colour) -> MarkerSpec:
    return MarkerSpec(name, ARROW, (_SHAFT, _HEAD, _HEAD_LENGTH), colour, points=(start, start + reach))
