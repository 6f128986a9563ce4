"""A run that cannot go on says when, where, with which step and what to do; nothing that is not finite gets out."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import DivergenceError
from ldcs_ros.integrators import INTEGRATORS
from ldcs_ros.integrators.settings import Solver
from ldcs_ros.study.hard.scenes import ARMS, HANGING, changed

DIAGNOSIS = (
    r"stopped at t = \S+ s: .*(no step above \S+ s|dt = \S+ s)"
    r".*(node_\w+_\d+_\d+|link \d) accelerates most; .*(check|reduce)"
)


def _spoil(monkeypatch, integrator, field):
    step = integrator.step

    def spoiled(motion, inputs, h, tolerance):
        taken = step(motion, inputs, h, tolerance)
        if field == "error":
            return replace(taken, error=float("nan"))
        values = getattr(taken.right, field).copy()
        values[-1] = np.nan
        return replace(taken, right=replace(taken.right, **{field: values}))

    monkeypatch.setattr(integrator, "step", spoiled)


@pytest.mark.parametrize("field", ["q", "u", "a", "error"])
@pytest.mark.parametrize(
    "solver", [{"accuracy": 1e-5}, {"integrator": "trbdf2", "dt": 1e-3}], ids=["adaptive", "fixed"]
)
def test_whatever_a_method_gets_wrong_stays_inside(monkeypatch, field, solver):
    simulation = load_scene(changed(ARMS, {"solver": solver})).build()
    simulation.advance_to(0.05)
    with monkeypatch.context() as patch:
        _spoil(patch, simulation.integrator, field)
        with pytest.raises(DivergenceError, match=DIAGNOSIS):
            simulation.advance_to(1.0)
    state = simulation.state
    assert np.isfinite(state.position).all() and np.isfinite(state.velocity).all()
    simulation.advance_to(0.1)


def test_an_error_that_never_shrinks_ends_the_run(monkeypatch):
    simulation = load_scene(HANGING).build()
    step = simulation.integrator.step
    monkeypatch.setattr(simulation.integrator, "step", lambda *given: replace(step(*given), error=1.0))
    with pytest.raises(DivergenceError, match="estimated error stays"):
        simulation.advance_to(1.0)
    assert simulation.time == 0.0


@pytest.mark.parametrize("name", INTEGRATORS)
def test_every_method_keeps_what_is_not_finite_inside(name):
    scene = load_scene(HANGING)
    if name == "exponential":
        scene = load_scene(changed(HANGING, {"effects.springs.law": "axiswise"}))
    simulation = replace(scene, solver=Solver(name, 1e-4)).build()
    position = simulation.lattice.reference_position.copy()
    position[-1] = 1e200  # its springs pull with more than a double can square
    try:
        simulation.start_from(position)
        simulation.advance_to(1e-3)
    except DivergenceError as error:
        # The node, or one that a spring joins to it.
        n_i, n_j = simulation.lattice.nodes
        near = f"node_(top|bottom)_({n_i - 2}|{n_i - 1})_({n_j - 2}|{n_j - 1})"
        assert re.search(near, str(error))
    assert np.isfinite(simulation.state.position).all() and np.isfinite(simulation.state.velocity).all()
