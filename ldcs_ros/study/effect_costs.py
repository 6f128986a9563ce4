"""What each effect costs: a force evaluation, a Jacobian and a step, with all effects and with one left out."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from ldcs_ros.errors import DivergenceError
from ldcs_ros.scene import load_scene
from ldcs_ros.scene.scene import Scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread
from ldcs_ros.study.problems import content_of
from ldcs_ros.study.tasks import Row, Task
from ldcs_ros.study.timing import best_of

# Beside the shipped scene's effects: those that work with any of them.
ADDED = (
    {"type": "drag"},
    {"type": "floor", "height": -0.2},
    {"type": "force", "at": "P1", "value": [0, 0, -0.01]},
)
CALLS, ROUNDS = 100, 15
ACCURACY = 1e-5  # m
SETTLING, SPAN = 0.02, 0.3  # s: past the jumps at the start, and how long steps are timed


def effect_costs(task: Task) -> list[Row]:
    """Return a row for all effects ('none' left out) and one for each left out; times in `extra` [us]."""
    content = content_of(task.scene, task.nodes)
    named = {effect["type"] for effect in content["effects"]}
    content["effects"] += [effect for effect in ADDED if effect["type"] not in named]
    simulations: dict[str, Simulation] = {}
    rows = []
    for left_out in ("none", *dict.fromkeys(effect["type"] for effect in content["effects"])):
        scene = _without(content, left_out)
        simulation = scene.build()
        try:
            simulation.advance_to(SETTLING)
            simulations[left_out] = simulation
        except DivergenceError as error:
            rows.append(_row(task, simulation, left_out, failure=str(error)))
    costs = _evaluations(simulations)
    for left_out, simulation in simulations.items():
        force, jacobian = costs[left_out]
        texts = [f"force {1e6 * force:.2f}", f"jacobian {1e6 * jacobian:.1f}"]
        values: dict[str, Any] = {}
        if left_out == "none":
            values, per_step = _steps(simulation)
            texts.append(f"step {per_step:.0f}")
        rows.append(_row(task, simulation, left_out, extra=" ".join(texts), **values))
    return rows


def _without(content: dict[str, Any], left_out: str) -> Scene:
    kept = [effect for effect in content["effects"] if effect["type"] != left_out]
    inputs = [] if left_out == "arms" else content.get("inputs", [])
    return load_scene({**content, "effects": kept, "inputs": inputs, "solver": {"accuracy": ACCURACY}})


def _row(task: Task, simulation: Simulation, left_out: str, **values: Any) -> Row:
    nodes, method = simulation.lattice.nodes[0], simulation.integrator.name
    return Row("effect", task.scene, nodes, method, left_out, ACCURACY, **values)


def _evaluations(simulations: dict[str, Simulation]) -> dict[str, tuple[float, float]]:
    """Return the CPU time of a force evaluation and of a Jacobian [s], measured in turns."""
    best = {name: (float("inf"), float("inf")) for name in simulations}
    with one_thread():
        for _ in range(ROUNDS):
            for name, simulation in simulations.items():
                model, motion = simulation.model, simulation.motion()
                where = (motion.time, motion.q, motion.u, simulation.inputs.held())
                began = time.thread_time()
                for _ in range(CALLS):
                    model.force(*where)
                middle = time.thread_time()
                for _ in range(CALLS // 10):
                    model.jacobian(*where, definite=False)
                taken = (middle - began) / CALLS, (time.thread_time() - middle) / (CALLS // 10)
                best[name] = min(best[name][0], taken[0]), min(best[name][1], taken[1])
    return best


def _steps(simulation: Simulation) -> tuple[dict[str, Any], float]:
    """Return what SPAN seconds from the present state cost, as values of a row, and the CPU time of a step [us]."""
    start = simulation.state

    def run() -> dict[str, int]:
        simulation.reset(start)
        before = replace(simulation.integrator.counters)
        simulation.advance_to(SETTLING + SPAN)
        after = simulation.integrator.counters
        return {
            name: getattr(after, name) - getattr(before, name)
            for name in ("steps", "evaluations", "factorisations")
        }

    cpu, counts = best_of(5, run)
    return {"cpu": cpu / SPAN, **counts}, 1e6 * cpu / max(counts["steps"], 1)
