"""Recommendation of a method from the numbers, as one paragraph."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ldcs_ros.study.rows import BASELINE, METHODS_APART, SCIPY, Row
from ldcs_ros.study.spatial_convergence import errors_against_finest

DEFAULT = "esdirk43"
TARGETS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # m
COMPETITORS = {BASELINE: "the compiled RKC2 baseline", SCIPY[0]: "SciPy's BDF"}
GAIN_ERROR = 2e-5  # m
Problem = tuple[str, int]


def cheapest(rows: Iterable[Row], target: float) -> Row | None:
    """Return the row with the least CPU time among those whose error is at most the target [m]."""
    good = [row for row in rows if row.kind == "curve" and not row.failure and row.error <= target]
    return min(good, key=lambda row: row.cpu) if good else None


def curves(rows: Sequence[Row]) -> dict[Problem, dict[str, list[Row]]]:
    """Return the points of the diagrams by problem and method."""
    found: dict[Problem, dict[str, list[Row]]] = {}
    for row in rows:
        if row.kind == "curve":
            found.setdefault((row.scene, row.nodes), {}).setdefault(row.method, []).append(row)
    return found


def cost_ratio(rows: Iterable[Row], ours: Row, target: float) -> float | None:
    """Return the cost of the cheapest of some rows over our row's at an error [m]; None if none reaches it."""
    other = cheapest(rows, target)
    return None if other is None else other.cpu / ours.cpu


def slowdowns(rows: Sequence[Row]) -> dict[str, dict[tuple[Problem, float], float]]:
    """Return the cost of each of our methods over the cheapest one's, by method, problem and error.

    Pairs of a problem and an error that only one method reaches are left out.
    """
    found: dict[str, dict[tuple[Problem, float], float]] = {}
    for problem, methods in curves(rows).items():
        for target in TARGETS:
            best = {
                name: cheapest(made, target) for name, made in methods.items() if name not in METHODS_APART
            }
            costs = {name: row.cpu for name, row in best.items() if row is not None}
            if len(costs) > 1:
                for name, cpu in costs.items():
                    found.setdefault(name, {})[problem, target] = cpu / min(costs.values())
    return found


def recommendation(rows: Sequence[Row]) -> str:
    """Return one paragraph: the method to use, its gain over other solvers, and the methods that never win."""
    ratios = slowdowns(rows)
    if not ratios:
        return "Too few rows for a recommendation: run the quick preset to its end."
    mean = {name: math.exp(sum(map(math.log, r.values())) / len(r)) for name, r in ratios.items()}
    # Of the methods that reach most errors, the one with the least mean cost.
    most = max(map(len, ratios.values()))
    best = min((name for name in ratios if len(ratios[name]) >= 0.9 * most), key=lambda name: mean[name])
    pairs = len({pair for found in ratios.values() for pair in found})
    parts = [
        f"Use `{best}`{' (the default)' if best == DEFAULT else ''}: in {pairs} pairs of a problem and an error it "
        f"costs {mean[best]:.2f} times the cheapest of our methods in the geometric mean, and "
        f"{max(ratios[best].values()):.1f} times at worst.",
        _gains(rows, best),
    ]
    winners = [
        name for name in sorted(mean, key=lambda name: mean[name]) if min(ratios[name].values()) == 1.0
    ]
    others = [name for name in winners if name != best]
    if others:
        parts.append(f"Sometimes cheaper: {'; '.join(_wins(name, ratios[name]) for name in others)}.")
    methods = {row.method for row in rows if row.kind == "curve"} - {*METHODS_APART, best, *others}
    if methods:
        names = ", ".join(f"`{name}`" for name in sorted(methods))
        parts.append(f"Slower in every test: {names}; they are kept as independent references.")
    return " ".join(part for part in [*parts, _about_lattices(rows)] if part)


def _wins(name: str, ratios: dict[tuple[Problem, float], float]) -> str:
    won: dict[Problem, list[float]] = {}
    for (problem, target), ratio in ratios.items():
        if ratio == 1.0:
            won.setdefault(problem, []).append(target)
    places = (
        f"`{scene}` {nodes} x {nodes} at "
        + " to ".join(f"{error:.0e}" for error in sorted({max(e), min(e)}, reverse=True))
        for (scene, nodes), e in won.items()
    )
    return f"`{name}` ({', '.join(f'{place} m' for place in places)})"


def _about_lattices(rows: Sequence[Row]) -> str:
    errors = errors_against_finest(rows)
    if not errors:
        return ""
    n = max(errors, key=lambda n: (n <= 9, n))
    enough = 10 ** math.floor(math.log10(errors[n] / 10.0))
    return (
        f"A {n} x {n} lattice is itself off by {1e3 * errors[n]:.2g} mm against the finest one here, so an accuracy "
        f"below {enough:.0e} m in time pays only with a finer lattice, or to compare runs of the same lattice."
    )


def _gains(rows: Sequence[Row], method: str) -> str:
    parts = []
    for (scene, nodes), methods in curves(rows).items():
        row = cheapest(methods.get(method, []), GAIN_ERROR)
        if row is None or scene not in ("arc", "paper"):
            continue
        ratios = [
            f"{ratio:.1f} times as fast as {label}"
            for name, label in COMPETITORS.items()
            if (ratio := cost_ratio(methods.get(name, []), row, GAIN_ERROR)) is not None
        ]
        text = f"`{scene}` {nodes} x {nodes} {1.0 / row.cpu:.3g} times real time"
        parts.append(text + (f" ({', '.join(ratios)})" if ratios else ""))
    return f"At an error of at most {GAIN_ERROR:.0e} m it runs {'; '.join(parts)}." if parts else ""
