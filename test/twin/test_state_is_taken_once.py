"""A twin takes the state once per event and hands it to every source that is due."""

from __future__ import annotations

import pytest

from ldcs_ros import load_scene
from ldcs_ros.simulation import simulation as simulation_module
from ldcs_ros.twin.settings import RunSettings
from ldcs_ros.twin.twin import Twin


@pytest.mark.parametrize("scene", ["paper", "rig"])
def test_a_report_builds_the_state_once(scene, monkeypatch):
    built, reported = [], []
    original = simulation_module.State

    def counted(**fields):
        built.append(fields["time"])
        return original(**fields)

    monkeypatch.setattr(simulation_module, "State", counted)
    settings = RunSettings(publish_tf=True, full_precision=True)
    sink = lambda topic, kind, cdr, time: reported.append(topic)  # noqa: E731
    twin = Twin(load_scene(scene), settings, sinks=[sink], has_subscribers=lambda name: True)
    reports = 0
    while twin.time < 0.2:
        built.clear(), reported.clear()
        twin.advance_to_next()
        assert len(built) <= 1
        if "nodes" in reported:
            reports += 1
            assert built == [twin.time]
            assert twin.simulation.state is twin.simulation.state
    assert reports == 11


def test_a_state_is_taken_again_after_an_advance_a_command_and_a_reset():
    simulation = load_scene("paper").build()
    start = simulation.state
    assert simulation.state is start
    simulation.advance_to(0.01)
    moved = simulation.state
    assert moved is not start and moved.time == 0.01
    simulation.inputs.set_torque(0.01)
    assert simulation.state is not moved
    simulation.reset(start)
    assert simulation.state.time == 0.0
    assert (simulation.state.position == start.position).all()


def test_a_state_cannot_be_changed_by_one_of_its_receivers():
    state = load_scene("paper").build().state
    with pytest.raises(ValueError, match="read-only"):
        state.position[0, 0] = 1.0
