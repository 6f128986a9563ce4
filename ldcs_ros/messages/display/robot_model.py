"""The arms as a robot: the URDF of their links, and the frame of each link in ldcs_base."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

import numpy as np

from ldcs_ros.messages.display import colours
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.physics.effects.arms import Arms, ArmsTerm
from ldcs_ros.physics.effects.base import Assembly, Effect
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point

NAME = "ldcs_arms"
_WIDTH = 0.65
"""Radius of a link, in thicknesses of the sheet."""


class RobotModel:
    """The arms of a scene as chains of links.

    Link k of an arm has the frame `<arm>_link_<k>`: its origin is the begin of the link, its x axis lies along the
    link, and its y axis is horizontal. `<arm>_joint_<k>` turns it against the link before it about -y.

    Args:
        lattice: The lattice.
        points: The scene's named points.
        effects: The scene's effects; without arms the model has no links.
    """

    def __init__(self, lattice: Lattice, points: dict[str, Point], effects: Iterable[Effect]) -> None:
        self._lattice = lattice
        arms = next((effect for effect in effects if isinstance(effect, Arms)), None)
        self._term = None if arms is None else ArmsTerm(Assembly(lattice, points, lattice.node_mass), arms)

    def link_poses(self, link_angle: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return the position [m] and orientation (unit quaternion x, y, z, w) of each link's frame, by frame.

        Args:
            link_angle: Angles of the links to their arms' lines [rad], shape (n_arms, n_links).
        """
        term = self._term
        if term is None or not np.size(link_angle):
            return {}
        stations = term.station_positions(
            np.concatenate([np.zeros(3 * self._lattice.n_nodes), np.ravel(link_angle)])
        )
        poses = {}
        for k, name in enumerate(term.names):
            yaw = _yaw(term, k)
            for link in range(term.links[k]):
                pitch = float(link_angle[k, link])
                along = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
                begin = stations[k, link + 1] - term.link_length[k, link] * along
                poses[f"{name}_link_{link + 1}"] = begin, _link_orientation(yaw, pitch)
        return poses

    def description(self) -> str:
        """Return the URDF: links without mass, joints without limits; frames have no prefix."""
        robot = ElementTree.Element("robot", name=NAME)
        ElementTree.SubElement(robot, "link", name=BASE_FRAME)
        if self._term is not None:
            self._add_arms(robot, self._term)
        ElementTree.indent(robot)
        return ElementTree.tostring(robot, encoding="unicode")

    def _add_arms(self, robot: ElementTree.Element, term: ArmsTerm) -> None:
        rest = self.link_poses(np.zeros((term.n_arms, term.n_links)))
        for k, name in enumerate(term.names):
            parent, origin, yaw = BASE_FRAME, rest[f"{name}_link_1"][0], _yaw(term, k)
            for link in range(1, term.links[k] + 1):
                length, child = float(term.link_length[k, link - 1]), f"{name}_link_{link}"
                self._add_link(robot, child, length)
                joint = ElementTree.SubElement(robot, "joint", name=f"{name}_joint_{link}", type="continuous")
                ElementTree.SubElement(joint, "parent", link=parent)
                ElementTree.SubElement(joint, "child", link=child)
                ElementTree.SubElement(joint, "origin", xyz=_text(*origin), rpy=_text(0.0, 0.0, yaw))
                ElementTree.SubElement(joint, "axis", xyz="0 -1 0")
                parent, origin, yaw = child, np.array([length, 0.0, 0.0]), 0.0

    def _add_link(self, robot: ElementTree.Element, name: str, length: float) -> None:
        link = ElementTree.SubElement(robot, "link", name=name)
        visual = ElementTree.SubElement(link, "visual")
        # A cylinder of URDF lies along z.
        ElementTree.SubElement(
            visual, "origin", xyz=_text(0.5 * length, 0.0, 0.0), rpy=_text(0.0, 0.5 * np.pi, 0.0)
        )
        geometry = ElementTree.SubElement(visual, "geometry")
        ElementTree.SubElement(
            geometry, "cylinder", radius=_text(_WIDTH * float(self._lattice.size[2])), length=_text(length)
        )
        material = ElementTree.SubElement(visual, "material", name="arm")
        ElementTree.SubElement(material, "color", rgba=_text(*colours.ARM))


def _yaw(term: ArmsTerm, arm: int) -> float:
    """Return the direction of an arm's line in the plane of the sheet [rad]."""
    row = term.tables.arms[arm]
    return float(np.arctan2(row["direction_y"], row["direction_x"]))


def _link_orientation(yaw: float, pitch: float) -> np.ndarray:
    """Return the quaternion of a turn by `yaw` about z, then by `pitch` from x towards z [rad]."""
    cos_yaw, sin_yaw = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
    cos_pitch, sin_pitch = np.cos(0.5 * pitch), -np.sin(0.5 * pitch)
    return np.array([-sin_yaw * sin_pitch, cos_yaw * sin_pitch, sin_yaw * cos_pitch, cos_yaw * cos_pitch])


def _text(*numbers: float) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)
