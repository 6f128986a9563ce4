"""The files of a comparison: a Markdown report with its pictures."""

from __future__ import annotations

import os
from pathlib import Path

from ldcs_ros.compare.comparison import Comparison
from ldcs_ros.compare.report import markdown

REPORT = "compare.md"


def write_report(
    comparison: Comparison, folder: Path, *, kind: str = "png", width: str = "screen"
) -> list[Path]:
    """Write compare.md, compare.png and, where both have nodes, surface_error.png; return their paths.

    Args:
        comparison: What was found.
        folder: Where to; made if needed.
        kind: Format of the pictures: 'png', 'pdf', 'svg'.
        width: Their size: 'screen', or for print 'column' or 'page'.

    Raises:
        OSError: The folder cannot be written.
    """
    from ldcs_ros.compare.pictures import channels_figure
    from ldcs_ros.compare.surface_picture import surface_figure
    from ldcs_ros.plotting.style import LOOKS, save_figure

    look = LOOKS[width]

    folder.mkdir(parents=True, exist_ok=True)
    pictures = []
    channels = channels_figure(comparison, look)
    if channels is not None:
        pictures.append(save_figure(channels, folder / f"compare.{kind}", look))
    if comparison.surface is not None:
        figure = surface_figure(comparison.surface, comparison.a.name, comparison.b.name, look)
        pictures.append(save_figure(figure, folder / f"surface_error.{kind}", look))
    partial = folder / f".{REPORT}.partial"
    partial.write_text(markdown(comparison, [path.name for path in pictures]), encoding="utf-8")
    os.replace(partial, folder / REPORT)
    return [folder / REPORT, *pictures]
