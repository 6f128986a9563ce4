"""The figures of the accuracy study: distributions of real, asked and estimated errors, as table, text and picture."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from ldcs_ros.study.accuracy.measure import Pair
from ldcs_ros.study.report import markdown_table

# A reference is itself off by about this [m]: smaller errors are not told apart.
REFERENCE_ERROR = 2e-9
TABLE, PICTURE = "accuracy.csv", "accuracy.png"
_READERS = {"str": str, "float": float, "int": int}
# Groups of cases, each by the beginnings of its cases' names; the first that fits counts.
GROUPS = {
    "(a) shipped scenes": ("shipped_",),
    "(b) random scenes": ("random_",),
    "(d) free flight": ("free_flight_",),
    "(e) commands at a rate": ("torques_at_",),
    "(c) violent events": ("",),
}


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


def read_pairs(folder: Path) -> list[Pair]:
    """Return the pairs of a folder's table; none without one."""
    table = folder / TABLE
    if not table.exists():
        return []
    with table.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return [
        Pair(**{field.name: _READERS[str(field.type)](row[field.name]) for field in fields(Pair)})
        for row in rows
    ]


def write_pairs(pairs: list[Pair], folder: Path) -> None:
    """Write pairs as a folder's table."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / TABLE).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([field.name for field in fields(Pair)])
        for pair in pairs:
            writer.writerow(f"{v:.4g}" if isinstance(v, float) else v for v in asdict(pair).values())


def grouped(pairs: list[Pair]) -> dict[str, list[Pair]]:
    """Return the pairs with a result by the name of their group, groups without one left out."""
    found: dict[str, list[Pair]] = {name: [] for name in sorted(GROUPS)}
    for pair in pairs:
        if not pair.failure:
            name = next(name for name, heads in GROUPS.items() if pair.case.startswith(heads))
            found[name].append(pair)
    return {name: some for name, some in found.items() if some}


def page(pairs: list[Pair], command: str) -> str:
    """Return the figures as Markdown: by group and by asked accuracy, the other promises, and what is missed."""
    alone = len({pair.case for pair in pairs if pair.reference == "SciPy"})
    cases = len({pair.case for pair in pairs})
    parts = [
        "# What accuracy is worth",
        f"Written by `{command}`: {len(pairs)} pairs of a case and an asked accuracy. Errors are Euclidean, of the "
        f"worst node at the worst look (100 a case, 200 per second of a shipped scene). {alone} of {cases} cases have "
        "a reference that shares no code with the solver; where that takes above 2 s of computing, a run at a "
        "hundredth of the finest accuracy takes its place.",
        f"![Distributions of real and estimated errors]({PICTURE})",
        "## Positions",
        markdown_table(_HEAD, _lines({**grouped(pairs), **_by_accuracy(pairs), "all": pairs})),
        "## Velocities, orientations, joint angles",
        _PROMISES,
        markdown_table(_OTHERS, _other_lines(grouped(pairs) | {"all": pairs})),
        "## Missed",
        *(list(_missed(pairs)) or ["None."]),
    ]
    return "\n\n".join(parts) + "\n"


_HEAD = (
    "group",
    "pairs",
    "within asked",
    "real / asked: median",
    "95 %",
    "worst",
    "estimate / real: 1 %",
    "median",
    "99 %",
    "estimate >= real / 1.5",
    "<= 10 real",
    "stopped",
)
_OTHERS = ("group", "quantity", "pairs", "within the promise", "error / promise: median", "95 %", "worst")
_PROMISES = (
    "Promised are, with a the asked accuracy: node velocities within a omega, omega the fastest undamped frequency of "
    "the scene at rest; orientations of points within 3 a / s, s the shortest distance between the nodes that give an "
    "axis; joint angles within 3 a / l, l the shortest link; joint rates within 3 a omega / l. The estimated velocity "
    "is `statistics.velocity_estimate`, compared with the real error."
)


def _by_accuracy(pairs: list[Pair]) -> dict[str, list[Pair]]:
    asked = sorted({pair.asked for pair in pairs}, reverse=True)
    return {f"asked {one:g} m": [pair for pair in pairs if pair.asked == one] for one in asked}


def _lines(groups: dict[str, list[Pair]]) -> Iterator[tuple[str, ...]]:
    for name, some in groups.items():
        if all(pair.failure for pair in some):
            continue
        found = figures(some)
        shares = (f"{share:.0%}" for share in (found.consistent, found.sharp))
        numbers = (f"{value:.2g}" for value in (*found.ratio, *found.effectivity))
        yield (name, str(found.pairs), f"{found.within:.0%}", *numbers, *shares, str(found.stopped))


def _other_lines(groups: dict[str, list[Pair]]) -> Iterator[tuple[str, ...]]:
    for name, some in groups.items():
        done = [pair for pair in some if not pair.failure]
        armed = [pair for pair in done if pair.joint_promise and pair.joint]  # without prescribed joints
        for quantity, shares in {
            "velocity": [pair.velocity / pair.velocity_promise for pair in done if pair.velocity_promise],
            "orientation": [pair.turn / pair.turn_promise for pair in done if pair.turn_promise],
            "joint angle": [pair.joint / pair.joint_promise for pair in armed],
            "joint rate": [
                pair.joint_rate / (pair.joint_promise * pair.velocity_promise / pair.asked) for pair in armed
            ],
            "velocity, real / estimated": [
                pair.velocity / max(pair.velocity_estimate, 1e-300) for pair in done if pair.velocity_estimate
            ],
        }.items():
            if shares:
                numbers = np.median(shares), np.quantile(shares, 0.95), np.max(shares)
                within = f"{np.mean(np.array(shares) <= 1.0):.0%}"
                yield (name, quantity, str(len(shares)), within, *(f"{value:.2g}" for value in numbers))


def _missed(pairs: list[Pair]) -> Iterator[str]:
    for pair in sorted(pairs, key=lambda pair: -pair.real / pair.asked):
        says = f"the run says {pair.estimate / pair.asked:.2g} times"
        if pair.failure:
            yield f"- `{pair.case}` at {pair.asked:g} m: stopped: {pair.failure}"
        elif pair.real > pair.asked:
            yield f"- `{pair.case}` at {pair.asked:g} m: {pair.real / pair.asked:.2g} times; {says}."
        elif pair.estimate * 1.5 < max(pair.real, REFERENCE_ERROR):
            yield f"- `{pair.case}` at {pair.asked:g} m: {pair.real / pair.asked:.2g} times, but {says}."


# Ratios that the picture shows.
SHOWN = 1e-3, 1e3


def draw(pairs: list[Pair], path: Path) -> None:
    """Draw the distributions of real over asked and of estimated over real errors as a picture."""
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
        # Of an estimate that a motion amplified without end, the picture says that it leaves at the right.
        axes.set(xscale="log", xlabel=title, ylabel="fraction of the pairs", xlim=SHOWN)
    left.legend(title="asked")
    figure.savefig(path, dpi=150)
