"""What this project set out to reach, and what the rows of a study say: asked, reached, kept or missed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ldcs_ros.study.command_rates import ACCURACY, against_smooth
from ldcs_ros.study.growth import exponents, measured, peak_memory
from ldcs_ros.study.recommendation import cheapest, curves, gain
from ldcs_ros.study.tasks import BASELINE, METHODS_APART, SCIPY, Row

# (scene, nodes, error [m]) -> times real time.
SPEEDS = {
    ("arc", 9, 1e-5): 100.0,
    ("paper", 9, 1e-5): 60.0,
    ("arc", 9, 1e-6): 50.0,
    ("paper", 9, 1e-6): 50.0,
    ("arc", 33, 2e-5): 8.0,
    ("arc", 65, 2e-5): 1.0,
}
LARGEST, MOST_MEMORY = 129, 2048.0  # nodes along a side, MiB
SMALLEST, MOST_EXPONENT = 17, 1.3
COMMAND_RATES = {100.0: 0.5, 1000.0: None}  # Hz -> least share of the smooth case's speed
PROMISED_SHARE, PROMISED_FACTOR = 0.95, 3.0
NAMES = {BASELINE: "compiled RKC2", SCIPY[0]: "SciPy BDF"}


@dataclass(frozen=True)
class Target:
    """One line of the table.

    Attributes:
        name: What is asked of.
        asked: What is asked, in words.
        reached: What was measured, in words.
        kept: Whether it was reached; None if nothing was asked or nothing measured.
        beside: How others do on the same, in the same run.
    """

    name: str
    asked: str
    reached: str
    kept: bool | None
    beside: str = ""

    @property
    def verdict(self) -> str:
        """'kept', 'MISSED', or '-' where there is nothing to judge."""
        return "-" if self.kept is None else "kept" if self.kept else "MISSED"


def targets(rows: Sequence[Row]) -> list[Target]:
    """Return all targets in the order in which they were set; what was not measured says so."""
    return [*_speeds(rows), *_large(rows), *_commands(rows), *_promise(rows)]


def promised(rows: Sequence[Row]) -> tuple[int, float, float]:
    """Return the number of (scene, accuracy) pairs, the share of them within what was asked, and the worst factor."""
    made = [row for row in rows if row.kind == "promise"]
    factors = [row.error / row.value if not row.failure else math.inf for row in made]
    share = sum(factor <= 1.0 for factor in factors) / len(factors) if factors else 1.0
    return len(factors), share, max(factors, default=0.0)


def _speeds(rows: Sequence[Row]) -> Iterator[Target]:
    for (scene, nodes, error), least in SPEEDS.items():
        methods = curves(rows).get((scene, nodes), {})
        own = [row for name, made in methods.items() if name not in METHODS_APART for row in made]
        name, asked = f"`{scene}` {nodes} x {nodes}, error <= {error:.0e} m", f">= {least:g} x real time"
        row = cheapest(own, error)
        if row is None:
            why = next((row.failure for row in own if row.failure), "not measured")
            yield Target(name, asked, why, False if own else None)
            continue
        reached = 1.0 / row.cpu
        text = f"{reached:.3g} x (`{row.method}`, error {row.error:.1e} m)"
        yield Target(name, asked, text, reached >= least, _rivals(methods, row, error))


def _rivals(methods: dict[str, list[Row]], ours: Row, error: float) -> str:
    parts = []
    for name, label in NAMES.items():
        made = methods.get(name, [])
        ratio = gain(made, ours, error)
        if ratio is not None:
            parts.append(f"{label}: {ratio:.1f} times ours")
        elif made and (tried := [row for row in made if not row.failure]):
            nearest = min(tried, key=lambda row: row.error)
            parts.append(f"{label}: {nearest.cpu / ours.cpu:.1f} times ours, error {nearest.error:.1e} m")
        elif made:
            parts.append(f"{label}: not run to its end, {made[0].failure}")
    return "; ".join(parts)


def _large(rows: Sequence[Row]) -> Iterator[Target]:
    sizes = {row.nodes: row for row in rows if row.kind == "growth"}
    name, asked = f"{LARGEST} x {LARGEST} runs, peak memory", "< 2 GiB"
    largest = sizes.get(LARGEST)
    if largest is None or largest.failure:
        why, kept = ("not measured", None) if largest is None else (largest.failure, False)
        yield Target(name, asked, why, kept)
    else:
        peak = peak_memory(largest)
        text = f"{peak / 1024.0:.2f} GiB; {1.0 / largest.cpu:.2g} x real time at {largest.value:.0e} m"
        yield Target(name, asked, text, peak < MOST_MEMORY)
    name = f"cost of `arc_material` as nodes to the power, {SMALLEST} to {LARGEST} a side"
    made = [row for row in measured([*rows]) if SMALLEST <= row.nodes <= LARGEST]
    reach = {row.nodes for row in made}
    if len(made) < 2:
        yield Target(name, f"<= {MOST_EXPONENT:g}", "not measured", None)
        return
    fitted, ends = exponents(made)
    text = f"{fitted:.2f} (least squares), {ends:.2f} (end to end)"
    whole = {SMALLEST, LARGEST} <= reach
    if not whole:
        text += f", only {min(reach)} to {max(reach)} a side measured"
    yield Target(name, f"<= {MOST_EXPONENT:g}", text, max(fitted, ends) <= MOST_EXPONENT if whole else None)


def _commands(rows: Sequence[Row]) -> Iterator[Target]:
    shares = against_smooth([*rows])
    for scene, by_rate in shares.items():
        for rate, least in COMMAND_RATES.items():
            if rate not in by_rate:
                continue
            share, row = by_rate[rate]
            text = f"{share:.2f} of smooth ({1.0 / row.cpu:.3g} x real time, error {row.error:.1e} m)"
            kept = None if least is None else share >= least and row.error <= ACCURACY
            others = {
                other.method: other
                for other in rows
                if other.kind == "rate"
                and (other.scene, other.value) == (scene, rate)
                and other.method in NAMES
            }
            yield Target(
                f"`{scene}`, commands at {rate:g} Hz, {ACCURACY:.0e} m",
                "-" if least is None else f">= {least:g} of the smooth case",
                text,
                kept,
                "; ".join(
                    f"{NAMES[method]}: {other.failure}"
                    if other.failure
                    else f"{NAMES[method]}: {other.cpu / row.cpu:.2g} times ours"
                    for method, other in others.items()
                ),
            )
    if not shares:
        yield Target("commands at 100 Hz", ">= 0.5 of the smooth case", "not measured", None)


def _promise(rows: Sequence[Row]) -> Iterator[Target]:
    pairs, share, worst = promised(rows)
    shown = f"of {pairs} pairs of a shipped scene and an accuracy" if pairs else "not measured"
    yield Target(
        "real error within the asked one",
        f">= {100 * PROMISED_SHARE:.0f} % of pairs",
        f"{100 * share:.0f} % {shown}" if pairs else shown,
        share >= PROMISED_SHARE if pairs else None,
    )
    yield Target(
        "largest real error over the asked one",
        f"<= {PROMISED_FACTOR:g}",
        f"{worst:.2f}" if pairs else shown,
        worst <= PROMISED_FACTOR if pairs else None,
    )
