"""Regions of space: which points and line segments meet them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ldcs_ros.ros.simulator.filters import Box, Sphere

UNIT_BOX = Box.of([(1.0, 1.0, 1.0), (0.0, 0.0, 0.0)])
UNIT_SPHERE = Sphere.of([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
POINTS = arrays(float, (4, 3), elements=st.floats(-2.0, 2.0, allow_subnormal=False))


@given(POINTS)
def test_a_point_meets_what_it_is_in(points):
    in_box = ((points >= 0.0) & (points <= 1.0)).all(axis=1)
    assert UNIT_BOX.intersects(points, points).tolist() == in_box.tolist()
    in_sphere = np.linalg.norm(points, axis=1) <= 1.0
    assert UNIT_SPHERE.intersects(points, points).tolist() == in_sphere.tolist()


@given(POINTS, POINTS)
def test_a_segment_meets_what_a_point_of_it_is_in(begin, end):
    between = begin + np.linspace(0.0, 1.0, 41)[:, None, None] * (end - begin)
    for region in (UNIT_BOX, UNIT_SPHERE):
        seen = region.intersects(between.reshape(-1, 3), between.reshape(-1, 3)).reshape(41, -1).any(axis=0)
        assert (region.intersects(begin, end) | ~seen).all()


def test_a_segment_through_a_region_meets_it_with_both_ends_outside():
    begin, end = np.array([[-3.0, 0.5, 0.5], [-3.0, 1.5, 0.5]]), np.array([[3.0, 0.5, 0.5], [3.0, 1.5, 0.5]])
    assert UNIT_BOX.intersects(begin, end).tolist() == [True, False]
    assert UNIT_SPHERE.intersects(begin, end).tolist() == [True, False]


@pytest.mark.parametrize("kind", [Box, Sphere])
@pytest.mark.parametrize("points", [[], [(0.0, 0.0, 0.0)], [(0.0, 0.0, float("nan")), (1.0, 0.0, 0.0)]])
def test_points_that_describe_no_region_are_refused(kind, points):
    with pytest.raises(ValueError, match="bounds"):
        kind.of(points)


def test_a_sphere_has_no_negative_radius():
    with pytest.raises(ValueError, match="radius"):
        Sphere.of([(0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
