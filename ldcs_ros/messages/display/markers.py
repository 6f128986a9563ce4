"""All markers of one scene: surface, arms, loads and traces, each built on demand."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ldcs_ros.messages.display import colours
from ldcs_ros.messages.display.arm_lines import ArmLines
from ldcs_ros.messages.display.loads import SceneLoad, load_specs, scene_loads, wrench_loads
from ldcs_ros.messages.display.marker import LINE_STRIP, MarkerSpec, marker_array
from ldcs_ros.messages.display.surface import SurfaceMesh
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.simulation.problem import Problem

STEP = 2.5e-4  # m between two points of a trace
LENGTH = 1000  # points of a trace
_WIDTH = 0.0015  # m


class Traces:
    """Follows points and draws a line for each, of its last 1000 places that are 0.25 mm apart.

    A point at rest keeps its trace. When time goes back, the traces restart.
    """

    def __init__(self) -> None:
        self._places: dict[str, deque[np.ndarray]] = {}
        self._last_time = 0

    def follow(self, time_ns: int, places: Mapping[str, np.ndarray]) -> None:
        """Add the places of the points at a time [ns]; places in ldcs_base [m], shape (3,), by point."""
        if time_ns < self._last_time:
            self._places.clear()
        self._last_time = time_ns
        for name, place in places.items():
            trace = self._places.setdefault(name, deque(maxlen=LENGTH))
            if not trace or abs(trace[-1] - place).max() >= STEP:
                trace.append(place)

    def specs(self) -> list[MarkerSpec]:
        """Return a line for each point that has moved."""
        return [
            MarkerSpec(name, LINE_STRIP, (_WIDTH, 0.0, 0.0), colours.of_point(number), points=list(trace))
            for number, (name, trace) in enumerate(sorted(self._places.items()))
            # Viewers complain about a line of one point.
            if len(trace) > 1
        ]


MARKER_TOPICS = ("surface", "arms", "loads", "traces")


@dataclass(frozen=True)
class DrawableState:
    """The state that is drawn at an instant.

    Attributes:
        position: Node positions in ldcs_base [m], shape (n_nodes, 3).
        link_angle: Angles of the arms' links to the x axis [rad], shape (n_arms, n_links); empty for none.
        wrenches: Commanded wrenches by frame, each with `force` [N] and `torque` [N m].
    """

    position: np.ndarray
    link_angle: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    wrenches: Mapping[str, Wrench] = field(default_factory=dict)


class Markers:
    """Builds the marker messages of a scene, from a running simulation or from a bag alike.

    Args:
        scene: Has `lattice`, `points` and `effects`.
        frame: Name of the base frame.
    """

    def __init__(self, scene: Problem, frame: str = BASE_FRAME) -> None:
        self._scene = scene
        self._frame = frame
        self._traces = Traces()

    def follow(self, time_ns: int, places: Mapping[str, np.ndarray]) -> None:
        """Add the places of named points [m], shape (3,); traces reach back before the first subscriber."""
        self._traces.follow(time_ns, places)

    def build(self, topic: str, time_ns: int, shown: DrawableState) -> bytes:
        """Return the message of one of MARKER_TOPICS."""
        if topic == "surface":
            return self._surface.build(time_ns, shown.position)
        return marker_array(time_ns, self._frame, self.specs(topic, shown))

    def specs(self, topic: str, shown: DrawableState) -> list[MarkerSpec]:
        """Return what one of MARKER_TOPICS shows, except the surface."""
        if topic == "arms":
            return self._arms.specs(shown.position, shown.link_angle)
        if topic == "loads":
            standing = [load.at(shown.position) for load in self._scene_loads]
            scene = self._scene
            held = wrench_loads(scene.lattice, scene.points, shown.wrenches, shown.position)
            return load_specs([*standing, *held])
        return self._traces.specs()

    @cached_property
    def _arms(self) -> ArmLines:
        return ArmLines(self._scene.lattice, self._scene.points, self._scene.effects)

    @cached_property
    def _surface(self) -> SurfaceMesh:
        lattice = self._scene.lattice
        return SurfaceMesh(lattice.nodes, float(lattice.size[0]), self._frame, lattice.missing)

    @cached_property
    def _scene_loads(self) -> list[SceneLoad]:
        return scene_loads(self._scene.lattice, self._scene.points, self._scene.effects)
