"""Performance targets and what the rows of a study say about them: asked, reached, met or missed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ldcs_ros.study.accuracy_check import MAX_FACTOR, MIN_FRACTION, accuracy_summary
from ldcs_ros.study.command_rates import ACCURACY, rate_costs
from ldcs_ros.study.paired_runs import ASKED, SHIPPED, paired_costs
from ldcs_ros.study.recommendation import cheapest, cost_ratio, curves
from ldcs_ros.study.rows import BASELINE, METHODS_APART, SCIPY, Row
from ldcs_ros.study.scaling import exponents, measured_sizes, peak_memory

SPEEDS = {
    ("arc", 9, 1e-5): 100.0,
    ("paper", 9, 1e-5): 60.0,
    ("arc", 9, 1e-6): 50.0,
    ("paper", 9, 1e-6): 50.0,
    ("arc", 33, 2e-5): 8.0,
    ("arc", 65, 2e-5): 1.0,
}
# (scene, nodes, error) -> (solver, how many times our CPU time it is asked to take).
RIVALS = {
    ("arc", 9, 1e-5): (BASELINE, 3.0),
    ("arc", 17, 1e-5): (BASELINE, 4.0),
    ("arc", 33, 1e-5): (BASELINE, 6.0),
    ("paper", 9, 1e-5): (SCIPY[0], 25.0),
    ("paper", 9, 1e-6): (SCIPY[0], 25.0),
}
COMMANDED_RIVAL = 1.2  # the compiled RKC2's CPU time over ours on `arc_pushed`
LARGEST, MAX_MEMORY = 129, 2048.0  # nodes along a side, MiB
SMALLEST, MAX_EXPONENT = 17, 1.3
COMMAND_RATES = {100.0: 0.5, 1000.0: None}  # Hz -> smallest fraction of the smooth case's speed
NAMES = {BASELINE: "compiled RKC2", SCIPY[0]: "SciPy BDF"}


@dataclass(frozen=True)
class Target:
    """A line of the table.

    Attributes:
        name: Quantity that the target limits.
        asked: The limit, in words.
        reached: The measurement, in words.
        met: Whether the limit is met; None without a limit or a measurement.
        others: The other solvers' measurements in the same run.
    """

    name: str
    asked: str
    reached: str
    met: bool | None
    others: str = ""

    @property
    def verdict(self) -> str:
        """'met', 'MISSED', or '-' where there is nothing to judge."""
        return "-" if self.met is None else "met" if self.met else "MISSED"


def targets(rows: Sequence[Row]) -> list[Target]:
    """Return all targets in the order in which they were set, with or without a measurement."""
    return [*_speeds(rows), *_rivals(rows), *_large(rows), *_commands(rows), *_pairs(rows), *_accuracy(rows)]


def _speeds(rows: Sequence[Row]) -> Iterator[Target]:
    for (scene, nodes, error), lowest in SPEEDS.items():
        methods = curves(rows).get((scene, nodes), {})
        own = [row for name, made in methods.items() if name not in METHODS_APART for row in made]
        name, asked = f"`{scene}` {nodes} x {nodes}, error <= {error:.0e} m", f">= {lowest:g} x real time"
        row = cheapest(own, error)
        if row is None:
            reason = next((row.failure for row in own if row.failure), "not measured")
            yield Target(name, asked, reason, False if own else None)
            continue
        reached = 1.0 / row.cpu
        text = f"{reached:.3g} x (`{row.method}`, error {row.error:.1e} m)"
        yield Target(name, asked, text, reached >= lowest, _competitors(methods, row, error))


def _rivals(rows: Sequence[Row]) -> Iterator[Target]:
    for (scene, nodes, error), (solver, lowest) in RIVALS.items():
        methods = curves(rows).get((scene, nodes), {})
        ours = cheapest(
            (row for name, made in methods.items() if name not in METHODS_APART for row in made), error
        )
        ratio = None if ours is None else cost_ratio(methods.get(solver, []), ours, error)
        yield Target(
            f"`{scene}` {nodes} x {nodes}, error <= {error:.0e} m, against {NAMES[solver]}",
            f">= {lowest:g} times as fast",
            "not measured" if ratio is None else f"{ratio:.2f} times",
            None if ratio is None else ratio >= lowest,
        )


def _competitors(methods: dict[str, list[Row]], ours: Row, error: float) -> str:
    parts = []
    for name, label in NAMES.items():
        made = methods.get(name, [])
        ratio = cost_ratio(made, ours, error)
        if ratio is not None:
            parts.append(f"{label}: {ratio:.1f} times ours")
        elif made and (tried := [row for row in made if not row.failure]):
            nearest = min(tried, key=lambda row: row.error)
            parts.append(f"{label}: {nearest.cpu / ours.cpu:.1f} times ours, error {nearest.error:.1e} m")
        elif made:
            parts.append(f"{label}: not run to its end, {made[0].failure}")
    return "; ".join(parts)


def _large(rows: Sequence[Row]) -> Iterator[Target]:
    name, asked = f"{LARGEST} x {LARGEST} runs, peak memory", f"< {MAX_MEMORY / 1024.0:g} GiB"
    largest = next((row for row in rows if row.kind == "scaling" and row.nodes == LARGEST), None)
    if largest is None or largest.failure:
        reason, met = ("not measured", None) if largest is None else (largest.failure, False)
        yield Target(name, asked, reason, met)
    else:
        peak = peak_memory(largest)
        text = f"{peak / 1024.0:.2f} GiB; {1.0 / largest.cpu:.2g} x real time at {largest.value:.0e} m"
        yield Target(name, asked, text, peak < MAX_MEMORY)
    name = f"cost of `arc_material` as nodes to the power, {SMALLEST} to {LARGEST} a side"
    asked = f"<= {MAX_EXPONENT:g}"
    made = [row for row in measured_sizes(rows) if SMALLEST <= row.nodes <= LARGEST]
    if len(made) < 2:
        yield Target(name, asked, "not measured", None)
        return
    fitted, ends = exponents(made)
    text, met = f"{fitted:.2f} (least squares), {ends:.2f} (end to end)", max(fitted, ends) <= MAX_EXPONENT
    smallest, largest_measured = made[0].nodes, made[-1].nodes
    if (smallest, largest_measured) == (SMALLEST, LARGEST):
        yield Target(name, asked, text, met)
    else:
        yield Target(name, asked, f"{text}, only {smallest} to {largest_measured} a side measured", None)


def _commands(rows: Sequence[Row]) -> Iterator[Target]:
    costs = rate_costs(rows)
    if not costs:
        yield Target("commands at 100 Hz", ">= 0.5 of the smooth case", "not measured", None)
    for (scene, rate), cost in costs.items():
        if rate not in COMMAND_RATES:
            continue
        lowest, row = COMMAND_RATES[rate], cost.row
        others = [(NAMES[method], other) for method, other in cost.others.items() if method in NAMES]
        name = f"`{scene}`, commands at {rate:g} Hz, {ACCURACY:.0e} m"
        yield Target(
            name,
            "-" if lowest is None else f">= {lowest:g} of the smooth case",
            f"{cost.speed:.2f} of smooth ({1.0 / row.cpu:.3g} x real time, error {row.error:.1e} m)",
            None if lowest is None else cost.speed >= lowest and row.error <= ACCURACY,
            "; ".join(
                f"{label}: {other.failure or f'{other.cpu / row.cpu:.2g} times ours'}"
                for label, other in others
            ),
        )
        rival = cost.others.get(BASELINE)
        if rival is not None and not rival.failure:
            ratio = rival.cpu / row.cpu
            yield Target(
                f"{name}, against {NAMES[BASELINE]}",
                f">= {COMMANDED_RIVAL:g} times as fast",
                f"{ratio:.2f} times",
                ratio >= COMMANDED_RIVAL,
            )


def _pairs(rows: Sequence[Row]) -> Iterator[Target]:
    made = {(cost.row.scene, cost.row.setting, cost.row.value): cost for cost in paired_costs(rows)}
    for (scene, kind, rate), lowest in ASKED.items():
        what = "own commands" if rate == SHIPPED else f"{kind} commands at {rate:g} Hz"
        name, asked = f"`{scene}`, {what}, beside another checkout", f">= {lowest:g} times as fast"
        cost = made.get((scene, kind, rate))
        if cost is None:
            yield Target(name, asked, "not measured", None)
            continue
        text = f"{cost.times:.2f} times ({1.0 / cost.row.cpu:.3g} x real time, error {cost.row.error:.1e} m)"
        yield Target(name, asked, text, cost.times >= lowest and cost.row.error <= ACCURACY)


def _accuracy(rows: Sequence[Row]) -> Iterator[Target]:
    name, asked = "real error within the asked one", f">= {100 * MIN_FRACTION:.0f} % of pairs"
    name_of_worst, asked_of_worst = "largest real error over the asked one", f"<= {MAX_FACTOR:g}"
    found = accuracy_summary(rows)
    if not found.pairs:
        yield Target(name, asked, "not measured", None)
        yield Target(name_of_worst, asked_of_worst, "not measured", None)
        return
    text = f"{100 * found.within:.0f} % of {found.pairs} pairs of a shipped scene and an accuracy"
    yield Target(name, asked, text, found.within >= MIN_FRACTION)
    yield Target(name_of_worst, asked_of_worst, f"{found.worst:.2f}", found.worst <= MAX_FACTOR)
