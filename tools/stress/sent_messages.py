"""What the fuzzer sends: commands for every input, each with bytes of its own so that it is found again in a bag."""

from __future__ import annotations

from importlib.util import find_spec
from random import Random

from random_messages import TEXTS, cdr_of, fill, message_of, number, torn

from ldcs_ros.messages.topics import TOPICS

INPUTS = {
    name: topic.type.replace("/msg/", "/")
    for name, topic in TOPICS.items()
    if topic.direction == "in" and find_spec(topic.type.split("/")[0]) is not None
}
JOINTS = [f"{arm}_joint_{link}" for arm in ("left", "right") for link in (1, 2, 3, 4)]


class Sender:
    """Draws commands: sound, of unsound content, and torn.

    Args:
        random: Where everything is drawn from.
    """

    def __init__(self, random: Random) -> None:
        self._random = random
        self._count = 0
        self._sequence = 0

    def start_over(self) -> None:
        """Begin the numbers of arm commands again, as a sender does after a reset."""
        self._sequence = 0

    def draw(self) -> tuple[str, bytes]:
        """Return the next topic and message."""
        topic = self._random.choice(list(INPUTS))
        kind = self._random.random()
        if kind < 0.5:
            return topic, self._cdr(topic, self._sound(topic))
        if kind < 0.85:
            return topic, self._cdr(topic, fill(self._random, message_of(INPUTS[topic])()))
        if kind < 0.995:
            return topic, torn(self._random, self._cdr(topic, self._sound(topic)))
        return topic, self._huge(topic)

    def _cdr(self, topic, message) -> bytes:
        return cdr_of(self._marked(message), TOPICS[topic].type)

    def _marked(self, message):
        # No input reads these fields, so they can carry a number.
        self._count += 1
        if hasattr(message, "header"):
            message.header.stamp.sec, message.header.stamp.nanosec = 0, self._count
        else:
            message.layout.data_offset = self._count
        return message

    def _sound(self, topic):
        random, message = self._random, message_of(INPUTS[topic])()
        if topic == "pressure_command":
            message.data = [random.uniform(0.0, 1.2e5) for _ in range(random.choice((1, 2)))]
        elif topic == "torque_command":
            message.name = random.sample(JOINTS, random.randint(1, 8))
            message.effort = [random.uniform(-0.1, 0.2) for _ in message.name]
        elif topic == "external_wrench":
            message.header.frame_id = random.choice(
                ("P0", "P1", "P1_aligned", "node_top_8_4", "node_bottom_3_2")
            )
            for part in "xyz":
                setattr(
                    message.wrench.force, part, random.uniform(-0.2, 0.2) if random.random() < 0.8 else 0.0
                )
        elif topic == "arm_command":
            self._sequence += random.choice((1, 1, 1, 1, 5, 0))
            message.sequence = self._sequence
            message.arms = random.sample(["left", "right"], random.randint(1, 2))
            message.pressures = [random.uniform(0.0, 1.2e5) for _ in message.arms]
        else:
            fill(random, message, TEXTS)
        return message

    def _huge(self, topic):
        message = message_of(INPUTS[topic])()
        size = self._random.choice((10_000, 100_000))
        for name, kind in message.get_fields_and_field_types().items():
            if kind == "sequence<double>":
                setattr(message, name, [number(self._random)] * size)
            elif kind == "sequence<string>":
                setattr(message, name, ["left"] * size)
        return self._cdr(topic, message)
