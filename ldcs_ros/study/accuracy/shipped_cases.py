"""The shipped scenes as cases of the accuracy study, as long as their references take minutes at most."""

from __future__ import annotations

from ldcs_ros.scene.load import load_scene, shipped_scenes
from ldcs_ros.study.accuracy.random_scenes import Case

DURATION = 1.0  # s
# Many nodes or stiff arms: less is enough for drive, transients and contact to show.
SHORTER = {"free_flight": 0.6, "gripper_strip": 0.3, "mould": 0.2, "perforated": 0.3, "three_arms": 0.6}
LOOKS_PER_SECOND = 200


def shipped_cases() -> list[Case]:
    """Return a case for each shipped scene."""
    cases = []
    for name in shipped_scenes():
        duration = SHORTER.get(name, DURATION)
        looks = round(duration * LOOKS_PER_SECOND)
        cases.append(Case(f"shipped_{name}", load_scene(name).content, duration, looks=looks))
    return cases
