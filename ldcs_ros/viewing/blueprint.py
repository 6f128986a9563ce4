"""The layout of the viewer: the sheet at the left, the plots of points and drives at the right."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Mapping
from types import ModuleType

import numpy as np

from ldcs_ros.viewing.rerun_package import rerun
from ldcs_ros.viewing.rerun_scene import ARMS, LOADS, PLOTS, POINTS, SURFACE, TIMELINE, TRACES

_PAPER, _GREY = (250, 250, 250, 255), (120, 120, 120, 110)
_GRID = 0.02  # m between two lines of the floor
_EYE, _TARGET = (0.9, -1.3, 1.0), (0.5, 0.0, 0.08)  # lengths of the sheet


def blueprint(
    points: Iterable[str],
    plots: Mapping[str, str],
    *,
    size: np.ndarray | None = None,
    play: str = "playing",
    frame: bool = True,
) -> object:
    """Return the rerun blueprint.

    Args:
        points: Named points that have a trace.
        plots: Path of each plot by its title.
        size: Length, width and thickness of the sheet [m], shape (3,); None for the paper's.
        play: 'playing', 'paused' or 'following' the newest data.
        frame: Show the viewer's own menu bar.
    """
    rrb = _module()
    views = [
        rrb.TimeSeriesView(
            origin=f"/{PLOTS}/{path}", name=title, plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop)
        )
        for title, path in plots.items()
    ]
    rows = [_tabs(rrb, group) for group in _grouped(list(plots), views)]
    sheet = _sheet(rrb, points, 0.14 if size is None else float(size[0]))
    parts = [sheet, rrb.Vertical(*rows)] if rows else [sheet]
    return rrb.Blueprint(
        rrb.Horizontal(*parts, column_shares=[3, 2][: len(parts)]),
        rrb.TopPanel(state="expanded" if frame else "hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state=play, loop_mode="off"),
        auto_views=False,
    )


def _module() -> ModuleType:
    rerun()
    return importlib.import_module("rerun.blueprint")


def _sheet(rrb: ModuleType, points: Iterable[str], length: float) -> object:
    past = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    floor = rerun().components.Plane3D.XY.with_distance(-0.25 * length)
    half = 500.0 * length  # the scale of `colours.of_height`
    return rrb.Spatial3DView(
        origin="/",
        name=f"surface by height: violet {-half:.0f} mm, teal 0, yellow {half:+.0f} mm",
        contents=[f"+ /{one}/**" for one in (SURFACE, ARMS, LOADS, POINTS, TRACES)],
        background=rrb.Background(color=_PAPER),
        line_grid=rrb.LineGrid3D(visible=True, spacing=_GRID, color=_GREY, stroke_width=0.6, plane=floor),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            # From the side: the bent sheet, and the trace of P1 beyond its free edge.
            position=tuple(length * part for part in _EYE),
            look_target=tuple(length * part for part in _TARGET),
            eye_up=(0.0, 0.0, 1.0),
        ),
        overrides={f"/{TRACES}/{name}": past for name in points},
    )


def _grouped(titles: list[str], views: list[object]) -> list[list[object]]:
    """Return the views row by row: a row for each point, and one for all drives."""
    rows: dict[str, list[object]] = {}
    for title, view in zip(titles, views, strict=True):
        owner = title.split(" ")[0] if ": " in title else ""
        rows.setdefault(owner, []).append(view)
    return list(rows.values())


def _tabs(rrb: ModuleType, views: list[object]) -> object:
    return views[0] if len(views) == 1 else rrb.Tabs(*views)
