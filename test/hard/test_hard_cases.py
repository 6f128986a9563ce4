"""Hard cases: every case is well formed; the fast ones end right; nothing that a run shows is not finite."""

from __future__ import annotations

import pickle

import pytest

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
    assert result.outcome == ("refused" if result.case.refusal else "right"), result.note
