"""The shipped scenes as cases of the accuracy study, as long as their references take minutes at most."""

from __future__ import annotations

from ldcs_ros.scene.load import load_scene, shipped_scenes
from ldcs_ros.study.accuracy.random_scenes import Case

# s: the first command acts at 0, and the fastest motion follows it.
DURATION = 0.1
# Many nodes make a reference slow, two by two none.
OTHER = {
    "single_spring": 1.0,
    "free_flight": 0.2,
    "hanging_sheet": 0.2,
    "mould": 0.02,
    "perforated": 0.02,
    "gripper_strip": 0.1,
}
LOOKS_PER_SECOND = 200


def shipped_cases() -> list[Case]:
    """Return a case for each shipped scene."""
    cases = []
    for name in shipped_scenes():
        duration = OTHER.get(name, DURATION)
        looks = round(duration * LOOKS_PER_SECOND)
        cases.append(Case(f"shipped_{name}", load_scene(name).content, duration, looks=looks))
    return cases
