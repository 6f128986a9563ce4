"""Schemas of messages: the definitions of our own types, and those of ROS 2 by the rosbags type store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from ldcs_ros.errors import RecordingError, one_line

INTERFACE_PACKAGE = "ldcs_msgs"
# A link in a checkout, plain files where the package is installed.
FOLDER = Path(__file__).parents[1] / "msg_defs"


@lru_cache(maxsize=1)
def own_definitions() -> dict[str, str]:
    """Return `ldcs_msgs/msg/Name` -> text of the .msg file, for every message of the interface package."""
    return {
        f"{INTERFACE_PACKAGE}/msg/{path.stem}": path.read_text(encoding="utf-8")
        for path in sorted((FOLDER / "msg").glob("*.msg"))
    }


ROS_DISTRO = "kilted"
"""The distribution whose message definitions are written, as `ros_distro` in the bag."""
_SEPARATOR = "=" * 80 + "\n"


@dataclass(frozen=True)
class Schema:
    """One message type as a bag describes it.

    Attributes:
        type: `package/msg/Name`.
        text: The definition and, after separators, the definitions of all types nested in it.
        type_hash: ROS 2 type hash, `RIHS01_...`.
    """

    type: str
    text: str
    type_hash: str


class Schemas:
    """Message types by name; starts with those of ROS 2 Kilted and of our own interface package."""

    def __init__(self, definitions: Mapping[str, str] | None = None) -> None:
        self.typestore = get_typestore(Stores.ROS2_KILTED)
        self._texts: dict[str, str] = {}
        self.register(own_definitions())
        if definitions:
            self.register(definitions)

    def register(self, definitions: Mapping[str, str]) -> None:
        """Add types from their .msg text, so that schema, hash and code all follow from that one text.

        Args:
            definitions: `package/msg/Name` -> text of the .msg file. Types may nest each other.

        Raises:
            RecordingError: A text that is not a message definition, or another definition of a known type.
        """
        types = {}
        for name, text in definitions.items():
            try:
                types.update(get_types_from_msg(text, name))
            except TypesysError as error:
                raise RecordingError(
                    f"the definition of {name!r} cannot be read: {one_line(error)}"
                ) from error
        try:
            self.typestore.register(types)
        except TypesysError as error:
            raise RecordingError(f"types {sorted(definitions)} cannot be added: {one_line(error)}") from error
        self._texts.update(definitions)

    def __getitem__(self, message_type: str) -> Schema:
        """Return the schema of a type; RecordingError names a missing type."""
        try:
            text, _ = self.typestore.generate_msgdef(message_type, ros_version=2)
            return Schema(
                message_type, self._as_written(message_type, text), self.typestore.hash_rihs01(message_type)
            )
        except (TypesysError, KeyError) as error:
            raise RecordingError(
                f"message type {message_type!r} cannot be recorded: {one_line(error)}; "
                "register the .msg text of it and of the types nested in it"
            ) from error

    def _as_written(self, message_type: str, generated: str) -> str:
        """Return the schema with each registered definition as its author wrote it: comments give the units."""
        first, *nested = generated.split(_SEPARATOR)
        sections = [self._texts.get(message_type, first)]
        for section in nested:
            mark, body = section.split("\n", 1)
            package, name = mark.removeprefix("MSG: ").split("/")
            sections.append(f"{mark}\n{self._texts.get(f'{package}/msg/{name}', body)}")
        return _SEPARATOR.join(text if text.endswith("\n") else f"{text}\n" for text in sections)
