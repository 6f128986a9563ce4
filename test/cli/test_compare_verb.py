"""`ldcs compare` writes a report and pictures, and its status says whether limits are kept."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image


@pytest.fixture
def bags(ldcs, scene_file, tmp_path):
    for name, mass in (("light", "0.010"), ("heavy", "0.020")):
        words = ("simulate", scene_file, "--duration", "0.4", "--set", f"effects.payload.mass={mass}")
        assert ldcs(*words, "--bag", tmp_path / name).status == 0
    return tmp_path / "light", tmp_path / "heavy"


def test_the_report_stands_beside_the_first_bag_with_pictures_that_show_something(ldcs, bags):
    light, heavy = bags
    outcome = ldcs("compare", light, heavy)
    assert outcome.status == 0, outcome.err
    for word in ("clock offset", "both are in simulation time", "P1", "surface", "of the side"):
        assert word in outcome.out
    folder = light.with_name("light_vs_heavy")
    text = (folder / "compare.md").read_text()
    assert "| P1 | z |" in text and "| P1 | distance |" in text and "![compare.png](compare.png)" in text
    assert "Clock offset used: +0.00 ms" in text and "Side length 140 mm" in text
    for name in ("compare.png", "surface_error.png"):
        with Image.open(folder / name) as image:
            pixels = np.asarray(image.convert("RGB"))
            assert image.width > 900 and len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200


@pytest.mark.slow
def test_the_pictures_are_printed_as_asked(ldcs, bags, tmp_path):
    words = ("compare", *bags, "-o", tmp_path / "report", "--format", "pdf", "--width", "column")
    assert ldcs(*words).status == 0
    written = {path.name for path in (tmp_path / "report").iterdir()}
    assert written == {"compare.md", "compare.pdf", "surface_error.pdf"}
    text = (tmp_path / "report" / "compare.md").read_text()
    # A viewer of Markdown shows no PDF.
    assert "[compare.pdf](compare.pdf)" in text and "![compare.pdf]" not in text


def test_the_json_says_what_the_report_says(ldcs, bags, tmp_path):
    report = json.loads(ldcs("compare", *bags, "-o", tmp_path / "report", "--json").out)
    p1 = report["channels"]["P1"]
    assert p1["unit"] == "m" and set(p1["figures"]) == {"x", "y", "z", "distance"}
    assert 0.0 < p1["figures"]["distance"]["rms"] <= p1["figures"]["distance"]["max"] < 0.05
    assert report["surface"]["figures"]["max"] >= p1["figures"]["distance"]["max"] * 0.9
    assert p1["figures"]["z"]["normalised_rms"] == pytest.approx(p1["figures"]["z"]["rms"] / 0.14)
    assert report["offset"]["value"] == 0.0 and report["passed"] and len(report["files"]) == 3


@pytest.mark.parametrize(("limit", "status"), [("0.05", 0), ("1.0e-6", 1)])
def test_the_status_says_whether_the_limits_are_kept(ldcs, bags, tmp_path, limit, status):
    (tmp_path / "limits.yaml").write_text(f"P1: {{max: {limit}}}\nsurface: {{rms: 0.1}}\n")
    outcome = ldcs("compare", *bags, "--tolerances", tmp_path / "limits.yaml", "-o", tmp_path / "report")
    assert outcome.status == status
    assert ("FAILED" in outcome.out) == (status == 1)
    assert f"{2 - status} of 2 limits kept" in (tmp_path / "report" / "compare.md").read_text()


def test_a_bag_compared_with_itself_has_no_difference(ldcs, bags, tmp_path):
    (tmp_path / "limits.yaml").write_text('"*": {max: 0}\n')
    words = ("compare", bags[0], bags[0], "--tolerances", tmp_path / "limits.yaml", "-o", tmp_path / "report")
    assert ldcs(*words).status == 0


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["light"], "B"),
        (["light", "none"], "no bag at"),
        (["light", "heavy", "--offset", "soon"], "offset is 'soon'"),
        (["light", "heavy", "--tolerances", "limits.yaml"], "cannot read the tolerance file"),
        (["light", "heavy", "--tolerances", "other.yaml"], "fits no channel"),
        (["light", "heavy", "--map-b", "other.yaml"], "unknown key 'P9'"),
        (["light", "heavy", "--side-length", "-1"], "length"),
    ],
)
def test_bad_input_is_said_in_one_line(refused, bags, tmp_path, monkeypatch, words, reason):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.yaml").write_text("P9: {max: 1}\n")
    assert reason in refused("compare", *words)
    assert not (tmp_path / "light_vs_heavy").exists()
