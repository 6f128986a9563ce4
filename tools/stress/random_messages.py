"""Random messages of any ROS type: sound, odd, wrong and torn ones, drawn from a seeded generator."""

from __future__ import annotations

import re
from importlib import import_module
from random import Random

from rclpy.serialization import serialize_message

from ldcs_ros.messages.cdr import typestore

_ARRAY = re.compile(r"^(?:sequence<(?P<of>[^,>]+)(?:, (?P<bound>\d+))?>|(?P<each>.+)\[(?P<size>\d+)\])$")
_INTEGER = re.compile(r"^(u?)int(\d+)$")

TEXTS = (
    *("", "P0", "P1", "P2", "P1_aligned", "_aligned", "node_top_8_4", "node_top_8_4_aligned", "node_mid_0_0"),
    *("node_top_99_1", "node_top_-1_0", "node_top_8_4_5", "ldcs_base", "world", "map", "trakstar_base"),
    *(
        "left",
        "right",
        "Left",
        "left_joint_1",
        "right_joint_4",
        "left_joint_9",
        "paper",
        "rig",
        "/",
        "~",
        ".",
    ),
    *(
        "../../etc/passwd",
        "%s%n",
        "{}",
        "P1\n",
        " P1",
        "ä ü 漢字",
        "x" * 300,
        "y" * 20_000,
        "nan",
        "0",
        "None",
    ),
)
_ODD = (0.0, -0.0, 1.0, -1.0, 1e-320, 1e-9, 0.14, 1e3, 1e5, 2e5, 1e9, 1e300, 1.7976931348623157e308)
_UNSOUND = (float("nan"), float("inf"), float("-inf"))


def number(random: Random) -> float:
    """Return a number: plain, odd, or none at all."""
    kind = random.random()
    if kind < 0.5:
        return random.gauss(0.0, 10.0 ** random.randint(-3, 6))
    return random.choice(_ODD) * random.choice((1.0, -1.0)) if kind < 0.85 else random.choice(_UNSOUND)


def message_of(kind: str):
    """Return the rclpy class of a field type such as 'std_msgs/Header'."""
    package, _, name = kind.partition("/")
    return getattr(import_module(f"{package}.msg"), name)


def fill(random: Random, message, texts=TEXTS):
    """Fill a message or a request with random values; return it."""
    for name, kind in message.get_fields_and_field_types().items():
        setattr(message, name, _value(random, kind, texts))
    return message


def _value(random: Random, kind: str, texts):
    if array := _ARRAY.match(kind):
        of = array["of"] or array["each"]
        if array["size"]:
            return [_value(random, of, texts) for _ in range(int(array["size"]))]
        size = random.choice((0, 0, 1, 1, 2, 2, 3, 4, 8, 9, 40))
        return [_value(random, of, texts) for _ in range(min(size, int(array["bound"] or size)))]
    if kind == "boolean":
        return random.random() < 0.5
    if kind in ("octet", "byte"):
        return bytes([random.randrange(256)])
    if kind in ("double", "float"):
        value = number(random)
        return value if kind == "double" or not 3e38 < abs(value) < float("inf") else 3e38
    if integer := _INTEGER.match(kind):
        bits = int(integer[2]) - (not integer[1])
        least = 0 if integer[1] else -(2**bits)
        few = random.randrange(0, 12)
        return random.choice((few, few, few, least, 2**bits - 1, random.randrange(least, 2**bits)))
    if kind.startswith(("string", "wstring")):
        bound = re.search(r"<(\d+)>", kind)
        text = random.choice(texts)
        return text[: int(bound[1])] if bound else text
    return fill(random, message_of(kind)(), texts)


def torn(random: Random, cdr: bytes) -> bytes:
    """Damage the bytes of a message: cut, lengthened, with wrong bits, or nothing of it left.

    One byte stays at least: Fast DDS never delivers an empty payload, nor what its sender sends behind it.
    """
    return _torn(random, cdr) or b"\0"


def _torn(random: Random, cdr: bytes) -> bytes:
    kind = random.randrange(6)
    if kind == 0:
        return cdr[: random.randrange(len(cdr) + 1)]
    if kind == 1:
        return cdr + random.randbytes(random.choice((1, 7, 1000)))
    if kind == 2:
        wrong = bytearray(cdr)
        for _ in range(random.randint(1, 8)):
            wrong[random.randrange(len(wrong))] ^= 1 << random.randrange(8)
        return bytes(wrong)
    if kind == 3:
        return random.randbytes(random.choice((0, 1, 3, 4, 5, 50, 500)))
    if kind == 4:
        # A length where one may stand, larger than all there is.
        place = 4 * random.randrange(1, max(2, len(cdr) // 4))
        return cdr[:place] + random.choice((b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f")) + cdr[place + 4 :]
    return cdr[:1] + bytes([random.randrange(256)]) + cdr[2:]


def cdr_of(message, kind: str) -> bytes:
    """Return the bytes of a message as a publisher sends them; rclpy's own end in spare ones."""
    cdr, store = bytes(serialize_message(message)), typestore(kind)
    definition = store.get_msgdef(kind)
    _, end = definition.deserialize_cdr_le(cdr[4:], 0, definition.cls, store)
    return cdr[: 4 + end]
