"""Entities of a simulation: which there are, and that their motion is the derivative of where they are."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.ros.simulator.entities import Entities, Kind

STEP = 1e-4  # s


@pytest.fixture(scope="module")
def moving():
    """The paper's scene on its way up, with its entities' motions a moment before, now and a moment later."""
    simulation = load_scene("paper").build()
    entities = Entities(simulation)
    kinematics = []
    for time in (0.2 - STEP, 0.2, 0.2 + STEP):
        simulation.advance_to(time)
        kinematics.append(entities.kinematics(entities.instant()))
    return simulation, entities, kinematics


def test_points_nodes_and_links_are_there_by_name(moving):
    _, entities, _ = moving
    kinds = [entity.kind for entity in entities.all.values()]
    assert [kinds.count(kind) for kind in (Kind.POINT, Kind.NODE, Kind.LINK)] == [2, 162, 8]
    assert [entity.row for entity in entities.all.values()] == list(range(172))
    assert {"P0", "P1", "node_top_8_4", "left_link_1", "right_link_4"} <= set(entities.all)
    still = [name for name, entity in entities.all.items() if entity.still]
    assert len(still) == 18 and all("_0_" in name for name in still)
    assert entities.all["node_bottom_0_3"].tags == ("node", "sheet", "bottom", "clamped")


@pytest.mark.parametrize("name", ["P0", "P1", "node_top_8_4", "node_bottom_3_0"])
def test_poses_are_those_of_the_simulation(moving, name):
    simulation, entities, kinematics = moving
    position, orientation = simulation.pose(name)
    row = entities.all[name].row
    assert kinematics[2].position[row] == pytest.approx(position, abs=1e-15)
    assert kinematics[2].orientation(row) == pytest.approx(orientation, abs=1e-12)


def test_twists_and_accelerations_are_time_derivatives(moving):
    _, _, (before, now, after) = moving
    velocity = (after.position - before.position) / (2.0 * STEP)
    assert np.abs(now.velocity - velocity).max() < 1e-4 * np.abs(velocity).max()
    acceleration = (after.velocity - before.velocity) / (2.0 * STEP)
    assert np.abs(now.acceleration - acceleration).max() < 1e-2 * np.abs(acceleration).max()
    turned = np.einsum("nij,nkj->nik", after.axes - before.axes, now.axes) / (2.0 * STEP)
    angular_velocity = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=-1)
    assert np.abs(now.angular_velocity - angular_velocity).max() < 1e-4 * np.abs(angular_velocity).max()
    angular_acceleration = (after.angular_velocity - before.angular_velocity) / (2.0 * STEP)
    assert (
        np.abs(now.angular_acceleration - angular_acceleration).max()
        < 1e-2 * np.abs(angular_acceleration).max()
    )


def test_links_hang_together_and_the_first_stands_at_the_base(moving):
    _, entities, (_, now, _) = moving
    rows = [entities.all[f"left_link_{number}"].row for number in (1, 2, 3, 4)]
    ends = now.ends[rows]
    assert ends[0, 0] == pytest.approx([0.0, 0.06125, 0.0]), "in the middle of the two rows that it covers"
    assert ends[1:, 0] == pytest.approx(ends[:-1, 1], abs=1e-15)
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) == pytest.approx(0.035)
    assert now.axes[rows][:, :, 0] == pytest.approx((ends[:, 1] - ends[:, 0]) / 0.035)


def test_what_is_driven_has_the_acceleration_of_its_course():
    simulation = load_scene("arc").build()
    entities = Entities(simulation)
    row, kinematics = entities.all["node_top_8_0"].row, []
    for time in (0.3 - STEP, 0.3, 0.3 + STEP):
        simulation.advance_to(time)
        kinematics.append(entities.kinematics(entities.instant()))
    before, now, after = kinematics
    expected = (after.velocity[row] - before.velocity[row]) / (2.0 * STEP)
    assert now.acceleration[row] == pytest.approx(expected, rel=1e-3, abs=1e-4)


def test_a_scene_without_arms_has_no_links():
    kinds = {entity.kind for entity in Entities(load_scene("hanging_sheet").build()).all.values()}
    assert Kind.LINK not in kinds
