"""Inverse statics: the commands, within bounds, under which points of the sheet rest at their targets.

targets, bounds -> Gauss-Newton steps with bounds <-> rest states and their sensitivities -> commands, distance
"""

from __future__ import annotations

from ldcs_ros.reach.reach import Reached, TargetCoordinate, Variable, reach

__all__ = ["Reached", "TargetCoordinate", "Variable", "reach"]
