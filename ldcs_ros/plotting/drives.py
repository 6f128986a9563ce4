"""The drives of the arms against time: measured pressures, joint torques and joint angles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

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
        panels.append((_PRESSURE, _in_kpa(pressures)))
    if joints:
        names, angle, torque = joints
        panels.append(("drive torque [N m]", _columns(names, torque, 1.0)))
        panels.append(("joint angle [deg]", _columns(names, angle, float(np.rad2deg(1.0)))))
    if not panels:
        return None
    merged = [
        [(group, _label(group, lines), track) for group, track in _merged(lines)] for _, lines in panels
    ]
    key_columns = max(math.ceil(len(groups) / KEY_ROWS) for groups in merged)
    longest = max(len(label) for groups in merged for _, label, _ in groups)
    figure, grid = stacked_axes(
        len(panels),
        style,
        row=0.92 * style.row,
        foot=3.8,
        head=3.8 if style.headed else 0.8,
        right=max(10.8, key_columns * (3.6 + 0.56 * longest)),
        hspace=0.16,
    )
    for axes, (label, lines), groups in zip(grid, panels, merged, strict=True):
        for group, name, track in groups:
            axes.plot(
                track.time,
                track.value,
                label=name,
                linewidth=1.6 * style.scale,
                **_line_style(group[0], lines),
            )
        if label == _PRESSURE and commanded:
            asked = _in_kpa(commanded)
            for group, track in _merged(asked):
                look = _line_style(group[0], lines if group[0] in lines else asked)
                name = f"{_label(group, asked)}, commanded"
                axes.plot(track.time, track.value, label=name, linewidth=0.7 * style.scale, alpha=0.7, **look)
        style_axes(axes, x_label="time [s]" if axes is grid[-1] else "", y_label=label, style=style)
        axes.margins(x=0.0, y=0.1)
        axes.axhline(0.0, color=SOFT_INK, linewidth=0.6, zorder=1)
        axes.legend(
            loc="center left",
            bbox_to_anchor=(1.01, 0.5),
            frameon=False,
            fontsize=style.label - 1.0,
            labelspacing=0.35,
            handlelength=2.0 * style.scale,
            ncols=math.ceil(len(groups) / KEY_ROWS),
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


def _line_style(name: str, lines: Mapping[str, Track]) -> dict[str, Any]:
    # A colour for each joint and dashes for each arm, so that nearly equal arms all show; without joints a colour for
    # each arm.
    arms, joints = (list(dict.fromkeys(_arm_and_joint(one)[part] for one in lines)) for part in (0, 1))
    arm, joint = _arm_and_joint(name)
    if not joint:
        turn, colour = divmod(arms.index(arm), len(LINE_COLOURS))
        return {"color": LINE_COLOURS[colour], "linestyle": DASHES[turn % len(DASHES)]}
    return {
        "color": LINE_COLOURS[joints.index(joint) % len(LINE_COLOURS)],
        "linestyle": DASHES[arms.index(arm) % len(DASHES)],
    }


def _arm_and_joint(name: str) -> tuple[str, str]:
    """Return `left` and `1` for left_joint_1, `left` and an empty text for left."""
    arm, _, joint = name.partition("_joint_")
    return arm, joint
