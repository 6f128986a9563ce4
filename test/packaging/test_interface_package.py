"""The interface package ldcs_msgs, as `make setup` builds it into .venv/."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def what_is_missing() -> list[str]:
    """Return what this machine lacks to build message packages, by the set-up's own judgement."""
    spec = importlib.util.spec_from_file_location("build_messages", ROOT / "tools/build_messages.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    missing: list[str] = module.missing()
    return missing


if Path(sys.prefix) != ROOT / ".venv":
    pytest.skip("only `make setup` builds ldcs_msgs, into .venv/", allow_module_level=True)
if lacks := what_is_missing():
    pytest.skip(f"ldcs_msgs cannot be built here: no {', '.join(lacks)}", allow_module_level=True)


def test_a_lattice_state_keeps_every_bit_through_serialisation() -> None:
    from ldcs_msgs.msg import LatticeState
    from rclpy.serialization import deserialize_message, serialize_message

    position = [0.1 * number for number in range(486)]
    state = LatticeState(nodes_x=9, nodes_y=9, position=position, arms=["left", "right"])
    assert deserialize_message(serialize_message(state), LatticeState) == state


def test_a_value_outside_its_field_is_refused() -> None:
    from ldcs_msgs.msg import ArmCommand

    with pytest.raises(AssertionError):
        ArmCommand(sequence=-1)


def test_the_services_have_requests_and_answers() -> None:
    from ldcs_msgs.srv import ApplyWrench, LoadScene

    assert ApplyWrench.Request(point="P1", frame_id="ldcs_base").wrench.force.z == 0.0
    assert LoadScene.Response(success=True, effects=["springs"]).effects == ["springs"]
