"""The line protocol of the serial link: ASCII lines `<text>*<checksum>`, as small controllers can speak it.

    rig -> bridge   S <number> <milliseconds> <set-point of each arm> <actual pressure of each arm>
    bridge -> rig   P <number> <set-point of each arm>
    rig -> bridge   A <number> <milliseconds>            taken
    rig -> bridge   E <number> <milliseconds> <reason>   refused

Pressures are decimal, in the unit of the rig file, and follow the order of its arms. With two arms a status
is `S <number> <milliseconds> <set left> <set right> <actual left> <actual right>`; a line with more or fewer
pressures is not taken. Numbers count up, so that a repeated line is noticed; the milliseconds are the rig's
clock. The checksum is the exclusive-or of the bytes before the star, two hex digits, as in NMEA 0183. A rig
vents by itself when no P comes for its own timeout.
"""

from __future__ import annotations

from functools import reduce


def checksum(text: str) -> int:
    """Return the exclusive-or of the text's bytes."""
    return reduce(lambda total, byte: total ^ byte, text.encode("ascii", "replace"), 0)


def line(*fields: object) -> bytes:
    """Return a whole line of fields, with checksum and newline."""
    text = " ".join(f"{field:.3f}" if isinstance(field, float) else str(field) for field in fields)
    return f"{text}*{checksum(text):02X}\n".encode("ascii")


def fields(raw: bytes) -> list[str]:
    """Return the fields of a line without its newline.

    Raises:
        ValueError: It is not whole: no star, a wrong checksum, or not ASCII.
    """
    text, star, digits = raw.decode("ascii").strip().rpartition("*")
    if not star or checksum(text) != int(digits, 16):
        raise ValueError(f"not a whole line: {raw!r}")
    return text.split()


class LineBuffer:
    """Cuts a stream of bytes into lines; keeps what is not yet whole, up to a bound."""

    _LONGEST = 4096

    def __init__(self) -> None:
        self._bytes = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Return the lines that are whole now, without newlines."""
        *lines, self._bytes = (self._bytes + data).split(b"\n")
        self._bytes = self._bytes[-self._LONGEST :]
        return [one for one in lines if one.strip()]
