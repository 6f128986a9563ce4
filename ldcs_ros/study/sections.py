"""The report's sections on targets, large lattices, command rates, measured orders and the method that is not there."""

from __future__ import annotations

from collections.abc import Sequence

from ldcs_ros.integrators import INTEGRATORS, integrator_class
from ldcs_ros.study.command_rates import ACCURACY, SMOOTH, against_smooth
from ldcs_ros.study.drive_profiles import PERIOD
from ldcs_ros.study.growth import exponents, measured, peak_memory
from ldcs_ros.study.markdown import table
from ldcs_ros.study.orders import WHOLE, mean_order, orders
from ldcs_ros.study.problems import ERROR_TIMES
from ldcs_ros.study.stabilised import INTERVAL, MOST_STAGES, figures
from ldcs_ros.study.targets import NAMES, targets
from ldcs_ros.study.tasks import Row

NOT_MEASURED = ["Not measured by this preset."]


def target_table(rows: Sequence[Row]) -> list[str]:
    """Return the table of targets."""
    lines = [
        (
            target.name,
            target.asked,
            target.reached,
            f"**{target.verdict}**" if target.kept is False else target.verdict,
        )
        + (target.beside or "-",)
        for target in targets(rows)
    ]
    head = ("target", "asked", "reached", "verdict", "others, CPU time in the same run")
    return ["`ldcs study --targets` measures these alone. CPU time of one thread.", table(head, lines)]


def large_lattices(rows: Sequence[Row]) -> list[str]:
    """Return how cost and memory grow with the lattice."""
    made = measured([*rows])
    lost = [row for row in rows if row.kind == "growth" and row.failure]
    if not made:
        return NOT_MEASURED
    lines = []
    for before, row in zip([None, *made], made, strict=False):
        growth = "-" if before is None else f"{exponents([before, row])[1]:.2f}"
        seconds = f"{row.cpu:.3g}"
        counts = str(row.steps), str(row.evaluations), str(row.factorisations)
        lines.append((f"{row.nodes} x {row.nodes}", seconds, growth, *counts, f"{peak_memory(row):.0f}"))
    fitted, ends = exponents(made)
    first = made[0]
    text = (
        f"Scene `{first.scene}`, whose material stays the same, at {first.value:.0e} m in time, all of its "
        f"{ERROR_TIMES[-1]:g} s. Each size "
        f"in a process of its own, peak memory with Python and all libraries. Over all sizes the cost grows as nodes "
        f"to the power {fitted:.2f} (least squares), {ends:.2f} from end to end."
    )
    if first.scene == "arc_material":
        text += (
            " `arc` itself, whose springs stay at 80 N/m whatever their length, has no one answer at 129 x 129: its "
            "0.39 N on one node pull that node past its neighbours 1.1 mm away, the sheet crumples there after 1 s, "
            "and rounding decides to which side (by 2 mm; runs at 1e-4 and 2e-5 m agree to 2e-5 m until then). So "
            "the largest lattice is studied with a material."
        )
    head = ("nodes", "CPU s per simulated second", "nodes to the power", "steps", "evaluations", "factorings")
    return [
        text,
        table((*head, "peak MiB"), lines),
        *(f"{row.nodes} x {row.nodes}: {row.failure}." for row in lost),
    ]


def command_rates(rows: Sequence[Row]) -> list[str]:
    """Return what command rates cost beside a course that is followed without steps."""
    shares = against_smooth([*rows])
    if not shares:
        return NOT_MEASURED
    text = (
        f"A smooth course, (1 - cos(2 pi t / {PERIOD:g} s)) / 2 of the scene's full drive, is sampled at the rate and "
        f"sent as steps, as a rig's controller does: pressures on `rig`, torques on `paper`, a vertical force on the "
        f"loaded node of `arc` (`arc_pushed`). Smooth: the drive follows the course itself. One period at "
        f"`accuracy: {ACCURACY:g}`; the error is against the same commands at a hundredth of it, 50 times a simulated "
        f"second."
    )
    lines = []
    for scene, by_rate in shares.items():
        for rate, (share, row) in by_rate.items():
            others = {r.method: r for r in rows if r.kind == "rate" and (r.scene, r.value) == (scene, rate)}
            lines.append(
                (
                    f"`{scene}`",
                    "smooth" if rate == SMOOTH else f"{rate:g} Hz",
                    f"{1e3 * row.cpu:.3g}",
                    f"{share:.2f}",
                    f"{row.error:.1e} m",
                    f"{row.steps / PERIOD:.0f}",
                    f"{row.factorisations / PERIOD:.0f}",
                    *(_other(others.get(name)) for name in NAMES),
                )
            )
    head = (
        "problem",
        "commands",
        "CPU ms per simulated second",
        "speed of smooth",
        "error",
        "steps a second",
    )
    return [
        text,
        table((*head, "factorings a second", *(f"{label} [ms]" for label in NAMES.values())), lines),
    ]


def _other(row: Row | None) -> str:
    if row is None:
        return "-"
    return row.failure.removesuffix(" s") if row.failure else f"{1e3 * row.cpu:.3g}"


def measured_orders(rows: Sequence[Row]) -> list[str]:
    """Return the orders that fixed steps show, and why one drops."""
    found = orders(rows)
    if not found:
        return NOT_MEASURED
    lines, drops = [], []
    for name in [name for name in INTEGRATORS if name in found]:
        printed, pairs = integrator_class(name).order, found[name]
        mean = mean_order(pairs)
        drop = mean < WHOLE * printed
        if drop:
            drops.append(f"`{name}` ({mean:.1f} instead of {printed})")
        steps = ", ".join(f"{order:.1f} ({long:g} to {short:g} s)" for long, short, order in pairs)
        lines.append((f"`{name}`", str(printed), f"**{mean:.1f}**" if drop else f"{mean:.1f}", steps))
    text = "From the errors at fixed steps on `arc` 9 x 9."
    if drops:
        text += f" Below their order for non-stiff problems: {', '.join(drops)}."
    if any(drop.startswith("`rosenbrock_w`") for drop in drops):
        text += (
            " A Rosenbrock method reaches its order where h times the fastest rate is small; here it is some "
            "hundreds. On such problems its stages are of first order only, and with driven edges, whose course "
            "enters the stages at their own times, the order falls to between 2 and 2.5 (Lubich and Ostermann, "
            "Linearly implicit time discretization of non-linear parabolic equations, IMA J. Numer. Anal. 15, "
            "1995, show the same for parabolic equations). That, not the cost of a step, is why it loses to the "
            "ESDIRK methods below 1e-4 m."
        )
    return [text, table(("method", "order", "measured", "between steps"), lines)]


def fourth_order_bound(rows: Sequence[Row]) -> list[str]:
    """Return what ROCK4 would cost at best, and where it would win."""
    made = [row for row in rows if row.kind == "bound" and not row.failure]
    if not made:
        return NOT_MEASURED
    lines, ratios = [], {}
    for row in made:
        own, one = figures(row)
        ratio = row.cpu / own
        ratios[row.scene, row.nodes, row.value] = ratio
        longer = f"{ratio**2:.1f}" if ratio > 1.0 else "-"
        counts = (
            str(row.steps),
            f"{1e3 * own:.3g}",
            str(row.evaluations),
            f"{one:.3g}",
            f"{1e3 * row.cpu:.3g}",
        )
        lines.append(
            (
                f"`{row.scene}` {row.nodes} x {row.nodes}",
                f"{row.value:.0e} m",
                *counts,
                f"{ratio:.2g}",
                longer,
            )
        )
    won = [key for key, ratio in ratios.items() if ratio < 1.0]
    lost = [ratio for ratio in ratios.values() if ratio >= 1.0]
    text = (
        f"ROCK4 is not among the methods. It needs s stages where h rho = {INTERVAL:g} s^2 (rho: the fastest rate of "
        f"the scene), {MOST_STAGES} at most; longer steps are divided. Below it is granted the steps of `esdirk43`, "
        f"which is of the same order, no rejected step, and no work but its stages in a compiled loop (the "
        f"baseline's where springs do all the work, else the model's own force). The cost grows with the root of a "
        f"step, so it would tie only with steps longer by the square of the ratio."
    )
    if lost:
        text += f" It loses in {len(lost)} of {len(made)} cases, by {min(lost):.2g} to {max(lost):.2g} times."
    if won:
        scenes = ", ".join(f"`{scene}` {nodes} x {nodes} at {error:.0e} m" for scene, nodes, error in won)
        gain = 1.0 / min(ratios[key] for key in won)
        text += (
            f" Cheaper at best, by at most {gain:.2g} times: {scenes}; there steps are short because the motion is "
            f"fast, not because it is stiff."
        )
    else:
        text += " It would win nowhere."
    called = [
        r
        for r in rows
        if (r.kind, r.scene, r.nodes, r.method) == ("curve", "arc", 9, "rkc2") and r.evaluations
    ]
    if called:
        stage = min(r.cpu * ERROR_TIMES[-1] / r.evaluations for r in called)
        text += (
            f" Called from Python, as `rkc2` is, a stage takes {1e6 * stage:.0f} us on `arc` 9 x 9 instead."
        )
    head = ("problem", "accuracy", "steps", "`esdirk43` [ms]", "stages", "stage [us]", "ROCK4 [ms]", "ratio")
    return [text, table((*head, "steps longer to tie"), lines)]
