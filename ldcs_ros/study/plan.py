"""What a study measures: the quick preset and the full one, as lists of tasks."""

from __future__ import annotations

from collections.abc import Iterable

from ldcs_ros.scene import shipped_scenes
from ldcs_ros.study.tasks import BASELINE, Task

IMPLICIT = ("esdirk43", "trbdf2", "rosenbrock_w", "linearly_implicit_euler")
ADAPTIVE = (*IMPLICIT, "rkc2")
# Steps of the compiled baseline: whole fractions of 0.5 s.
BASELINE_STEPS = (0.1, 0.05, 0.02, 0.01, 0.005)


def quick() -> list[Task]:
    """Return the preset that ends within two minutes: 9 x 9 in full, one accuracy sweep at 17 x 17 and 33 x
    33."""
    return [
        *_sweep("arc", 9, ("esdirk43", "trbdf2"), (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)),
        *_sweep("arc", 9, ("rkc2",), (1e-3, 1e-4, 1e-5, 1e-6), runs=2),
        *_sweep("arc", 9, ("rosenbrock_w",), (1e-3, 1e-4, 1e-5, 1e-6), runs=2),
        *_sweep("arc", 9, ("linearly_implicit_euler",), (1e-3, 1e-4), runs=1),
        *_fixed("arc", 9, {"rk4": (3.5e-5,), "semi_implicit_euler": (2.5e-5,)}, runs=1),
        *_fixed("arc", 9, {"rk4": (1e-4,), "esdirk43": (0.02, 0.005), "trbdf2": (0.005, 0.002)}, runs=1),
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
        *_promises(),
        Task("check", "arc", 9, "radau", "accuracy", 1e-7, 1),
        Task("effect", "rig", 9, "esdirk43", "leave out", 0.0),
        *_spatial((5, 9, 17, 33)),
    ]


def full() -> list[Task]:
    """Return the preset for an hour or a cluster: all methods, fixed and adaptive steps, 9 x 9 to 129 x 129."""
    fine = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
    steps = {
        **{name: (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001) for name in ADAPTIVE},
        "rk4": (3.8e-5, 1.9e-5),
        "semi_implicit_euler": (2.7e-5, 1.35e-5),
    }
    tasks: list[Task] = []
    for scene in ("arc", "paper", "rig", "hanging_sheet"):
        for nodes in (9, 17):
            tasks += _sweep(scene, nodes, ADAPTIVE, fine)
            tasks += _sweep(scene, nodes, ("rk4", "semi_implicit_euler"), (1e-4, 1e-5), runs=1, budget=300.0)
    tasks += _fixed("arc", 9, steps)
    tasks += _sweep("arc_axiswise", 9, ("exponential", *ADAPTIVE), fine)
    tasks += _sweep("arc_axiswise", 17, ("exponential", *ADAPTIVE), fine)
    for nodes in (9, 17, 33):
        tasks += _sweep("arc", nodes, ("scipy_BDF",), (1e-3, 1e-4, 1e-5, 1e-6), runs=1)
        tasks += _baseline(nodes)
    tasks += _sweep("arc", 9, ("scipy_Radau",), (1e-3, 1e-4, 1e-5, 1e-6), runs=1)
    for nodes in (33, 65):
        tasks += _sweep(
            "arc", nodes, ("esdirk43", "trbdf2", "rkc2"), (1e-3, 1e-4, 2e-5, 1e-6), runs=1, budget=600.0
        )
    tasks += _baseline(65, (0.05, 0.02))
    tasks += _sweep("arc", 33, ("rosenbrock_w", "rk4", "semi_implicit_euler"), (1e-4,), runs=1, budget=600.0)
    tasks += _promises()
    tasks += [Task("check", scene, 9, "radau", "accuracy", 1e-7, 1, 3600.0) for scene in ("arc", "paper")]
    tasks += [Task("effect", scene, 9, "esdirk43", "leave out", 0.0) for scene in ("rig", "paper", "arc")]
    return tasks + _spatial((5, 9, 17, 33, 65, 129))


def _sweep(
    scene: str,
    nodes: int,
    methods: Iterable[str],
    accuracies: Iterable[float],
    *,
    runs: int = 3,
    budget: float = 30.0,
) -> list[Task]:
    values = tuple(accuracies)
    return [
        Task("curve", scene, nodes, name, "accuracy", a, runs, budget) for name in methods for a in values
    ]


def _fixed(scene: str, nodes: int, steps: dict[str, tuple[float, ...]], *, runs: int = 3) -> list[Task]:
    return [Task("curve", scene, nodes, name, "dt", h, runs) for name, many in steps.items() for h in many]


def _baseline(nodes: int, steps: tuple[float, ...] = BASELINE_STEPS) -> list[Task]:
    return [Task("curve", "arc", nodes, BASELINE, "dt", h) for h in steps]


def _promises() -> list[Task]:
    return [Task("promise", name, 0, "auto", "accuracy", 0.0) for name in shipped_scenes()]


def _spatial(sizes: tuple[int, ...]) -> list[Task]:
    return [Task("spatial", "arc_material", nodes, "esdirk43", "accuracy", 1e-6) for nodes in sizes]


PRESETS = {"quick": quick, "full": full}
