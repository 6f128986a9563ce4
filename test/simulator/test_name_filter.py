"""Names chosen by a POSIX extended regular expression."""

from __future__ import annotations

import re
import time

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ldcs_ros.ros.simulator.filters import NameFilter

NAMES = ["P0", "P1", "left_link_1", "node_top_8_4", "node_bottom_10_12", ""]


@pytest.mark.parametrize(
    ("expression", "chosen"),
    [
        ("", NAMES),
        ("P1", ["P1"]),
        ("P", []),
        ("P[01]", ["P0", "P1"]),
        ("^P[[:digit:]]$", ["P0", "P1"]),
        ("P0|.*_link_.+", ["P0", "left_link_1"]),
        ("node_(top|bottom)(_[0-9]{1,2}){2}", ["node_top_8_4", "node_bottom_10_12"]),
        ("node_[^b].*", ["node_top_8_4"]),
        ("(node_top_8_4|)", ["node_top_8_4", ""]),
        ("P\\.", []),
    ],
)
def test_a_filter_chooses_whole_names(expression, chosen):
    assert [name for name in NAMES if NameFilter(expression).matches(name)] == chosen


@pytest.mark.parametrize(
    "expression",
    [
        "(",
        ")",
        "*",
        "a{",
        "a{3,2}",
        "a{999}",
        "[a",
        "[z-a]",
        "[[:word:]]",
        "\\",
        "(" * 250,
        "a" * 300,
        "(a{99}){99}",
    ],
)
def test_what_is_no_expression_is_refused_in_a_line(expression):
    with pytest.raises(ValueError, match="filter"):
        NameFilter(expression)


def test_an_expression_made_to_trap_a_matcher_takes_no_longer_than_another():
    began = time.perf_counter()
    for trap in ("((((a*)*)*)*)*b", "(a|a|aa)*b", "(.*)*(.*)*(.*)*b", "((a{1,9}){1,9}){1,9}b"):
        assert not NameFilter(trap).matches("a" * 60)
    assert time.perf_counter() - began < 10.0


ATOMS = st.sampled_from(["a", "b", ".", "[ab]", "[^a]", "[a-c]", "^", "$"])
EXPRESSIONS = st.recursive(
    ATOMS,
    lambda inner: st.one_of(
        st.tuples(inner, inner).map("".join),
        st.tuples(inner, inner).map(lambda two: f"({two[0]}|{two[1]})"),
        st.tuples(inner, st.sampled_from(["*", "+", "?", "{2}", "{1,2}", "{1,}"])).map(
            lambda two: f"({two[0]}){two[1]}"
        ),
    ),
    max_leaves=6,
)


@settings(max_examples=300, deadline=None)
@given(EXPRESSIONS, st.text("abc", max_size=6))
@example("((a|^)){2}b", "ab")
def test_it_agrees_with_another_matcher(expression, name):
    # That one knows \Z for the end of the text; its own $ also matches before a last newline.
    expected = re.fullmatch(expression.replace("$", r"\Z"), name) is not None
    assert NameFilter(expression).matches(name) == expected
