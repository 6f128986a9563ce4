"""The simulator services with both released families of the interfaces.

Between version 1 and 2.1 differ, of what the node offers: the request of LoadWorld (1: the resource's fields, 2.1: a
resource) and of SetEntityState (2.1: flags). Version 1.0 has no worlds, and fewer states and features.
"""

from __future__ import annotations

import asyncio
import sys
from types import SimpleNamespace

import pytest

pytest.importorskip("simulation_interfaces", reason="simulation_interfaces is not installed")

from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
from simulation_interfaces.srv import LoadWorld, SetEntityState

from ldcs_ros import load_scene
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.simulator import answers, control, services
from ldcs_ros.ros.simulator.answers import ResultError
from ldcs_ros.ros.simulator.entity_services import EntityServices
from ldcs_ros.ros.simulator.worlds import Worlds


class Loader:
    """A loader that keeps the scene and builds no twin."""

    scene = None

    async def load(self, scene, *, stop):
        self.scene = scene()
        return SimpleNamespace(scene=self.scene), ""


def version_1(**fields):
    """A request with the fields of versions 1.1 to 1.6."""
    given = {"uri": "", "resource_string": "", "fail_on_unsupported_element": False}
    return SimpleNamespace(**given | fields)


def version_2(**fields):
    """A request with the fields of version 2.1."""
    return SimpleNamespace(world_resource=SimpleNamespace(**{"uri": "", "resource_string": ""} | fields))


def load(request, folder=""):
    """Return the scene that a request loads."""
    loader = Loader()
    worlds = Worlds(
        SimpleNamespace(active_runner=lambda: None), loader, GraphFiles(folder, SimpleNamespace(error=print))
    )
    asyncio.run(worlds.load(request, LoadWorld.Response()))
    return loader.scene


@pytest.mark.parametrize("version", [version_1, version_2])
def test_a_world_comes_by_name_text_or_path(version, tmp_path):
    text = load_scene("hanging_sheet").text
    (tmp_path / "mine.yaml").write_text(text)
    assert load(version(uri="single_spring")).name == "single_spring"
    assert load(version(resource_string=text)).text == text
    assert load(version(uri=f"file://{tmp_path}/mine.yaml"), str(tmp_path)).name == "mine"


@pytest.mark.parametrize("version", [version_1, version_2])
def test_a_request_without_a_resource_or_with_a_foreign_path_is_refused(version, tmp_path):
    with pytest.raises(ResultError) as caught:
        load(version())
    assert caught.value.code == LoadWorld.Response.NO_RESOURCE
    (tmp_path / "mine.yaml").write_text("title: secret\n")
    with pytest.raises(ResultError, match="graph_folder") as caught:
        load(version(uri=str(tmp_path / "mine.yaml")))
    assert "secret" not in str(caught.value)
    with pytest.raises(ResultError, match="log of the node") as caught:
        load(version(uri="mine.yaml"), str(tmp_path))
    assert "secret" not in str(caught.value)


ENTITY_FIELDS = ("entity", "state", "set_pose", "set_twist", "set_acceleration")


@pytest.mark.parametrize("fields", [ENTITY_FIELDS[:2], ENTITY_FIELDS])
def test_an_entity_is_moved_by_hand_in_no_version(fields):
    request = SetEntityState.Request()
    assert tuple(request.get_fields_and_field_types()) == ENTITY_FIELDS
    given = SimpleNamespace(**{name: getattr(request, name) for name in fields})
    with pytest.raises(ResultError, match="external_wrench") as caught:
        EntityServices(SimpleNamespace(runner=None)).refuse_to_set(given, SetEntityState.Response())
    assert caught.value.code == Result.RESULT_FEATURE_UNSUPPORTED


def without(message, *prefixes):
    """Return the constants of a message type but those with some prefixes, as an earlier version has them."""
    names = [name for name in dir(message) if name.isupper() and not name.startswith(prefixes)]
    return SimpleNamespace(**{name: getattr(message, name) for name in names})


def test_without_a_scene_the_state_is_no_world_or_in_version_1_0_stopped(monkeypatch):
    host = SimpleNamespace(runner=None, finished=SimpleNamespace(is_set=lambda: False))
    for state, expected in (
        (SimulationState, SimulationState.STATE_NO_WORLD),
        (without(SimulationState, "STATE_NO_WORLD", "STATE_LOADING"), SimulationState.STATE_STOPPED),
    ):
        monkeypatch.setattr(control, "SimulationState", state)
        response = SimpleNamespace(state=SimpleNamespace(state=None))
        control.Control(host).report_state(None, response)
        assert response.state.state == expected


def test_features_that_a_version_does_not_name_are_left_out(monkeypatch):
    def features(offered):
        response = SimpleNamespace(features=SimpleNamespace())
        services.Features(offered).report(None, response)
        return response.features.features

    whole = features(services.FEATURES)
    assert SimulatorFeatures.WORLD_LOADING in whole and SimulatorFeatures.STEP_SIMULATION_ACTION in whole
    monkeypatch.setattr(services, "SimulatorFeatures", without(SimulatorFeatures, "WORLD", "AVAILABLE"))
    assert features(services.FEATURES) == [
        number for number in whole if number < SimulatorFeatures.WORLD_LOADING
    ]


def test_version_1_0_has_no_worlds_and_offers_the_rest(monkeypatch):
    offered = []
    node = SimpleNamespace(create_service=lambda kind, name, *_, **__: offered.append(name))
    monkeypatch.setattr(answers, "srv", SimpleNamespace(SetEntityState=SetEntityState))
    assert answers.offer_service(node, "SetEntityState", print)
    assert not answers.offer_service(node, "GetAvailableWorlds", print)
    assert offered == ["~/set_entity_state"]
    monkeypatch.setitem(sys.modules, "ldcs_ros.ros.simulator.worlds", None)
    assert services._offer_worlds(node, None, None, None) == []
