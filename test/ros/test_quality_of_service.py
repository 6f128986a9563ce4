"""Overrides of the quality of service: warnings of unknown topics, errors of invalid values."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from ldcs_ros.errors import LdcsError
from ldcs_ros.messages.topics import TOPICS, Topic
from ldcs_ros.ros.common.qos import POLICIES, check_overrides, profile, with_profile


def override_errors(**overrides):
    """Return the errors of overrides of topics in the namespace /ldcs; double underscores mean dots."""
    given = {f"qos_overrides./ldcs/{name.replace('__', '.')}": value for name, value in overrides.items()}
    node = SimpleNamespace(
        given_parameters=lambda: given,
        resolve_topic_name=lambda name: name if name.startswith("/") else f"/ldcs/{name}",
    )
    return check_overrides(node, TOPICS.values())


def test_sound_overrides_are_taken_without_a_word():
    assert not override_errors(
        nodes__publisher__reliability="best_effort",
        nodes__publisher__depth=1,
        torque_command__subscription__history="keep_all",
        joint_states__publisher__durability="transient_local",
    )


def test_a_topic_of_another_node_is_a_warning():
    (warning,) = override_errors(surfice__publisher__depth=5)
    assert warning.endswith("names no topic of this node. Did you mean '/ldcs/surface'?")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("nodes__publisher__reliability", "relable", "expected one of reliable, best_effort"),
        ("nodes__publisher__durability", "persistent", "expected one of volatile, transient_local"),
        ("nodes__publisher__history", 3, "expected one of keep_last, keep_all"),
        ("nodes__publisher__depth", 0, "expected a whole number, 1 ... 100000"),
        ("nodes__publisher__depth", True, "expected a whole number"),
        ("nodes__publisher__depth", 2.0, "expected a whole number"),
        ("nodes__publisher__deadline", 5, f"expected one of {', '.join(POLICIES)}"),
        ("nodes__publisher", 5, "/ldcs/nodes has a publisher here"),
        ("nodes__subscription__depth", 5, "/ldcs/nodes has a publisher here, no subscription"),
        (
            "pressure_command__publisher__depth",
            5,
            "/ldcs/pressure_command has a subscription here, no publisher",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_name_value_and_choice(name, value, expected):
    with pytest.raises(LdcsError) as caught:
        override_errors(**{name: value})
    assert expected in str(caught.value) and name.replace("__", ".") in str(caught.value)


@pytest.mark.parametrize("topic", TOPICS.values(), ids=TOPICS)
def test_the_table_and_its_profile_say_the_same(topic):
    assert with_profile(topic, profile(topic)) == topic


def test_a_queue_without_an_end_is_told_as_one():
    topic = Topic("log", "std_msgs/msg/String", "out", "words", keep_all=True, transient_local=True, depth=7)
    assert with_profile(topic, profile(topic)) == topic
