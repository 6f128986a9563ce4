"""Message types as a bag defines them, by name; those that it does not define are taken from ROS 2 Kilted."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ldcs_ros.bags.limits import LARGEST_DEFINITION
from ldcs_ros.bags.schemas import Schemas
from ldcs_ros.bags.storage import Definition
from ldcs_ros.errors import RecordingError, one_line

if TYPE_CHECKING:
    from rosbags.interfaces.typing import BaseDesc, FieldDesc, NameDesc, Typesdict

MOST_FIELDS = 20_000
"""Fields of a type with all nested ones, each element of a fixed array of texts or messages counted."""
_SEPARATOR = "=" * 80 + "\n"


class BagTypes:
    """The decoder of a bag's messages; it reads a definition at the first message of its type.

    Args:
        name: The bag, for errors.
        definitions: Message type -> the definitions that its channels carry.
    """

    def __init__(self, name: str, definitions: Mapping[str, Iterable[Definition]]) -> None:
        self._name = name
        self._definitions = definitions
        self._known = Schemas().typestore
        self._stores: dict[str, Typestore] = {}

    def deserialize_cdr(self, rawdata: bytes, typename: str, /) -> object:
        """Return the message object.

        Raises:
            RecordingError: The bag defines the type in a way that cannot be read, or in two ways, or not at all.
        """
        store = self._stores.get(typename)
        if store is None:
            store = self._stores[typename] = self._store(typename)
        return store.deserialize_cdr(rawdata, typename)

    def _store(self, typename: str) -> Typestore:
        given = [one for one in self._definitions.get(typename, ()) if one.encoding]
        if typename in self._known.fielddefs:  # some recorders name an encoding, and have no text
            given = [one for one in given if one.text.strip()]
        if not given:
            if typename not in self._known.fielddefs:
                raise RecordingError(f"{self._name} does not define the message type {typename}")
            return self._known
        try:
            types = self._read(typename, given[0])
            if any(self._read(typename, other) != types for other in given[1:]):
                raise ValueError("the bag defines it in two ways")
            missing = _nested(types) - types.keys()
            types.update({name: self._known.fielddefs[name] for name in missing})
            if all(self._known.fielddefs.get(name) == fields for name, fields in types.items()):
                return self._known
            _check_size(types)
            store = get_typestore(Stores.EMPTY)
            store.register(types)
            return store
        except Exception as error:  # the parser, and the code made from a definition, fail in many ways
            raise RecordingError(
                f"{self._name}: the definition of {typename} cannot be read: {one_line(error)[:200]}"
            ) from error

    def _read(self, typename: str, definition: Definition) -> Typesdict:
        if len(definition.text) > LARGEST_DEFINITION:
            raise ValueError(f"got {len(definition.text)} characters, expected at most {LARGEST_DEFINITION}")
        types: Typesdict = {}
        if definition.encoding == "ros2msg":
            types.update(get_types_from_msg(definition.text, typename))
        elif definition.text.startswith(f"{_SEPARATOR}IDL: "):
            for section in definition.text.split(_SEPARATOR)[1:]:
                types.update(_types_from_idl(section.partition("\n")[2]))
        else:
            for section in definition.text.split(_SEPARATOR):
                types.update(_types_from_idl(re.sub(r"\AIDL: .*\n", "", section)))
        if typename not in types:
            raise ValueError(f"it defines {sorted(types)[:5]} instead")
        return types


def _types_from_idl(text: str) -> Typesdict:
    # The parser knows no preprocessor; the included types are sections of their own, or known.
    return get_types_from_idl(re.sub(r"(?m)^[ \t]*#.*$", "", text))


def _inner(field: FieldDesc) -> tuple[BaseDesc | NameDesc, int]:
    """Return the type of a field's elements, and how many of them a message has at least."""
    if field[0] == Nodetype.ARRAY:
        return field[1]
    if field[0] == Nodetype.SEQUENCE:
        return field[1][0], 1
    return field, 1


def _nested(types: Typesdict) -> set[str]:
    inner = (_inner(field)[0] for _, fields in types.values() for _, field in fields)
    return {str(content) for kind, content in inner if kind == Nodetype.NAME}


def _check_size(types: Typesdict) -> None:
    """Refuse types that contain themselves, or unfold to code without bounds."""
    sizes: dict[str, int] = {}
    open_types: set[str] = set()

    def size(name: str) -> int:
        if name in open_types:
            raise ValueError(f"{name} contains itself")
        if name not in sizes:
            open_types.add(name)
            total = 1
            for _, field in types[name][1]:
                inner, count = _inner(field)
                if inner[0] == Nodetype.NAME:
                    total += count * size(inner[1])
                else:
                    total += count if inner[1][0] in ("string", "wstring") else 1
                if total > MOST_FIELDS:
                    raise ValueError(f"{name} has more than {MOST_FIELDS} fields")
            open_types.remove(name)
            sizes[name] = total
        return sizes[name]

    for name in types:
        size(name)
