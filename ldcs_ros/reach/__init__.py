"""Inverse statics: the commands, within bounds, under which points of the sheet rest at their targets.

targets, bounds -> Gauss-Newton steps with bounds <-> rest states and their sensitivities -> commands, distance
"""

from __future__ import annotations

from ldcs_ros.reach.course import CommandCourse, Trajectory, find_course, read_trajectory
from ldcs_ros.reach.free_arms import free_arms
from ldcs_ros.reach.reach import Reached, TargetCoordinate, Variable, reach
from ldcs_ros.reach.shapes import ShapeTarget, shape_target
from ldcs_ros.reach.workspace import Workspace, workspace

__all__ = [
    "CommandCourse",
    "Reached",
    "ShapeTarget",
    "TargetCoordinate",
    "Trajectory",
    "Variable",
    "Workspace",
    "find_course",
    "free_arms",
    "reach",
    "read_trajectory",
    "shape_target",
    "workspace",
]
