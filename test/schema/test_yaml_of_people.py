"""One reader for every file that a person writes: numbers as people write them, and one line for the rest."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from ldcs_ros import load_scene
from ldcs_ros.compare.tolerances import ToleranceError, load_tolerances
from ldcs_ros.errors import BridgeError, MappingError, SceneError
from ldcs_ros.rig.rig_file import load_rig
from ldcs_ros.schema.reader import MAX_BYTES, MAX_VALUES, plain_values, read_yaml, write_yaml
from ldcs_ros.signals import load_mapping

READERS = {
    "scene": (load_scene, SceneError),
    "mapping": (load_mapping, MappingError),
    "tolerances": (load_tolerances, ToleranceError),
    "rig": (load_rig, BridgeError),
}
INVALID = {
    "key twice": ("a: 1\na: 2\n", "given twice"),
    "key twice, deeper": ("a:\n  - {b: 1, b: 2}\n", "a[0].b"),
    "leading zero": ("port: 0502\n", "without a leading zero"),
    "negative leading zero": ("port: -010\n", "without a leading zero"),
    "timestamp": ("a: !!timestamp 1\n", "!!timestamp"),
    "set": ("a: !!set {b}\n", "!!set"),
    "binary": ("a: !!binary AAAA\n", "!!binary"),
    "python": ("a: !!python/name:os.system\n", "python"),
    "list as a key": ("? [1, 2]\n: 3\n", "as a key"),
    "mapping as a key": ("{{a: 1}: 2}\n", "as a key"),
    "400 digits": (f"a: {'9' * 400}\n", "400 digits"),
    "5000 digits": (f"a: {'9' * 5000}\n", "5000 digits"),
    "nesting": ("a: " + "[" * 3000 + "]" * 3000, "nested too deeply"),
    "alias inside of its value": ("a: &x {b: *x}\n", "alias"),
    "alias of nothing": ("a: *x\n", "alias"),
    "two documents": ("a: 1\n---\nb: 2\n", "second document"),
    "control character": ("a: \x01\n", "not valid YAML"),
    "tab": ("a:\n\t- 1\n", "not valid YAML"),
    "wrong tag": ("a: !!int five\n", "!!int"),
}


def _read(text):
    return read_yaml(text, origin="file.yaml", error=SceneError)


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("case", INVALID)
def test_every_reader_refuses_it_in_one_short_line_of_its_kind(kind, case, tmp_path):
    text, words = INVALID[case]
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    read, error = READERS[kind]
    with pytest.raises(error) as refused:
        read(path)
    message = str(refused.value)
    assert words in message and " @ " in message and "bad.yaml" in message
    assert "\n" not in message and len(message) < 300


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("69.0e3", 69000.0),
        ("69e3", 69000.0),
        ("1e-5", 1e-5),
        ("-.5", -0.5),
        ("5.", 5.0),
        ("+3", 3),
        ("0", 0),
        ("0x1F", 31),
        ("1.0e+3", 1000.0),
        ("00.5", 0.5),
        ("!!float 1", 1.0),
        ("!!str 0502", "0502"),
        ("'0502'", "0502"),
        ("true", True),
        ("null", None),
        ("~", None),
    ],
)
def test_numbers_are_read_as_people_write_them(text, value):
    read = _read(f"a: {text}")["a"]
    assert read == value and type(read) is type(value)


@pytest.mark.parametrize("text", ["1_000", "1:30", "2001-01-01", "2001-99-99", "0o17", "1e", "e5", "1.2.3"])
def test_the_rest_is_text_and_therefore_no_number(text):
    assert _read(f"a: {text}")["a"] == text


def test_infinite_numbers_are_read_and_refused_by_the_field():
    assert _read("a: -.inf")["a"] == -math.inf and math.isnan(_read("a: .nan")["a"])


def test_aliases_are_copies_and_merge_keys_give_way_to_own_keys():
    read = _read("a: &x {b: [1], c: 2}\nd: *x\ne: {<<: *x, c: 3}\n")
    read["a"]["b"].append(9)
    assert read["d"] == {"b": [1], "c": 2} and read["e"] == {"b": [1], "c": 3}


def test_aliases_cannot_multiply_a_small_file_into_a_large_one():
    lines = ["a0: &a0 [" + "1, " * 99 + "1]"]
    lines += [f"a{k}: &a{k} [" + f"*a{k - 1}, " * 99 + f"*a{k - 1}]" for k in range(1, 6)]
    with pytest.raises(SceneError, match=f"more than {MAX_VALUES} values"):
        _read("\n".join(lines))


def test_a_text_that_is_too_large_is_refused_before_it_is_parsed():
    with pytest.raises(SceneError, match=f"expected at most {MAX_BYTES}"):
        _read("# " + "x" * MAX_BYTES)


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False)
    | st.text(st.characters(blacklist_categories=("Cs", "Cc"), max_codepoint=0x2000), max_size=8)
    | st.sampled_from(["1e-5", "0502", "yes", "1_0", "0x1F", "1:30", "~", "<<", "2001-01-01", "=", "1e5"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text("abc0<", max_size=3), inner, max_size=4)
    ),
    max_leaves=12,
)


@given(VALUES)
def test_written_values_are_read_as_the_same_values(value):
    assert _read(write_yaml({"a": value})) == {"a": value}


def test_written_values_mean_the_same_to_other_readers_of_yaml():
    value = {"a": [1.0e-5, "1e-5", 3, None, True, "0502"], "b": "yes"}
    assert yaml.safe_load(write_yaml(value)) == value


def test_numbers_of_numpy_are_plain_numbers_and_objects_are_refused_with_their_place():
    plain = plain_values(
        {"a": (np.float32(0.5), np.int64(3), np.array([1.0, 2.0]))}, origin="x", error=SceneError
    )
    assert plain == {"a": [0.5, 3, [1.0, 2.0]]}
    with pytest.raises(SceneError, match=r"a\[1\].b"):
        plain_values({"a": [0, {"b": object()}]}, origin="x", error=SceneError)
