"""The drives of the arms against time: measured pressures, joint torques and joint angles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ldcs_ros.plotting.style import (
    LINE_COLOURS,
    SCREEN,
    SOFT_INK,
    FigureStyle,
    add_title,
    stacked_axes,
    style_axes,
)
from ldcs_ros.signals.tracks import Track

KPA = 1e-3
_PRESSURE = "gauge pressure [kPa]"
KEY_ROWS = 14
MOST_NAMED = 4
"""Arms up to which each line is named; of more arms, a key names each arm once."""
_LONGEST_NAME = 12
_PALEST = 0.35
_THIN, _PALE = "thin: commanded", "palest: joint 1"
DASHES: tuple[str | tuple[int, tuple[int, ...]], ...] = ("solid", (0, (3, 2)), (0, (1, 1)), (0, (5, 1, 1, 1)))


def drives_figure(
    pressures: Mapping[str, Track],
    joints: tuple[tuple[str, ...], Track, Track] | None,
    *,
    commanded: Mapping[str, Track] | None = None,
    title: str,
    style: FigureStyle = SCREEN,
) -> Figure | None:
    """Draw pressures, joint torques and joint angles, a panel each; None for a sheet without drives.

    Args:
        pressures: Measured gauge pressures [Pa], shape (n,), by arm.
        joints: Joint names, angles [rad] and torques [N m], shape (n, n_joints) each.
        commanded: Commanded gauge pressures [Pa] by arm, as the corners of their steps; drawn thin.
        title: Heading of the figure.
        style: Sizes.
    """
    panels: list[tuple[str, dict[str, Track]]] = []
    if pressures:
        # Arms in the scene's order, which the joints have: one colour for an arm in all panels.
        order = [_arm_and_joint(name)[0] for name in joints[0]] if joints else []
        arms = dict.fromkeys([arm for arm in order if arm in pressures] + list(pressures))
        panels.append((_PRESSURE, _in_kpa({name: pressures[name] for name in arms})))
    if joints:
        names, angle, torque = joints
        panels.append(("drive torque [N m]", _columns(names, torque, 1.0)))
        panels.append(("joint angle [deg]", _columns(names, angle, float(np.rad2deg(1.0)))))
    if not panels:
        return None
    many = len({_arm_and_joint(name)[0] for _, lines in panels for name in lines}) > MOST_NAMED
    merged = [
        [(group, _label(group, lines), track) for group, track in _merged(lines)] for _, lines in panels
    ]
    keys = [
        _key_of_arms(lines) if many else [label for _, label, _ in groups]
        for (_, lines), groups in zip(panels, merged, strict=True)
    ]
    key_columns = max(math.ceil(len(key) / KEY_ROWS) for key in keys)
    longest, note_width = max(len(label) for label in chain(*keys)), len(_THIN) if many else 0
    figure, grid = stacked_axes(
        len(panels),
        style,
        row=0.92 * style.row,
        foot=3.8,
        head=3.8 if style.headed else 0.8,
        right=max(10.8, key_columns * (3.6 + 0.56 * longest) + 0.56 * max(note_width - longest, 0)),
        hspace=0.16,
    )
    for axes, (label, lines), groups, key in zip(grid, panels, merged, keys, strict=True):
        for group, name, track in groups:
            look = _line_style(group[-1 if many else 0], lines, many=many)
            axes.plot(track.time, track.value, label=name, linewidth=1.6 * style.scale, **look)
        if label == _PRESSURE and commanded:
            asked = _in_kpa(commanded)
            for group, track in _merged(asked):
                look = _line_style(group[0], lines if group[0] in lines else asked, many=many)
                name = f"{_label(group, asked)}, commanded"
                thin = {"linewidth": 0.7 * style.scale, **look, "alpha": 0.7}
                axes.plot(track.time, track.value, label=name, **thin)
        style_axes(axes, x_label="time [s]" if axes is grid[-1] else "", y_label=label, style=style)
        axes.margins(x=0.0, y=0.1)
        axes.axhline(0.0, color=SOFT_INK, linewidth=0.6, zorder=1)
        note = _PALE if len(groups) > len(key) else _THIN if commanded and label == _PRESSURE else ""
        handles = _handles_of_arms(lines, key, note) if many else None
        axes.legend(
            handles=handles,
            loc="center left",
            bbox_to_anchor=(1.01, 0.5),
            frameon=False,
            fontsize=style.label - 1.0,
            labelspacing=0.35,
            handlelength=2.0 * style.scale,
            ncols=math.ceil(len(key) / KEY_ROWS),
        )
    add_title(figure, title, style=style)
    return figure


def _in_kpa(pressures: Mapping[str, Track]) -> dict[str, Track]:
    return {name: Track(track.time, KPA * track.value) for name, track in pressures.items()}


def _columns(names: tuple[str, ...], track: Track, factor: float) -> dict[str, Track]:
    return {name: Track(track.time, factor * track.value[:, k]) for k, name in enumerate(names)}


def _merged(lines: Mapping[str, Track]) -> list[tuple[list[str], Track]]:
    """Return the lines with those that would hide each other put together."""
    span = max((float(np.ptp(track.value)) for track in lines.values() if track.value.size), default=0.0)
    groups: list[tuple[list[str], Track]] = []
    for name, track in lines.items():
        for names, other in groups:
            if len(other.time) == len(track.time) and np.allclose(
                other.value, track.value, rtol=0.0, atol=0.01 * span
            ):
                names.append(name)
                break
        else:
            groups.append(([name], track))
    return groups


def _label(names: list[str], lines: Mapping[str, Track]) -> str:
    """Return `left joint 1`, `joints 2-4` (of all arms), `left`, `all arms`: the name of a merged line."""
    arms = list(dict.fromkeys(_arm_and_joint(name)[0] for name in names))
    joints = list(dict.fromkeys(_arm_and_joint(name)[1] for name in names))
    all_arms = {_arm_and_joint(name)[0] for name in lines}
    if joints == [""]:
        return "all arms" if len(arms) == len(all_arms) > 1 else ", ".join(arms)
    if len(names) < len(arms) * len(joints):
        return ", ".join(" joint ".join(_arm_and_joint(name)) for name in names)
    numbered = f"joint{'s' if len(joints) > 1 else ''} {_range(joints)}"
    return numbered if len(arms) == len(all_arms) else f"{' '.join(arms)} {numbered}"


def _range(joints: list[str]) -> str:
    numbers = [int(joint) for joint in joints if joint.isdecimal()]
    run = len(numbers) == len(joints) > 1 and numbers == list(range(numbers[0], numbers[-1] + 1))
    return f"{numbers[0]}-{numbers[-1]}" if run else ", ".join(joints)


def _key_of_arms(lines: Mapping[str, Track]) -> list[str]:
    """Return the name of each arm, without its middle where it is long."""
    arms = dict.fromkeys(_arm_and_joint(name)[0] for name in lines)
    return [arm if len(arm) <= _LONGEST_NAME else f"{arm[:5]}\u2026{arm[-6:]}" for arm in arms]


def _handles_of_arms(lines: Mapping[str, Track], key: list[str], note: str) -> list[Line2D]:
    """Return a line for each arm of a key, and one for a note on thin or pale lines."""
    last = {_arm_and_joint(name)[0]: name for name in lines}
    looks = [_line_style(name, lines, many=True) for name in last.values()]
    handles = [Line2D([], [], label=name, **look) for name, look in zip(key, looks, strict=True)]
    notes: dict[str, dict[str, Any]] = {_THIN: {"linewidth": 0.7}, _PALE: {"alpha": _PALEST}}
    if note:
        handles.append(Line2D([], [], color=SOFT_INK, label=note, **notes[note]))
    return handles


def _line_style(name: str, lines: Mapping[str, Track], *, many: bool) -> dict[str, Any]:
    # Of many arms, a colour for each arm and a paler one for the joints near its base. Else a colour for each joint and
    # dashes for each arm, so that nearly equal arms all show; without joints a colour for each arm.
    arms, joints = (list(dict.fromkeys(_arm_and_joint(one)[part] for one in lines)) for part in (0, 1))
    arm, joint = _arm_and_joint(name)
    if many or not joint:
        turn, colour = divmod(arms.index(arm), len(LINE_COLOURS))
        depth = joints.index(joint) / max(len(joints) - 1, 1) if len(joints) > 1 else 1.0
        look = {"color": LINE_COLOURS[colour], "linestyle": DASHES[turn % len(DASHES)]}
        return {**look, "alpha": _PALEST + (1.0 - _PALEST) * depth} if many else look
    return {
        "color": LINE_COLOURS[joints.index(joint) % len(LINE_COLOURS)],
        "linestyle": DASHES[arms.index(arm) % len(DASHES)],
    }


def _arm_and_joint(name: str) -> tuple[str, str]:
    """Return `left` and `1` for left_joint_1, `left` and an empty text for left."""
    arm, _, joint = name.partition("_joint_")
    return arm, joint
