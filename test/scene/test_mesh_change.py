"""Points and loads that are node numbers keep their places when the number of nodes changes."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.cli.scene_argument import scene_with
from ldcs_ros.errors import SceneError
from ldcs_ros.scene.mesh_change import carry_places


def reference_position(scene, place):
    """Position of a point or node at rest [m], shape (3,)."""
    return scene.points[place].position(scene.lattice.reference_position)


@pytest.mark.parametrize("nodes", ["[17,17]", "[5,5]", "[9,17]"])
def test_a_refined_sheet_has_its_points_at_the_same_places(nodes):
    coarse, fine = load_scene("paper"), scene_with("paper", [f"lattice.nodes={nodes}"])
    for name in ("P0", "P1"):
        assert np.allclose(reference_position(fine, name), reference_position(coarse, name), atol=1e-15)


def test_the_payload_of_the_refined_paper_hangs_where_it_hung(capsys):
    # With the payload at the 8th of 17 nodes P1 rose to 12 mm.
    coarse = load_scene("paper").build()
    fine = scene_with("paper", ["lattice.nodes=[17,17]", "effects.arms.width=2"]).build()
    told = capsys.readouterr().err
    assert "points.P1: [mid, 8, 4] is [mid, 16, 8] on 17 x 17 nodes" in told
    assert "effects[4].width: 2 counts cells" in told
    heights = []
    for simulation in (coarse, fine):
        simulation.settle()
        heights.append(simulation.points["P1"].position(simulation.state.position)[2])
    assert heights[0] == pytest.approx(heights[1], abs=2e-3)


def test_a_place_without_a_node_on_the_new_mesh_is_refused_with_what_to_do(capsys):
    assert main(["simulate", "paper", "--settle", "--set", "lattice.nodes=[6,6]"]) == 2
    told = capsys.readouterr().err
    assert "[mid, 4, 4]" in told and "points.P0" in told and told.count("\n") == 1


def test_places_that_the_change_gives_are_left_alone():
    scene = scene_with("paper", ["lattice.nodes=[6,6]", "points.P0=[mid,2,2]", "points.P1=[mid,free_edge]"])
    assert scene.points["P0"].where.startswith("column 2,")


def test_loads_and_frames_of_wrenches_go_along():
    before = {
        "lattice": {"nodes": [3, 3]},
        "effects": [{"type": "force", "at": ["top", 2, 1]}, {"type": "payload", "at": "node_top_1_1"}],
        "inputs": [{"time": 0.0, "wrench": {"frame": "node_top_2_2_aligned"}}],
    }
    after = load_content(before, nodes=[5, 9])
    lines = carry_places(before, after)
    assert after["effects"][0]["at"] == ["top", 4, 4]
    assert after["effects"][1]["at"] == "node_top_2_4"
    assert after["inputs"][0]["wrench"]["frame"] == "node_top_4_8_aligned"
    assert len(lines) == 3


def test_an_edited_scene_keeps_its_places_and_says_so():
    with pytest.warns(UserWarning, match="points.P1"):
        fine = load_scene("paper").edited({"lattice.nodes": [17, 17]})
    assert fine.points["P1"].where.startswith("column 16,")
    with pytest.raises(SceneError, match=r"points.P0"):
        load_scene("paper").edited({"lattice.nodes": [6, 6]})


def test_a_scene_of_named_places_changes_its_mesh_without_a_word(recwarn, capsys):
    scene_with("arc", ["lattice.nodes=[12,7]"])
    load_scene("arc").edited({"lattice.nodes": [12, 7]})
    assert not recwarn.list and not capsys.readouterr().err


def load_content(content, *, nodes):
    """Return a copy of a scene's content with other nodes."""
    import copy

    changed = copy.deepcopy(content)
    changed["lattice"]["nodes"] = nodes
    return changed
