"""The figures of the accuracy study: distributions of real, asked and estimated errors, as table, text and picture."""

from __future__ import annotations

import csv
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from ldcs_ros.study.accuracy.measure import Pair

# A reference is itself off by about this [m]: smaller errors are not told apart.
REFERENCE_ERROR = 2e-9


@dataclass(frozen=True)
class EstimateStatistics:
    """Distributions over pairs of a case and an accuracy.

    Attributes:
        pairs: Number of pairs with a result.
        stopped: Runs that ended early with a diagnosis.
        within: Fraction of pairs whose real error is within the asked one.
        ratio: Real over asked error: median, 95 % and worst.
        worst: The case of the worst.
        effectivity: Estimated over real error: 1 %, median and 99 %.
        consistent: Fraction of pairs whose estimate is at least the real error over 1.5.
        sharp: Fraction of pairs whose estimate is within ten times the real error.
    """

    pairs: int
    stopped: int
    within: float
    ratio: tuple[float, float, float]
    worst: str
    effectivity: tuple[float, float, float]
    consistent: float
    sharp: float


def figures(pairs: list[Pair]) -> EstimateStatistics:
    """Return the figures of pairs; at least one must have a result."""
    done = [pair for pair in pairs if not pair.failure]
    ratio = np.array([pair.real / pair.asked for pair in done])
    estimate = np.array([pair.estimate for pair in done])
    real = np.maximum([pair.real for pair in done], REFERENCE_ERROR)
    effectivity = np.maximum(estimate, REFERENCE_ERROR) / real
    worst = done[int(np.argmax(ratio))]
    return EstimateStatistics(
        len(done),
        len(pairs) - len(done),
        float(np.mean(ratio <= 1.0)),
        (float(np.median(ratio)), float(np.quantile(ratio, 0.95)), float(ratio.max())),
        f"{worst.case} at {worst.asked:g} m",
        (
            float(np.quantile(effectivity, 0.01)),
            float(np.median(effectivity)),
            float(np.quantile(effectivity, 0.99)),
        ),
        float(np.mean(effectivity >= 1.0 / 1.5)),
        float(np.mean(effectivity <= 10.0)),
    )


def text(found: EstimateStatistics) -> str:
    """Return the figures as lines, with what is asked for beside what is reached."""
    median, high, worst = found.ratio
    low, middle, top = found.effectivity
    return "\n".join(
        [
            f"pairs                       {found.pairs}, {found.stopped} stopped with a diagnosis",
            f"real <= asked               {found.within:.1%} (asked for: 95 %)",
            f"real / asked                median {median:.2g}, 95 % {high:.2g}, worst {worst:.2g} "
            f"({found.worst}; asked for: 3)",
            f"estimate / real             1 % {low:.2g}, median {middle:.2g}, 99 % {top:.2g}",
            f"estimate >= real / 1.5      {found.consistent:.1%} (asked for: 99 %)",
            f"estimate <= 10 real         {found.sharp:.1%} (asked for: 80 %)",
        ]
    )


def write(pairs: list[Pair], folder: Path) -> tuple[Path, Path]:
    """Write accuracy.csv and accuracy.png into a folder and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    table, picture = folder / "accuracy.csv", folder / "accuracy.png"
    with table.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(Pair)])
        writer.writeheader()
        writer.writerows(asdict(pair) for pair in pairs)
    _draw(pairs, picture)
    return table, picture


def _draw(pairs: list[Pair], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for asked in sorted({pair.asked for pair in pairs}, reverse=True):
        done = [pair for pair in pairs if pair.asked == asked and not pair.failure]
        if not done:
            continue
        part = np.arange(1, len(done) + 1) / len(done)
        real = np.maximum([pair.real for pair in done], REFERENCE_ERROR)
        estimate = np.maximum([pair.estimate for pair in done], REFERENCE_ERROR)
        left.plot(np.sort(real / asked), part, label=f"{asked:g} m")
        right.plot(np.sort(estimate / real), part)
    for axes, title in ((left, "real / asked error"), (right, "estimated / real error")):
        axes.axvline(1.0, color="0.6", linewidth=0.8)
        axes.set(xscale="log", xlabel=title, ylabel="fraction of the pairs")
    left.legend(title="asked")
    figure.savefig(path, dpi=150)
