"""Defaults and bounds of all parameters of the effects are the ones that docs/reference.md states."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from ldcs_ros.physics.effects import EFFECTS, effect_class

REFERENCE = (Path(__file__).resolve().parents[2] / "docs/reference.md").read_text(encoding="utf-8")


def documented(name):
    """Return (default, range) of each parameter of an effect by its key, as the reference writes them."""
    section = re.search(rf"^### {name}\n(.*?)^##", REFERENCE.partition("\n## effects\n")[2], re.S | re.M)
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ((?:[^|]|\\\|)*) \|", section.group(1), re.M)
    return {key: (default, bounds) for key, default, bounds in rows}


@pytest.mark.parametrize("name", EFFECTS)
def test_the_parameters_of_an_effect_are_documented_with_their_defaults_and_bounds(name):
    rows, numbers = documented(name), 0
    for field in dataclasses.fields(effect_class(name)):
        if type(field.default) not in (int, float):
            continue
        default, bounds = rows[field.name]
        numbers += 1
        assert float(default.split()[0]) == pytest.approx(field.default, rel=1e-5), field.name
        low, high = bounds.split(" ... ")
        assert float(low) == pytest.approx(field.metadata["low"], rel=1e-5), field.name
        assert float(high) == pytest.approx(field.metadata["high"], rel=1e-5), field.name
    assert numbers > 0 or name in ("gravity", "clamp", "payload", "force")
