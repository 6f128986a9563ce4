"""The catalogue: every hard case, by chapter."""

from __future__ import annotations

from ldcs_ros.study.hard.case import HardCase
from ldcs_ros.study.hard.contacts import CONTACT_CASES
from ldcs_ros.study.hard.lattices import LATTICE_CASES
from ldcs_ros.study.hard.loads import LOAD_CASES
from ldcs_ros.study.hard.shapes import SHAPE_CASES
from ldcs_ros.study.hard.steps import STEP_CASES
from ldcs_ros.study.hard.stiffness import STIFFNESS_CASES

CHAPTERS: dict[str, tuple[HardCase, ...]] = {
    "Stiffness and damping": STIFFNESS_CASES,
    "Loads": LOAD_CASES,
    "Shapes": SHAPE_CASES,
    "Contact": CONTACT_CASES,
    "Forced steps and long runs": STEP_CASES,
    "Lattices": LATTICE_CASES,
}
CASES: dict[str, HardCase] = {case.name: case for cases in CHAPTERS.values() for case in cases}
