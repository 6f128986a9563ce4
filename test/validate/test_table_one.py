"""The paper's test: the calibrated twin against the experiment, and the README's word about it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.validate import calibration, cases, identifiability, paper, tables
from ldcs_ros.validate.measure import at_rest, circle
from ldcs_ros.validate.parameters import CALIBRATED

README = Path(__file__).resolve().parents[2] / "README.md"
PAGE = README.parent / "docs/validation.md"


@pytest.fixture(scope="module")
def calibrated():
    return cases.calibrated_case()


def test_all_displacements_are_within_0_6_mm_of_the_experiment(calibrated):
    for name, error in paper.errors(calibrated.rest.displacement).items():
        assert np.abs(error).max() < 0.6, name


def test_the_calibrated_edges_have_the_papers_radius_within_2_percent(calibrated):
    assert calibrated.rest.radius == pytest.approx(paper.RADIUS, rel=0.02)


def test_the_calibrated_points_stay_in_the_middle(calibrated):
    for name in paper.POINTS:
        assert abs(calibrated.rest.displacement[name][1]) < 1e-3  # mm


def test_no_error_has_grown_by_0_05_mm(calibrated):
    assert paper.grown(calibrated.rest.displacement) == []


def test_an_error_that_grows_by_0_05_mm_is_told(calibrated):
    worse = {name: value.copy() for name, value in calibrated.rest.displacement.items()}
    worse["P1"][2] -= 0.07
    (line,) = paper.grown(worse)
    assert line.startswith("P1 uz: error -0.28 mm, committed -0.21 mm")


def test_validate_prints_one_json_object_and_the_readme_has_its_tables(capsys, monkeypatch, tmp_path):
    found = cases.all_cases()  # the searches take seconds: once for all that follows
    monkeypatch.setattr(cases, "all_cases", lambda progress: found)
    held_out = dict(zip(calibration.OBSERVATIONS, (0.1, 0.2, 0.3, 0.4, 0.5), strict=True))
    monkeypatch.setattr(calibration, "held_out_errors", lambda content, progress: held_out)
    assert main(["validate", "--json", "-o", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["cases"]["printed axial"]["radius"] == pytest.approx(0.115, abs=1e-6)
    assert result["cases"]["printed axiswise"]["worst_mm"] > 50.0
    assert result["cases"]["calibrated"]["worst_mm"] < 0.6
    assert result["held_out_error_mm"] == held_out
    assert sorted(Path(path).name for path in result["files"]) == ["course.png", "shape.png"]
    assert main(["validate", "--markdown"]) == 0
    printed = capsys.readouterr().out.strip()
    block = re.compile(r"<!-- ldcs validate --markdown -->\n(.*?)<!-- end -->", re.DOTALL)
    assert block.search(PAGE.read_text())[1].strip() == printed, (
        "put `ldcs validate --markdown` into the page"
    )
    table_one = printed.split("\n\n")[0]
    assert block.search(README.read_text())[1].strip() == table_one, "put its first table into the README"
    monkeypatch.setattr(paper, "COMMITTED", paper.Committed((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert main(["validate"]) == 1
    output = capsys.readouterr()
    assert "P0 uz" in output.err and "Table I" in output.out
    assert "P1 z +0.40, r +0.50" in output.out and "of the paper's simulation" in output.out
    assert f"structures compared before the fit: {len(identifiability.STRUCTURES)}" in output.out


def test_the_calibrated_stiffness_gives_the_printed_modulus_in_a_tension_test():
    # Pulled at the free edge, strain over the inner columns, as a tensile test measures it away from its grips.
    scene = load_scene(CALIBRATED)
    pull, ny = 0.05, 9
    effects = [
        {"type": "springs", "law": "axial", "stiffness": scene.effect("springs").stiffness},
        {"type": "clamp"},
        *(
            {"type": "force", "at": [layer, 8, j], "value": [pull / (2 * ny), 0.0, 0.0]}
            for layer in ("bottom", "top")
            for j in range(ny)
        ),
    ]
    lattice = {"size": [0.14, 0.14, 0.01], "nodes": [9, 9], "mass": 0.16}
    rest = at_rest({"lattice": lattice, "effects": effects})
    index, flat = rest.simulation.lattice.index, rest.simulation.lattice.reference_position
    moved = (rest.position - flat)[index][..., 0].mean(axis=(0, 2))
    strain = np.polyfit(np.linspace(0.0, 0.14, 9)[2:-2], moved[2:-2], 1)[0]
    assert pull / (0.14 * 0.01) / strain == pytest.approx(paper.YOUNGS_MODULUS, rel=2e-3)


def test_the_circle_fit_finds_a_circle_and_its_side():
    angle = np.linspace(0.1, 1.2, 9)
    arc = 0.115 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    assert circle(arc) == pytest.approx((0.115, 0.0), abs=1e-12)
    assert circle(arc * [1.0, -1.0])[0] == pytest.approx(-0.115)
    assert circle(np.stack([angle, 0.0 * angle], axis=1))[0] == np.inf


def test_numbers_that_round_to_zero_have_no_sign():
    assert tables.signed(-0.001, 2) == "0.00" and tables.signed(-0.26, 1) == "-0.3"


def test_a_radius_that_no_torque_gives_is_refused():
    with pytest.raises(cases.ValidationError, match="radius"):
        cases.torque_for_radius(lambda torque: cases.as_printed("axiswise", torque=0.5 * torque), radius=0.03)
