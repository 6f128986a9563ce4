"""Cost of each effect: a force evaluation and a Jacobian, with all effects and with one left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ldcs_ros.errors import DivergenceError
from ldcs_ros.scene import load_scene
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.problems import content_of
from ldcs_ros.study.rows import Row, Task
from ldcs_ros.study.timing import best_of, in_turns

ADDED = (
    {"type": "drag"},
    {"type": "floor", "height": -0.2},
    {"type": "force", "at": "P1", "value": [0, 0, -0.01]},
)
CALLS, ROUNDS = 100, 15
ACCURACY = 1e-5  # m
SETTLING, SPAN = 0.02, 0.3  # s: past the jumps at the start, and duration of the timed steps


def effect_costs(task: Task) -> list[Row]:
    """Return a row for all effects ('none' left out) and one for each left out; times in `extra` [us]."""
    content = content_of(task.scene, task.nodes)
    names = {effect["type"] for effect in content["effects"]}
    content["effects"] += [effect for effect in ADDED if effect["type"] not in names]
    content["solver"] = {"accuracy": ACCURACY}
    simulations: dict[str, Simulation] = {}
    rows: dict[str, Row] = {}
    for left_out in ("none", *dict.fromkeys(effect["type"] for effect in content["effects"])):
        kept = [effect for effect in content["effects"] if effect["type"] != left_out]
        inputs = [] if left_out == "arms" else content.get("inputs", [])
        simulation = load_scene({**content, "effects": kept, "inputs": inputs}).build()
        row = replace(task.row(), method=simulation.integrator.name, setting=left_out, value=ACCURACY)
        try:
            simulation.advance_to(SETTLING)
            simulations[left_out], rows[left_out] = simulation, row
        except DivergenceError as error:
            rows[left_out] = replace(row, failure=str(error))
    forces = in_turns(*map(_force, simulations.values()), rounds=ROUNDS, calls=CALLS)
    jacobians = in_turns(*map(_jacobian, simulations.values()), rounds=ROUNDS, calls=CALLS // 10)
    for left_out, force, jacobian in zip(simulations, forces, jacobians, strict=True):
        extra = f"force {1e6 * force:.2f} jacobian {1e6 * jacobian:.1f}"
        rows[left_out] = replace(rows[left_out], extra=extra)
    if "none" in simulations:
        rows["none"] = _with_steps(rows["none"], simulations["none"])
    return list(rows.values())


def _force(simulation: Simulation) -> Callable[[], object]:
    model, motion, held = simulation.model, simulation.motion(), simulation.inputs.held()
    return lambda: model.force(motion.time, motion.q, motion.u, held)


def _jacobian(simulation: Simulation) -> Callable[[], object]:
    model, motion, held = simulation.model, simulation.motion(), simulation.inputs.held()
    return lambda: model.jacobian(motion.time, motion.q, motion.u, held, positive_definite=False)


def _with_steps(row: Row, simulation: Simulation) -> Row:
    """Return the row with the cost of SPAN seconds from the present state; the CPU time of a step is in `extra`."""
    start = simulation.state

    def run() -> Row:
        simulation.reset(start)
        before = replace(simulation.integrator.counters)
        simulation.advance_to(SETTLING + SPAN)
        after = simulation.integrator.counters
        return replace(
            row,
            steps=after.steps - before.steps,
            evaluations=after.evaluations - before.evaluations,
            factorisations=after.factorisations - before.factorisations,
        )

    cpu, counted = best_of(5, run)
    extra = f"{row.extra} step {1e6 * cpu / max(counted.steps, 1):.0f}"
    return replace(counted, cpu=cpu / SPAN, extra=extra)
