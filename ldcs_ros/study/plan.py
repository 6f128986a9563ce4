"""The presets quick, targets and full of a study, as lists of tasks."""

from __future__ import annotations

from collections.abc import Iterable

from ldcs_ros.scene import shipped_scenes
from ldcs_ros.study.command_rates import SMOOTH
from ldcs_ros.study.drive_profiles import DRIVEN
from ldcs_ros.study.paired_runs import ASKED
from ldcs_ros.study.rows import BASELINE, Key, Task
from ldcs_ros.study.verified_runs import ACCURACY, SCENES

IMPLICIT = ("esdirk43", "trbdf2", "rosenbrock_w", "linearly_implicit_euler")
ADAPTIVE = (*IMPLICIT, "rkc2")
# Steps of the compiled baseline: whole fractions of 0.5 s.
BASELINE_STEPS = (0.1, 0.05, 0.02, 0.01, 0.005)
# Steps at which the methods show their order on the stiff sheet.
ORDER_STEPS = {
    "esdirk43": (0.2, 0.1, 0.05, 0.02),
    "bdf2": (0.005, 0.0025, 0.001),
    "trbdf2": (0.02, 0.01, 0.005),
    "rosenbrock_w": (0.01, 0.005, 0.0025),
    "linearly_implicit_euler": (0.02, 0.01),
    "rkc2": (0.02, 0.01, 0.005),
}


LEARNING = Task("learning", "rig", 9, "all", "steps", 240.0, weight=5.0)


def quick() -> list[Task]:
    """Return the preset of two minutes: 9 x 9 in full, less of 17 x 17 and 33 x 33, without SciPy there."""
    return [
        *_sweep("arc", 9, ("esdirk43", "trbdf2"), (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)),
        *_sweep("arc", 9, ("rkc2",), (1e-3, 1e-4, 1e-5, 1e-6), runs=2),
        *_sweep("arc", 9, ("rosenbrock_w",), (1e-3, 1e-4, 1e-5, 1e-6), runs=2),
        *_sweep("arc", 9, ("linearly_implicit_euler",), (1e-3, 1e-4), runs=1),
        *_fixed("arc", 9, {"rk4": (3.5e-5,), "semi_implicit_euler": (2.5e-5,)}, runs=1, weight=5.0),
        *_fixed("arc", 9, {"rk4": (1e-4,), **ORDER_STEPS}, runs=1, weight=0.2),
        *_baseline(9),
        *_sweep("arc", 9, ("scipy_BDF",), (1e-3, 1e-4, 1e-5, 1e-6), runs=2),
        *_sweep("arc", 9, ("scipy_Radau",), (1e-3, 1e-4), runs=1),
        *_sweep("paper", 9, ("esdirk43", "trbdf2"), (1e-3, 1e-4, 1e-5, 1e-6)),
        *_sweep("paper", 9, ("rosenbrock_w",), (1e-3, 1e-4, 1e-5), runs=1),
        *_sweep("paper", 9, ("rkc2", "rk4", "semi_implicit_euler"), (1e-4,), runs=1, budget=6.0),
        *_sweep("paper", 9, ("scipy_BDF",), (1e-4, 1e-6), runs=1),
        *_sweep(
            "arc_axiswise", 9, ("exponential", "esdirk43", "trbdf2", "rkc2"), (1e-3, 1e-4, 1e-5, 1e-6), runs=2
        ),
        *_sweep("arc", 17, ("esdirk43", "trbdf2", "rkc2"), (1e-3, 1e-4, 1e-5), runs=2),
        *_baseline(17, (0.02, 0.01)),
        *_sweep("arc", 33, ("esdirk43", "trbdf2"), (1e-3, 1e-4, 2e-5), runs=2),
        *_baseline(33, (0.05, 0.02)),
        *_accuracy_checks(),
        Task("check", "arc", 9, "radau", "accuracy", 1e-7, 1),
        *_verified(("arc", "paper")),
        Task("effect", "rig", 9, "esdirk43", "leave out", 0.0, weight=4.0),
        *_spatial((5, 9, 17, 33)),
        *_scaling((17, 33)),
        *_rates((SMOOTH, 100.0), ("arc_pushed",)),
        LEARNING,
    ]


def targets() -> list[Task]:
    """Return the tasks of the table of targets, our method and the others in one process: some minutes."""
    return [
        *_sweep("arc", 9, ("esdirk43", "trbdf2"), (1e-4, 1e-5, 1e-6)),
        *_baseline(9),
        *_sweep("arc", 9, ("scipy_BDF",), (1e-5, 1e-6, 1e-7), runs=2),
        *_sweep("paper", 9, ("esdirk43", "trbdf2"), (1e-4, 1e-5, 1e-6)),
        *_sweep("paper", 9, ("scipy_BDF",), (1e-5, 1e-6, 1e-7), runs=1),
        *_sweep("arc", 33, ("esdirk43",), (1e-4, 2e-5), runs=3),
        *_sweep("arc", 17, ("esdirk43",), (1e-4, 1e-5), runs=3),
        *_baseline(17),
        *_sweep("arc", 33, ("esdirk43",), (1e-5,), runs=3),
        *_baseline(33, (0.02, 0.01, 0.005), weight=4.0),
        *_sweep("arc", 33, ("scipy_BDF",), (1e-5,), runs=1, budget=20.0, weight=20.0),
        *_sweep("arc", 65, ("esdirk43",), (1e-4, 2e-5), runs=1, budget=300.0, weight=8.0),
        *_baseline(65, (0.02, 0.01), weight=35.0, budget=120.0),
        *_scaling((17, 33, 65, 129)),
        *_rates((SMOOTH, 100.0, 1000.0)),
        *_accuracy_checks(),
        *_verified(SCENES),
    ]


def paired(checkout: str) -> list[Task]:
    """Return the runs beside another checkout of this project, by its folder."""
    return [
        Task("paired", scene, 9, "auto", kind, rate, 2, weight=15.0, checkout=checkout)
        for scene, kind, rate in ASKED
    ]


def full() -> list[Task]:
    """Return the preset for half an hour on two cores: targets, all methods, both step controls, 9 x 9 to 129 x 129."""
    fine = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
    tasks = targets()
    for scene in ("arc", "paper", "rig", "hanging_sheet"):
        tasks += _sweep(scene, 9, ("esdirk43", "trbdf2"), fine, weight=0.5)
        tasks += _sweep(scene, 9, ("rosenbrock_w", "rkc2"), fine[:4], runs=2, budget=10.0)
        tasks += _sweep(scene, 9, ("linearly_implicit_euler",), fine[:2], runs=1, budget=5.0)
        tasks += _sweep(scene, 9, ("rk4",), (1e-4,), runs=1, budget=15.0, weight=5.0)
    for scene in ("arc", "paper", "rig"):
        tasks += _sweep(scene, 9, ("semi_implicit_euler",), (1e-4,), runs=1, budget=15.0, weight=5.0)
    for scene in ("arc", "paper"):
        tasks += _sweep(scene, 17, ("esdirk43", "trbdf2"), fine[:4], runs=2)
        tasks += _sweep(scene, 17, ("rosenbrock_w", "rkc2"), fine[:3], runs=1, budget=20.0, weight=2.0)
    tasks += _sweep("arc", 17, ("semi_implicit_euler",), (1e-4,), runs=1, weight=10.0)
    tasks += _fixed("arc", 9, {name: (0.1, 0.05, 0.02, 0.01, 0.005) for name in ADAPTIVE}, runs=1)
    tasks += _fixed(
        "arc", 9, {**ORDER_STEPS, "rk4": (1e-4, 3.5e-5), "semi_implicit_euler": (2.5e-5,)}, runs=1
    )
    for nodes in (9, 17):
        tasks += _sweep(
            "arc_axiswise", nodes, ("exponential", "esdirk43", "trbdf2"), fine, runs=2, weight=0.5
        )
        tasks += _sweep("arc_axiswise", nodes, ("rosenbrock_w", "rkc2"), fine[:3], runs=1)
        tasks += _sweep("arc", nodes, ("scipy_BDF",), fine[:4], runs=1, weight=nodes / 2)
    tasks += _sweep("arc", 9, ("scipy_Radau",), fine[:3], runs=1)
    tasks += _baseline(17)
    tasks += _baseline(33, (0.05,), weight=3.0)
    tasks += _sweep("arc", 33, ("esdirk43", "trbdf2"), (*fine[:3], 2e-5, 1e-6), runs=1)
    tasks += _sweep("arc", 33, ("rosenbrock_w", "rkc2"), (1e-4,), runs=1, budget=20.0, weight=6.0)
    tasks += _sweep("arc", 65, ("esdirk43", "trbdf2"), (1e-3, 1e-5), runs=1, budget=200.0, weight=8.0)
    # Not `arc`: its point load crumples such a fine lattice of its springs, and rounding decides the direction.
    tasks += _sweep("arc_material", 129, ("esdirk43",), (1e-3, 1e-4, 2e-5), runs=1, budget=400.0, weight=30.0)
    tasks += [Task("check", scene, 9, "radau", "accuracy", 1e-7, 1, weight=8.0) for scene in ("arc", "paper")]
    tasks += [
        Task("effect", scene, 9, "esdirk43", "leave out", 0.0, weight=4.0) for scene in ("rig", "paper")
    ]
    tasks += _spatial((5, 9, 17, 33, 65))
    tasks += [*_rates((10.0, 50.0, 200.0)), LEARNING]
    # A task that the targets contain, too, is measured once, in the targets' order.
    once: dict[Key, Task] = {}
    for task in tasks:
        once.setdefault(task.key, task)
    return list(once.values())


def _sweep(
    scene: str,
    nodes: int,
    methods: Iterable[str],
    accuracies: Iterable[float],
    *,
    runs: int = 3,
    budget: float = 30.0,
    weight: float = 1.0,
) -> list[Task]:
    values = tuple(accuracies)
    return [
        Task("curve", scene, nodes, name, "accuracy", a, runs, budget, weight)
        for name in methods
        for a in values
    ]


def _fixed(
    scene: str, nodes: int, steps: dict[str, tuple[float, ...]], *, runs: int = 3, weight: float = 0.5
) -> list[Task]:
    made = [(name, h) for name, many in steps.items() for h in many]
    return [Task("curve", scene, nodes, name, "dt", h, runs, weight=weight) for name, h in made]


def _baseline(
    nodes: int, steps: tuple[float, ...] = BASELINE_STEPS, *, weight: float = 0.5, budget: float = 30.0
) -> list[Task]:
    return [Task("curve", "arc", nodes, BASELINE, "dt", h, 3, budget, weight) for h in steps]


def _accuracy_checks() -> list[Task]:
    return [Task("accuracy", name, 0, "auto", "accuracy", 0.0, weight=3.0) for name in shipped_scenes()]


def _verified(scenes: Iterable[str]) -> list[Task]:
    return [Task("verified", name, 0, "auto", "accuracy", ACCURACY) for name in scenes]


def _spatial(sizes: tuple[int, ...]) -> list[Task]:
    # The error in time is small against the lattice's own, some 1e-4 m.
    return [
        Task("spatial", "arc_material", n, "esdirk43", "accuracy", 1e-6, weight=n * n / 300) for n in sizes
    ]


def _scaling(sizes: tuple[int, ...]) -> list[Task]:
    return [
        Task("scaling", "arc_material", n, "esdirk43", "accuracy", 1e-5, weight=2 + n * n / 300)
        for n in sizes
    ]


def _rates(rates: Iterable[float], scenes: Iterable[str] = tuple(DRIVEN)) -> list[Task]:
    return [Task("rate", scene, 9, "all", "rate", rate, weight=12.0) for rate in rates for scene in scenes]


PRESETS = {"quick": quick, "targets": targets, "full": full}
