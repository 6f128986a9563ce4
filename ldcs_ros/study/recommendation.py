"""What to use, as one paragraph from the numbers: which method costs least, over what, and where another does."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ldcs_ros.study.spatial import against_finest
from ldcs_ros.study.tasks import BASELINE, METHODS_APART, SCIPY, Row

DEFAULT = "esdirk43"
TARGETS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # m
RIVALS = {BASELINE: "compiled RKC2 baseline", SCIPY[0]: "SciPy's BDF"}


def cheapest(rows: Iterable[Row], target: float) -> Row | None:
    """Return the row with the least CPU time among those whose error is at most the target [m]."""
    good = [row for row in rows if row.kind == "curve" and not row.failure and row.error <= target]
    return min(good, key=lambda row: row.cpu) if good else None


def curves(rows: Sequence[Row]) -> dict[tuple[str, int], dict[str, list[Row]]]:
    """Return the points of the diagrams by problem and method."""
    found: dict[tuple[str, int], dict[str, list[Row]]] = {}
    for row in rows:
        if row.kind == "curve":
            found.setdefault((row.scene, row.nodes), {}).setdefault(row.method, []).append(row)
    return found


def slowdowns(rows: Sequence[Row]) -> tuple[dict[str, list[float]], int]:
    """Return how many times the cheapest one each of our methods costs, where it reaches the error, and how many
    pairs of a problem and an error were open to more than one method."""
    found: dict[str, list[float]] = {}
    contests = 0
    for methods in curves(rows).values():
        for target in TARGETS:
            best = {
                name: cheapest(made, target) for name, made in methods.items() if name not in METHODS_APART
            }
            able = {name: row.cpu for name, row in best.items() if row is not None}
            if len(able) > 1:
                contests += 1
                for name, cpu in able.items():
                    found.setdefault(name, []).append(cpu / min(able.values()))
    return found, contests


def recommendation(rows: Sequence[Row]) -> str:
    """Return one paragraph: what to use, what it gains over what else there is, what never pays."""
    found, contests = slowdowns(rows)
    if not contests:
        return "Too few rows for a recommendation: run the quick preset to its end."
    typical = {name: math.exp(sum(map(math.log, ratios)) / len(ratios)) for name, ratios in found.items()}
    # First the methods that reach most errors, then the one that costs least in the mean over all of them.
    most = max(len(ratios) for ratios in found.values())
    first = min((name for name in found if len(found[name]) >= 0.9 * most), key=lambda name: typical[name])
    text = (
        f"Use `{first}`{' (the default)' if first == DEFAULT else ''}: in {contests} pairs of a problem and "
        f"an error it "
        f"costs {typical[first]:.2f} times what the cheapest of our methods does, in the geometric mean, and "
        f"{max(found[first]):.1f} times at worst. {_gains(curves(rows), first)}"
    )
    others = sorted(
        (name for name in found if name != first and min(found[name]) == 1.0), key=lambda n: typical[n]
    )
    if others:
        text += "Sometimes cheaper: " + "; ".join(_where_cheaper(rows, name, first) for name in others) + ". "
    tried = {row.method for row in rows if row.kind == "curve"} - set(METHODS_APART)
    beaten = sorted(tried - {first, *others})
    if beaten:
        names = ", ".join(f"`{name}`" for name in beaten)
        text += (
            f"Beaten everywhere here: {names}; they stay for comparison, and because each checks the others. "
        )
    return (text + _about_lattices(rows)).strip()


def _where_cheaper(rows: Sequence[Row], name: str, first: str) -> str:
    places = []
    for (scene, nodes), methods in curves(rows).items():
        won = []
        for target in TARGETS:
            able = {n: cheapest(made, target) for n, made in methods.items() if n not in METHODS_APART}
            costs = {n: row.cpu for n, row in able.items() if row is not None}
            if len(costs) > 1 and costs.get(name) == min(costs.values()):
                won.append(target)
        if won:
            span = f"{max(won):.0e}" if len(won) == 1 else f"{max(won):.0e} to {min(won):.0e}"
            places.append(f"`{scene}` {nodes} x {nodes} at {span} m")
    return f"`{name}` ({', '.join(places)})"


def _about_lattices(rows: Sequence[Row]) -> str:
    spatial = against_finest([*rows])
    if not spatial:
        return ""
    n = max(spatial, key=lambda n: (n <= 9, n))
    enough = 10 ** math.floor(math.log10(spatial[n] / 10.0))
    return (
        f"A {n} x {n} lattice is itself off by {1e3 * spatial[n]:.2g} mm against the finest one here, so an "
        f"accuracy "
        f"below {enough:.0e} m in time pays only with a finer lattice, or to compare runs of the same lattice."
    )


def _gains(problems: dict[tuple[str, int], dict[str, list[Row]]], ours: str) -> str:
    parts = []
    for (scene, nodes), methods in problems.items():
        row = cheapest(methods.get(ours, []), 2e-5)
        if row is None or scene not in ("arc", "paper"):
            continue
        words = f"`{scene}` {nodes} x {nodes} {1.0 / row.cpu:.3g} times real time"
        ratios = [
            f"{ratio:.1f} times as fast as the {label}".replace("the SciPy", "SciPy")
            for name, label in RIVALS.items()
            if (ratio := gain(methods.get(name, []), row, 2e-5)) is not None
        ]
        parts.append(words + (f" ({', '.join(ratios)})" if ratios else ""))
    return f"At an error of at most 2e-5 m it runs {'; '.join(parts)}. " if parts else ""


def gain(rival: Iterable[Row], ours: Row, target: float) -> float | None:
    """Return how many times our row's cost a rival's rows cost at an error [m], or None if they do not reach it."""
    other = cheapest(rival, target)
    return None if other is None else other.cpu / ours.cpu
