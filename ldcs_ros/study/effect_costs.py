"""What each effect costs: a force evaluation, a Jacobian and a step, with all effects and with one left out."""

from __future__ import annotations

from typing import Any

from ldcs_ros.errors import DivergenceError
from ldcs_ros.scene import load_scene
from ldcs_ros.study.problems import content_of
from ldcs_ros.study.tasks import Row, Task
from ldcs_ros.study.timing import best_of
from ldcs_ros.threads import one_thread

# Beside the shipped scene's effects: those that work with any of them.
ADDED = (
    {"type": "drag"},
    {"type": "floor", "height": -0.2},
    {"type": "force", "at": "P1", "value": [0, 0, -0.01]},
)
CALLS, ROUNDS = 200, 7
ACCURACY = 1e-5  # m
SETTLING, SPAN = 0.02, 0.3  # s: past the jumps at the start, and how long steps are timed


def effect_costs(task: Task) -> list[Row]:
    """Return a row for all effects ('none' left out) and one for each that was left out; times in `extra` "
    "[us]."""
    content = content_of(task.scene, task.nodes)
    named = {effect["type"] for effect in content["effects"]}
    content["effects"] += [effect for effect in ADDED if effect["type"] not in named]
    names = [effect["type"] for effect in content["effects"]]
    return [_measure(task, content, left_out) for left_out in ("none", *dict.fromkeys(names))]


def _measure(task: Task, content: dict[str, Any], left_out: str) -> Row:
    kept = [effect for effect in content["effects"] if effect["type"] != left_out]
    inputs = [] if left_out == "arms" else content.get("inputs", [])
    scene = load_scene({**content, "effects": kept, "inputs": inputs, "solver": {"accuracy": ACCURACY}})
    simulation = scene.build()
    named: dict[str, Any] = {
        "kind": "effect", "scene": task.scene, "nodes": scene.lattice.nodes[0],
        "method": simulation.integrator.name, "setting": left_out, "value": ACCURACY,
    }  # fmt: skip
    try:
        simulation.advance_to(SETTLING)
        force, jacobian = _evaluations(simulation)
        cpu, steps = _steps(simulation)
    except DivergenceError as error:
        return Row(**named, failure=str(error))
    texts = (f"force {1e6 * force:.2f}", f"jacobian {1e6 * jacobian:.1f}", f"step {1e6 * cpu / steps:.0f}")
    return Row(**named, cpu=cpu / SPAN, steps=steps, extra=" ".join(texts))


def _evaluations(simulation: Any) -> tuple[float, float]:
    """Return the CPU time of a force evaluation and of a Jacobian [s]."""
    model, motion = simulation.model, simulation._motion()
    where = (motion.time, motion.q, motion.u, simulation.inputs.held())

    def force() -> None:
        for _ in range(CALLS):
            model.force(*where)

    def jacobian() -> None:
        for _ in range(CALLS // 10):
            model.jacobian(*where, definite=False)

    with one_thread():
        return best_of(ROUNDS, force)[0] / CALLS, best_of(ROUNDS, jacobian)[0] / (CALLS // 10)


def _steps(simulation: Any) -> tuple[float, int]:
    """Return the CPU time of SPAN seconds [s] and the number of steps, from the simulation's present state."""
    start = simulation.state

    def run() -> int:
        simulation.reset(start)
        before = simulation.integrator.counters.steps
        simulation.advance_to(SETTLING + SPAN)
        return int(simulation.integrator.counters.steps - before)

    cpu, steps = best_of(5, run)
    return cpu, max(steps, 1)
