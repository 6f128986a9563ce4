"""The material against classical mechanics on coarse meshes; `ldcs validate --mechanics` goes on to finer ones."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.cli.main import main
from ldcs_ros.validate import finite_elements as fe
from ldcs_ros.validate import mechanics, small_displacements
from ldcs_ros.validate import problems as p
from ldcs_ros.validate.benchmark import LIMITS
from ldcs_ros.validate.linear_sheets import LinearSheet, shear_modulus, sheet_content


@pytest.fixture(scope="module")
def found():
    return distinct(mechanics.benchmarks((5, 9, 17)))


@pytest.fixture(scope="module")
def small():
    return distinct(small_displacements.small_displacements((9, 17, 33)))


def distinct(rows):
    """Rows by name; `the same, plate` has the name of the row before it in front."""
    found, before = {}, ""
    for one in rows:
        before = before if one.name.startswith("the same") else one.name
        found[one.name if one.name == before else f"{before}; {one.name}"] = one
    return found


def test_the_elastica_has_the_answer_of_the_tables():
    # Bisshopp and Drucker (1945), as tabled for F L^2 / (E I) = 1 and 4: heights 0.30172 and 0.66996 of the length.
    np.testing.assert_allclose(
        [mechanics.elastica(load)[1] for load in (1.0, 4.0)], [0.30172, 0.66996], atol=2e-5
    )


def test_cantilevers_are_within_the_stiffness_that_their_clamp_adds(found):
    # A wide plate is 1 / (1 - v^2) = 1.125 times as stiff as a beam; a strip with one clamped end lies between.
    for name, one in found.items():
        if name.startswith("cantilever, tip load"):
            assert -0.04 < one.errors[17] < 0.0, name
    assert -0.06 < found["cantilever under its weight (g / 200): sag of the tip [m]"].errors[17] < 0.0
    assert 0.0 < found["cantilever: frequency of first bending [Hz]"].errors[17] < 0.025
    assert -0.02 < found["strip hanging by its end (g / 10): extension [m]"].errors[17] < 0.0


def test_the_clamped_plate_converges_to_the_plates_theory(found):
    one = found["clamped square plate, point load: deflection [m]"]
    errors = list(one.errors.values())
    assert errors[0] > errors[1] > errors[2] > 0.0 and errors[2] < 0.015


def test_frequencies_and_buckling_go_to_those_of_a_plate(found):
    for name, most in (("first bending", 0.005), ("second bending", 0.02), ("torsion", 0.12)):
        errors = found[f"cantilever: frequency of {name} [Hz]; the same, plate"].errors
        assert abs(errors[17]) < most and abs(errors[17]) < 0.6 * abs(errors[9]), name
    buckling = found["deep cantilever, tip load: lateral buckling [N]; the same, plate"].errors
    assert 0.0 < buckling[17] < 0.06


def test_sheets_without_a_known_limit_are_within_two_percent_of_plates_and_finite_elements(small):
    for name, one in small.items():
        if not one.limit:
            errors = np.abs(list(one.errors.values()))
            assert errors[2] < 0.01 and errors[2] < 0.65 * errors[1] < 0.65 * errors[0], name
    assert sum(not one.limit for one in small.values()) == 3
    assert abs(small["pulled square with a stiff one inside: strain"].errors[33]) < 0.01


def test_known_limits_have_the_size_that_the_page_states(small):
    shear = small["in-plane shear modulus [Pa]"].errors.values()
    np.testing.assert_allclose(np.array(list(shear)) + 1.0, p.SHEAR_FACTOR, rtol=1e-6)
    bending = small["springs without material: bending stiffness"].values
    np.testing.assert_allclose(list(bending.values()), [1.82, 2.21, 2.64], atol=0.01)
    narrow = small["narrower to its tip [m]"].errors
    assert 0.005 < abs(narrow[33]) < 0.55 * abs(narrow[17])
    hole = "pulled strip with a hole: "
    assert -0.35 < small[hole + "stress concentration"].errors[33] < -0.1
    for quantity in ("strain beside the hole", "elongation of the hole"):
        assert abs(small[f"{hole}{quantity}"].errors[33]) < 0.04, quantity
    assert {part for one in small.values() for part in one.limit.split(", ") if part} <= set(LIMITS)


def test_the_shear_factor_is_that_of_poissons_ratio():
    # The inclined springs' part by the formulas of the material at 1/3 and ACROSS_RATIO 8.
    x = 4.0 * (1.0 - np.sqrt(0.5))
    between = (1.0 / 3.0 + x * x / 8.0) / (1.0 / 3.0)
    assert pytest.approx((1.0 + 2.0 * between) / 3.0, rel=1e-6) == p.SHEAR_FACTOR
    sheet = LinearSheet(sheet_content((0.1, 0.1), (5, 5), {"x": 0.05, "y": 0.0}))
    assert shear_modulus(sheet) == pytest.approx(p.SHEAR_FACTOR * small_displacements.SHEAR_MODULUS, rel=1e-6)


def test_finite_elements_agree_with_closed_formulas():
    # Heywood's stress concentration of a hole in a strip of finite width; a beam's sag, which a plate stays below.
    ratio = 2.0 * p.HOLE_RADIUS / p.HOLED_WIDTH
    assert fe.HOLED[0] == pytest.approx((2.0 + (1.0 - ratio) ** 3) / (1.0 - ratio), rel=0.04)
    beam = -12.0 * p.LENGTH**4 / (8.0 * p.THICKNESS**2)
    assert 1.0 - p.POISSON**2 < fe.STRIP_SAG / beam < 1.0
    first = mechanics.FIRST_ROOT**2 * p.THICKNESS / (2.0 * np.pi * np.sqrt(12.0) * p.LENGTH**2)
    assert 1.0 < fe.STRIP_FREQUENCIES[0] / first < 1.0 / np.sqrt(1.0 - p.POISSON**2)


def test_the_verb_prints_a_table_and_draws_it(found, small, capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(mechanics, "benchmarks", lambda: iter(found.values()))
    monkeypatch.setattr(small_displacements, "small_displacements", lambda: iter(small.values()))
    assert main(["validate", "--mechanics", "-o", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "cantilever, tip load 1 E I / L^2" in out and "error at 33 nodes" in out
    assert "divide youngs_modulus by 1.34" in out and "cut cells" in out
    assert (tmp_path / "mechanics.png").stat().st_size > 20000
