"""The kernels of a run's first commands are there before its clock starts, and only where they are asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest
from small_sheet import small_sheet

from ldcs_ros import load_scene, shipped_scenes
from ldcs_ros.physics.compiled import HAVE_NUMBA
from ldcs_ros.twin.warm_up import warm_up

BARE = [{"type": "springs"}, {"type": "clamp"}]
KERNEL = "ldcs_ros.integrators.implicit.command_kernel"
CODE = f"""
import sys
from ldcs_ros import load_scene
from ldcs_ros.twin.warm_up import warm_up
warm_up(load_scene(sys.argv[1]), commanded=sys.argv[2] == "commanded")
kernel = sys.modules.get("{KERNEL}")
print("none" if kernel is None else len(kernel.advance.signatures))
"""


@pytest.mark.skipif(not HAVE_NUMBA, reason="the formula has a compiled form only")
@pytest.mark.parametrize(
    ("scene", "how", "kernels"),
    [("paper", "commanded", "1"), ("rig", "commanded", "1"), ("paper", "alone", "none")],
)
def test_the_kernel_of_commands_is_there_before_the_clock_runs(scene, how, kernels):
    found = subprocess.run(
        [sys.executable, "-c", CODE, scene, how], check=True, capture_output=True, text=True, timeout=170
    )
    assert found.stdout.strip() == kernels


@pytest.mark.parametrize("name", shipped_scenes())
def test_every_shipped_scene_can_be_warmed_up(name):
    warm_up(load_scene(name), commanded=True)


def test_a_scene_that_takes_no_command_is_warmed_up_without_one():
    warm_up(load_scene({**small_sheet(nodes=(2, 2)), "effects": BARE, "sensors": {}}), commanded=True)
