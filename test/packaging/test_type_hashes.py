"""Recorded schemas and type hashes follow from the interface package alone, and are what ROS itself computes."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest

from ldcs_ros.bags.schemas import Schemas, own_definitions
from ldcs_ros.messages.topics import TOPICS

ROOT = Path(__file__).resolve().parents[2]
PREFIXES = [Path(p) for p in (sys.prefix, *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(":")))]
TYPES = sorted({topic.type for topic in TOPICS.values()} | set(own_definitions()))


def hashes_of_ros(message_type: str) -> dict[str, str]:
    """Return type -> hash of a type and of all nested in it, as the installed package's own build wrote them."""
    package, kind, name = message_type.split("/")
    for prefix in PREFIXES:
        path = prefix / "share" / package / kind / f"{name}.json"
        if path.is_file():
            hashes = json.loads(path.read_text(encoding="utf-8"))["type_hashes"]
            return {one["type_name"]: one["hash_string"] for one in hashes}
    pytest.skip(f"{package} is not installed with its type descriptions")


@pytest.mark.parametrize("message_type", TYPES)
def test_a_types_hash_is_the_one_that_ros_computes(message_type: str) -> None:
    schemas = Schemas()
    theirs = hashes_of_ros(message_type)
    assert message_type in theirs
    assert {name: schemas[name].type_hash for name in theirs} == theirs


def test_our_definitions_are_the_files_of_the_interface_package() -> None:
    files = sorted((ROOT / "msg_defs" / "msg").glob("*.msg"))
    assert own_definitions() == {f"ldcs_msgs/msg/{path.stem}": path.read_text() for path in files}
    built = (ROOT / "msg_defs" / "CMakeLists.txt").read_text()
    assert all(f'"msg/{path.name}"' in built for path in files)


@pytest.mark.parametrize("message_type", sorted(own_definitions()))
def test_a_recorded_schema_begins_with_the_file_itself(message_type: str) -> None:
    schema = Schemas()[message_type]
    first, *nested = schema.text.split("=" * 80 + "\n")
    assert first == own_definitions()[message_type]
    assert "MSG: std_msgs/Header" in [section.splitlines()[0] for section in nested]
