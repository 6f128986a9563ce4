"""What was fitted, what the data determine, and the time course."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.validate import calibration, identifiability, pictures, tables, transient
from ldcs_ros.validate.measure import at_rest
from ldcs_ros.validate.parameters import CALIBRATED, PARAMETERS, SENSOR_HEIGHT, present

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def content():
    return calibration.calibrated_content()


@pytest.fixture(scope="module")
def moved(content):
    return identifiability.sensitivities(content)


def test_at_most_four_numbers_were_fitted_each_inside_its_bounds(content):
    assert len(PARAMETERS) <= 4
    for parameter in PARAMETERS:
        assert parameter.low < present(content, parameter) < parameter.high


def test_fitting_again_from_elsewhere_comes_back_to_the_shipped_numbers(content):
    start = {
        "effects.arms.joint_stiffness": 0.4,
        "inputs[0].torque": 0.16,
        "effects.arms.backbone_height": 0.0,
    }
    again = calibration.fit(content, start=start)
    confidence = identifiability.confidence(content, again.seen)
    for parameter in PARAMETERS:
        gap = abs(again.values[parameter.path] - present(content, parameter))
        assert gap < 0.5 * confidence.deviation[parameter.short], parameter.short
    assert np.abs(again.seen - calibration.target())[:4].max() < 0.6


@pytest.mark.parametrize("name", ["P1 z", "r"])
def test_the_pages_name_the_error_of_a_number_that_is_held_out(content, name):
    index = calibration.OBSERVATIONS.index(name)
    error = calibration.fit(content, without=name).seen[index] - calibration.target()[index]
    readme, page = ((ROOT / path).read_text(encoding="utf-8") for path in ("README.md", "docs/validation.md"))
    four, radius = re.search(r"error of\n(.*) mm \(P0 ux, P0 uz, P1 ux, P1 uz\);.*misses by (\S+) mm", readme).groups()
    in_readme = [float(value) for value in re.findall(r"-?\d\.\d+", four)] + [float(radius)]
    in_page = [float(value) for value in re.findall(r"(?:u[xz]|, r) (-?\d\.\d+) mm", page)]
    for values in (in_readme, in_page):
        assert values[index] == pytest.approx(error, abs=0.01 if index < 4 else 0.06)
    assert f"{len(identifiability.STRUCTURES)} structures" in readme


def test_a_sensor_at_half_the_thickness_sits_on_the_top_node(content):
    rest = at_rest(content)
    node = rest.simulation.lattice.node(1, 8, 4)
    top = 1e3 * (rest.position - rest.simulation.lattice.reference_position)[node]
    seen = calibration.observe(content, {SENSOR_HEIGHT: 0.005})
    np.testing.assert_allclose(seen[2:4], top[[0, 2]], atol=1e-9)


def test_five_numbers_leave_the_other_directions_undetermined(content):
    directions = identifiability.directions(content)
    unheard = [direction for direction in directions if direction.strength < 1.0]
    assert len(unheard) >= len(directions) - len(calibration.OBSERVATIONS)
    assert "no" in [row[1] for row in tables.directions(directions)]


def test_a_held_radius_is_held(moved):
    for item in moved:
        assert abs(item.held[-1]) < 1e-9
    torque = next(item for item in moved if item.parameter.path == identifiability.TORQUE)
    assert np.abs(torque.held).max() < 1e-9 and abs(torque.alone[3]) > 10.0


def test_slopes_predict_a_small_change(content, moved):
    height = next(p for p in PARAMETERS if p.short == "backbone height")
    item = next(item for item in moved if item.parameter is height)
    step = 0.04
    changed = present(content, height) + step * height.spread
    change = calibration.observe(content, {height.path: changed}) - calibration.observe(content)
    np.testing.assert_allclose(change, step * item.alone, atol=0.02)


def test_p0_and_p1_settle_within_the_papers_seconds():
    motion = transient.simulate(load_scene(CALIBRATED))
    rest = at_rest(load_scene(CALIBRATED)).displacement
    assert 0.3 < motion.settling < 2.0
    assert motion.overshoot < 15.0
    for name, track in motion.displacement.items():
        assert np.abs(track[:, 1]).max() < 1e-6  # mm
        np.testing.assert_allclose(track[-1], rest[name], atol=0.05)
    assert pictures.transient_figure(motion, "a title").axes


def test_more_damping_settles_without_overshoot(content):
    heavy = transient.simulate(load_scene(transient.with_damping(content, 16.0)))
    assert heavy.overshoot < 0.1
    assert transient.time_constant(content) == pytest.approx(5.0 / 138.8)


def test_the_tornado_plot_has_a_bar_for_each_parameter_but_the_torque(moved, tmp_path):
    figure = pictures.tornado_figure(moved, "a title")
    assert len(figure.axes) == 4
    assert len(figure.axes[0].get_yticklabels()) == len(moved) - 1
    (path,) = pictures.write({"sensitivity": figure}, tmp_path)
    assert path.stat().st_size > 10_000
