"""A run can start from any given shape: what is prescribed stays, what is not sound is refused whole."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene


def test_a_started_shape_is_the_state_but_for_what_is_prescribed():
    simulation = load_scene("paper").build()
    random = np.random.default_rng(1)
    rest = simulation.lattice.reference_position
    position = rest + random.normal(0.0, 1e-3, rest.shape)
    velocity = random.normal(0.0, 0.1, rest.shape)
    simulation.start_from(position, velocity, link_angle=np.full((2, 4), 0.1))
    state = simulation.state
    held = simulation.lattice.edge("x_min")
    free = np.setdiff1d(np.arange(len(rest)), held)
    np.testing.assert_array_equal(state.position[free], position[free])
    np.testing.assert_array_equal(state.velocity[free], velocity[free])
    np.testing.assert_array_equal(state.position[held], rest[held])
    assert not state.velocity[held].any()
    assert (state.link_angle == 0.1).all() and not state.link_rate.any()
    simulation.advance_to(0.1)
    assert np.isfinite(simulation.state.position).all()


def test_starting_from_the_rest_shape_is_the_scenes_own_start():
    own, started = load_scene("arc").build(), load_scene("arc").build()
    started.start_from(started.lattice.reference_position)
    for simulation in (own, started):
        simulation.advance_to(0.3)
    np.testing.assert_array_equal(own.state.position, started.state.position)


def test_the_commands_and_the_time_go_on():
    simulation = load_scene("paper").build()
    simulation.advance_to(0.2)
    simulation.inputs.set_torque(0.05)
    simulation.start_from(simulation.lattice.reference_position)
    assert simulation.time == 0.2
    simulation.advance_to(0.3)
    np.testing.assert_allclose(simulation.joint_torque, 0.05)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rest: {"position": rest[:-1]}, "position: got shape"),
        (lambda rest: {"position": np.where(rest > 0.1, np.nan, rest)}, "position: got a number that is not finite"),
        (lambda rest: {"position": rest, "velocity": np.full_like(rest, np.inf)}, "velocity"),
        (lambda rest: {"position": rest, "link_angle": np.zeros((2, 3))}, r"link_angle: .*\(2, 4\)"),
    ],
)  # fmt: skip
def test_an_unsound_shape_is_refused_whole(change, words):
    simulation = load_scene("paper").build()
    simulation.advance_to(0.1)
    before = simulation.state
    with pytest.raises(ValueError, match=words):
        simulation.start_from(**change(simulation.lattice.reference_position))
    np.testing.assert_array_equal(simulation.state.position, before.position)
    simulation.advance_to(0.15)


def test_the_last_step_is_the_curve_that_the_state_lies_on():
    simulation = load_scene("arc").build()
    simulation.advance_to(0.5)
    step = simulation.last_step
    assert step.left.time <= simulation.time <= step.right.time
    motion = step.at(simulation.time, simulation.model)
    np.testing.assert_array_equal(motion.q.reshape(-1, 3), simulation.state.position)
