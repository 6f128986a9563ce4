"""The material against classical mechanics on coarse meshes; `ldcs validate --mechanics` goes on to finer ones."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.cli.main import main
from ldcs_ros.validate import mechanics


@pytest.fixture(scope="module")
def found():
    return {one.name: one for one in mechanics.benchmarks((5, 9, 17))}


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
    assert -0.06 < found["cantilever under its weight (g / 200): sag of the tip"].errors[17] < 0.0
    assert 0.0 < found["cantilever: lowest natural frequency"].errors[17] < 0.025
    assert -0.02 < found["strip hanging by its end (g / 10): extension"].errors[17] < 0.0


def test_the_clamped_plate_converges_to_the_plates_theory(found):
    one = found["clamped square plate, point load: deflection"]
    errors = list(one.errors.values())
    assert errors[0] > errors[1] > errors[2] > 0.0 and errors[2] < 0.015


def test_the_verb_prints_a_table(found, capsys, monkeypatch):
    monkeypatch.setattr(mechanics, "benchmarks", lambda: iter(found.values()))
    monkeypatch.setattr(mechanics, "MESHES", (5, 9, 17))
    assert main(["validate", "--mechanics"]) == 0
    out = capsys.readouterr().out
    assert (
        "cantilever, tip load 1 E I / L^2" in out and "error at 17 nodes" in out and "Known difference" in out
    )
