"""Scenes drawn from the whole schema: every effect, every field within its declared bounds, and commands."""

from __future__ import annotations

import dataclasses
import math

from hypothesis import strategies as st

from ldcs_ros.physics.effects import EFFECTS, effect_class

DURATION = 0.05  # s
# Numbers are drawn over this many decades around a default, and now and then at the declared bounds.
DECADES = 3.0
# Fields without a default, or whose bounds are far from anything that is a sheet: (low, high).
RANGES = {
    ("force", "value"): (-5.0, 5.0),
    ("payload", "mass"): (0.0, 10.0),
    ("floor", "height"): (-0.1, 0.0),
    ("driven_edges", "curvature"): (-50.0, 50.0),
    ("gravity", "acceleration"): (-50.0, 50.0),
    ("arms", "links"): (1, 5),
    ("arms", "width"): (0, 1),
    ("arms", "curvature"): (-50.0, 50.0),
    ("arms", "rigid_base"): (0.0, 0.005),
    ("arms", "backbone_height"): (-0.004, 0.004),
}
PLACES = ("P0", "P1", "centre", "free_edge", "node_top_0_0")


def _around(default: float, low: float, high: float):
    if default == 0.0 or not math.isfinite(default):
        return st.floats(max(low, -1.0), min(high, 1.0))
    spread = st.floats(-DECADES, DECADES).map(lambda power: min(max(default * 10.0**power, low), high))
    return st.one_of(spread, spread, spread, st.just(float(low)) if low > 0.0 or low == 0.0 else spread)


def _field(effect: str, field: dataclasses.Field):
    meta = field.metadata
    if meta.get("location"):
        return st.sampled_from(PLACES)
    if "options" in meta:
        one = st.sampled_from(meta["options"])
        return st.lists(one, min_size=1, unique=True) if meta.get("several") else one
    known = RANGES.get((effect, field.name))
    whole = field.type in ("int", int)
    if known:
        one = st.integers(*known) if whole else st.floats(*known)
    elif whole:
        one = st.integers(max(meta["low"], 0), min(meta["high"], 3))
    else:
        first = field.default[0] if isinstance(field.default, tuple) else field.default
        one = _around(float(first), meta["low"], meta["high"])
    return one if meta["length"] is None else st.lists(one, min_size=meta["length"], max_size=meta["length"])


@st.composite
def effects(draw):
    """Draw a list of effects: springs and a random choice of the others, each with some of its fields."""
    names = ["springs", *draw(st.lists(st.sampled_from(sorted(set(EFFECTS) - {"springs"})), unique=True))]
    if "arms" in names:
        names = [name for name in names if name != "driven_edges"]
    blocks = []
    for name in names:
        block = {"type": name}
        for field in dataclasses.fields(effect_class(name)):
            required = field.default is dataclasses.MISSING
            if field.default in (None, ()):  # a name, a region or a list that has no value to draw around
                continue
            if required or (name, field.name) in RANGES or draw(st.booleans()):
                block[field.name] = draw(_field(name, field))
        blocks.append(block)
    return blocks


@st.composite
def commands(draw, blocks):
    """Draw a schedule that the scene's effects accept or refuse with a reason."""
    types = {block["type"]: block for block in blocks}
    times = sorted(draw(st.lists(st.floats(0.0, DURATION), max_size=4)))
    schedule = []
    for time in times:
        drive = types["arms"].get("drive", "torque") if "arms" in types else None
        command = {"time": time}
        if drive == "torque":
            command["torque"] = draw(st.floats(-0.2, 0.2))
        if drive == "pressure":
            command["pressure"] = draw(st.floats(0.0, 2e5))
        if "wrench" in types:
            vector = st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3)
            frame = draw(st.sampled_from(PLACES)) + draw(st.sampled_from(("", "_aligned")))
            command["wrench"] = {"frame": frame, "force": draw(vector), "torque": draw(vector)}
        if len(command) > 1:
            schedule.append(command)
    return schedule


@st.composite
def scenes(draw):
    """Draw a whole scene."""
    blocks = draw(effects())
    side = st.floats(0.02, 0.5)
    return {
        "lattice": {
            "size": [draw(side), draw(side), draw(st.floats(1e-4, 0.05))],
            "nodes": [draw(st.integers(2, 5)), draw(st.integers(2, 5))],
            "mass": draw(st.floats(1e-3, 1.0)),
        },
        "points": {"P0": ["mid", "centre"], "P1": ["mid", "free_edge"]},
        "effects": blocks,
        "inputs": draw(commands(blocks)),
        "solver": {
            "integrator": draw(st.sampled_from(("auto", "esdirk43", "trbdf2"))),
            "accuracy": draw(st.sampled_from((1e-3, 1e-4, 1e-5))),
        },
    }
