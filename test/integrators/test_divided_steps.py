"""A fixed step that does not converge is taken in parts, and every moment inside it stays on the curve."""

from __future__ import annotations

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.integrators.base import StepFailure


def _arc(dt):
    scene = load_scene("arc").text.replace(
        "{integrator: auto, accuracy: 1.0e-5}", f"{{integrator: trbdf2, dt: {dt}}}"
    )
    from ldcs_ros.scene.load import parse_scene

    return parse_scene(scene, name="arc", origin="arc").build()


def test_a_step_in_parts_keeps_the_grid_and_the_curve(monkeypatch):
    simulation, fine = _arc(0.01), _arc(0.001)
    step = simulation.integrator.step

    def reluctant(motion, inputs, h, tolerance):
        if 0.1 < motion.time < 0.2 and h > 0.003:
            raise StepFailure("for the test")
        return step(motion, inputs, h, tolerance)

    monkeypatch.setattr(simulation.integrator, "step", reluctant)
    for time in np.linspace(0.0, 0.3, 301)[1:]:
        simulation.advance_to(time)
        fine.advance_to(time)
        assert simulation.last_step.left.time <= time <= simulation.last_step.right.time + 1e-9
        assert np.abs(simulation.state.position - fine.state.position).max() < 1e-4
    assert simulation.statistics.rejected_steps > 0
    assert simulation.last_step.right.time == 0.3
