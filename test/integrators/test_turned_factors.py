"""Factors that turn with the sheet stand in for the true, unsymmetric Newton matrix of a moving, damped sheet."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.integrators.implicit.system import LinearSystem

RATE_STEP = 0.01


def _moving(scene, nodes=None, **springs):
    content = load_scene(scene).content
    if nodes:
        content["lattice"]["nodes"] = nodes
    content["effects"][0].update(springs)
    simulation = load_scene(content).build()
    simulation.advance_to(0.5 if scene != "paper" else 0.2)
    return simulation


def _contraction(simulation, factors):
    """Return the spectral radius of 1 - W~^-1 W by power iteration, W from the exact Jacobian."""
    model, motion = simulation.model, simulation.motion()
    values = model.jacobian(
        motion.time, motion.q, motion.u, simulation.inputs.held(), positive_definite=False
    )
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    w = np.zeros((len(model.free), len(model.free)))
    np.add.at(w, (rows[used], columns[used]), -RATE_STEP * (values[1] + RATE_STEP * values[0])[used])
    w[: model.n_free_nodes, : model.n_free_nodes] += np.diag(model.mass)
    blocks = model.inertia(motion.q)
    for side, block in enumerate(() if blocks is None else blocks):
        at = model.n_free_nodes + side * len(block)
        w[at : at + len(block), at : at + len(block)] += block
    x, size = np.random.default_rng(2).normal(size=len(w)), 0.0
    for _ in range(40):
        x = x - factors.solve(w @ x)
        size = np.linalg.norm(x)
        x /= size
    return size


@pytest.mark.parametrize(
    ("scene", "springs"), [("paper", {}), ("paper", {"law": "corotational"}), ("arc", {})]
)
def test_iterations_with_turned_factors_contract(scene, springs):
    assert _fresh_contraction(_moving(scene, **springs)) < 0.25


def test_how_fast_they_contract_does_not_depend_on_the_lattice():
    coarse, fine = (_fresh_contraction(_moving("arc_material", [n, n])) for n in (9, 17))
    assert fine < 0.25
    assert fine == pytest.approx(coarse, rel=0.1)


def _fresh_contraction(simulation):
    motion, held = simulation.motion(), simulation.inputs.held()
    where = motion.time, motion.q, motion.u, held, RATE_STEP
    system = LinearSystem(simulation.model)
    return _contraction(simulation, system.turn(system.factor(*where, corotated=True), *where))


def test_factors_of_another_step_are_scaled():
    simulation = _moving("arc", [9, 9])
    motion, held = simulation.motion(), simulation.inputs.held()
    system = LinearSystem(simulation.model)
    old = system.factor(motion.time, motion.q, motion.u, held, RATE_STEP / 1.3, corotated=True)
    assert _contraction(simulation, system.turn(old, motion.time, motion.q, motion.u, held, RATE_STEP)) < 0.35


def test_a_finer_lattice_of_the_same_material_takes_no_more_steps():
    steps = []
    for n in (9, 17, 33):
        content = load_scene("arc_material").content
        content["lattice"]["nodes"] = [n, n]
        content["solver"] = {"integrator": "auto", "accuracy": 2e-5}
        simulation = load_scene(content).build()
        simulation.advance_to(1.2)
        steps.append(simulation.statistics.steps + simulation.statistics.rejected_steps)
    # It used to take 77 at 33 x 33: iterations that did not converge cut the steps.
    assert max(steps) <= 1.4 * min(steps)
