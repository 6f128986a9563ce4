"""All that viewers are shown of one scene: surface, arms, loads and traces, each built when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ldcs_ros.messages.display.arm_lines import ArmLines
from ldcs_ros.messages.display.loads import StandingLoad, load_figures, standing_loads, wrench_loads
from ldcs_ros.messages.display.marker import Figure, marker_array
from ldcs_ros.messages.display.traces import Traces
from ldcs_ros.messages.surface import SurfaceMesh
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.physics.inputs import Wrench
from ldcs_ros.scene.scene import Scene

MARKER_TOPICS = ("surface", "arms", "loads", "traces")


@dataclass(frozen=True)
class Shown:
    """What is shown at an instant.

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

    def __init__(self, scene: Scene, frame: str = BASE_FRAME) -> None:
        self._scene = scene
        self._frame = frame
        self._traces = Traces()

    def follow(self, time_ns: int, places: Mapping[str, np.ndarray]) -> None:
        """Take note of where the named points are [m] at a time [ns]: traces reach back before anybody looked."""
        self._traces.follow(time_ns, places)

    def build(self, topic: str, time_ns: int, shown: Shown) -> bytes:
        """Return the message of one of MARKER_TOPICS."""
        if topic == "surface":
            return self._surface.build(time_ns, shown.position)
        return marker_array(time_ns, self._frame, self.figures(topic, shown))

    def figures(self, topic: str, shown: Shown) -> list[Figure]:
        """Return what one of MARKER_TOPICS shows, except the surface."""
        if topic == "arms":
            return self._arms.figures(shown.position, shown.link_angle)
        if topic == "loads":
            standing = [load.at(shown.position) for load in self._standing]
            scene = self._scene
            held = wrench_loads(scene.lattice, scene.points, shown.wrenches, shown.position)
            return load_figures([*standing, *held])
        return self._traces.figures()

    @cached_property
    def _arms(self) -> ArmLines:
        return ArmLines(self._scene.lattice, self._scene.points, self._scene.effects)

    @cached_property
    def _surface(self) -> SurfaceMesh:
        lattice = self._scene.lattice
        return SurfaceMesh(lattice.nodes, float(lattice.size[0]), self._frame)

    @cached_property
    def _standing(self) -> list[StandingLoad]:
        return standing_loads(self._scene.lattice, self._scene.points, self._scene.effects)
