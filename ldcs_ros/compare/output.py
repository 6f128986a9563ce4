"""The files of a comparison: a Markdown report with its pictures."""

from __future__ import annotations

import os
from pathlib import Path

from ldcs_ros.compare.comparison import Comparison
from ldcs_ros.compare.report import markdown

REPORT = "compare.md"


def write_report(comparison: Comparison, folder: Path) -> list[Path]:
    """Write compare.md, compare.png and, where both have nodes, surface_error.png; return their paths.

    Raises:
        OSError: The folder cannot be written.
    """
    from ldcs_ros.compare.pictures import channels_figure
    from ldcs_ros.compare.surface_picture import surface_figure
    from ldcs_ros.plotting.style import save_figure

    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    channels = channels_figure(comparison)
    if channels is not None:
        pictures.append(save_figure(channels, folder / "compare.png"))
    if comparison.surface is not None:
        figure = surface_figure(comparison.surface, comparison.a.name, comparison.b.name)
        pictures.append(save_figure(figure, folder / "surface_error.png"))
    partial = folder / f".{REPORT}.partial"
    partial.write_text(markdown(comparison, [path.name for path in pictures]), encoding="utf-8")
    os.replace(partial, folder / REPORT)
    return [folder / REPORT, *pictures]
