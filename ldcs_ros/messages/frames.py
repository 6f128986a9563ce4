"""Names of the frames: one prefix before all of them keeps several twins in one tf tree apart."""

from __future__ import annotations

from dataclasses import dataclass

from ldcs_ros.errors import CommandError
from ldcs_ros.messages.topics import BASE_FRAME, TRACKER_FRAME


@dataclass(frozen=True)
class Frames:
    """The frames of one twin.

    Attributes:
        prefix: Prefix of each name, such as 'twin1/'; robot_state_publisher has the same.

    Raises:
        CommandError: The prefix begins with a slash, which no frame of tf2 does.
    """

    prefix: str = ""

    def __post_init__(self) -> None:
        if self.prefix.startswith("/"):
            raise CommandError(f"frame prefix {self.prefix!r}: frames of tf2 begin with no '/'; leave it out")

    @property
    def base(self) -> str:
        """Frame of positions and forces."""
        return self.prefix + BASE_FRAME

    @property
    def tracker(self) -> str:
        """Frame in which the tracker's driver reports."""
        return self.prefix + TRACKER_FRAME

    def named(self, name: str) -> str:
        """Return a frame's name for the outside: of a point 'P1', a probe 'trakstar0'."""
        return self.prefix + name

    def local(self, name: str) -> str:
        """Return the name without the prefix, which senders who know of one twin only may leave out."""
        return name.removeprefix(self.prefix)


PLAIN = Frames()
"""Names without a prefix."""
