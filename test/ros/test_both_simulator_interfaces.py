"""LoadWorld of both released families: version 1 has the resource's fields in the request, 2.1 has a resource."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import pytest

pytest.importorskip("simulation_interfaces", reason="simulation_interfaces is not installed")

from simulation_interfaces.srv import LoadWorld

from ldcs_ros import load_scene
from ldcs_ros.ros.sim.graph_files import GraphFiles
from ldcs_ros.ros.simulator.answers import ResultError
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
