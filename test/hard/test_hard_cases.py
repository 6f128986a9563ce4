"""Hard cases: every case is well formed; the fast ones end right; nothing that a run shows is not finite."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from ldcs_ros.study.hard.case import CaseComparison, independent, largest_distance
from ldcs_ros.study.hard.catalogue import CASES, CHAPTERS
from ldcs_ros.study.hard.runner import run_case
from ldcs_ros.study.hard.scenes import STARTS

FAST = [name for name, case in CASES.items() if case.fast]


def test_names_are_unique_and_starts_known():
    assert len(CASES) == sum(len(cases) for cases in CHAPTERS.values())
    assert {case.start for case in CASES.values()} <= {"", *STARTS}


def test_a_case_travels_to_another_process():
    case = next(iter(CASES.values()))
    assert pickle.loads(pickle.dumps(case)) == case


@pytest.mark.parametrize("name", FAST)
def test_a_fast_case_ends_right(name):
    result = run_case(CASES[name])
    expected = {"stopped"} if result.case.refusal else {"within 1", "within 3", "bounded"}
    assert result.outcome in expected, result.note


def test_distances_are_euclidean():
    here, there = np.zeros((2, 3, 3)), np.zeros((2, 3, 3))
    there[1, 2] = 3e-6, 4e-6, 0.0
    assert largest_distance(here, there) == pytest.approx(5e-6)


@pytest.mark.parametrize(("factor", "outcome"), [(0.9, "within 1"), (2.9, "within 3"), (3.1, "missed")])
def test_a_row_is_judged_by_the_asked_accuracy_alone(factor, outcome):
    compared = CaseComparison(factor * 1e-5, "a test")
    case = replace(CASES["lattice [2, 2]"], check=lambda case, run: compared, duration=1e-3)
    assert run_case(case).outcome == outcome


def test_the_catalogue_has_the_ends_of_the_schema_and_instabilities():
    names = " ".join(CASES)
    for words in ("no damping for 60 s", "k = 1e9", "links of 1e-9 kg", "1000 1/m", "64 links", "10000 load cycles"):
        assert words in names, words
    for words in ("snap-through", "lateral buckling", "self-weight", "three_arms", "hole", "half of the sheet"):
        assert words in names, words
    assert sum(case.check is independent for case in CASES.values()) >= 60
