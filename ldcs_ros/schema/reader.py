"""The strict reader of YAML that people write: scenes, rigs, mappings and tolerances.

Keys occur once in a mapping. Numbers are decimal (`69.0e3`, `1e-5`, `-.5`) or hexadecimal (`0x1F`); a whole number
with a leading zero is refused, because YAML versions read it differently. Dates, sets and binary data are no values
of these files. Size, nesting and aliases are bounded. Every error is one line: got, expected @ file: path, line.
"""

from __future__ import annotations

import copy
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np
import yaml

from ldcs_ros.errors import LdcsError, user_path
from ldcs_ros.schema.fields import shown

MAX_BYTES = 1_000_000
MAX_DEPTH = 50
MAX_VALUES = 500_000

_CORE = "tag:yaml.org,2002:"
_TAGS = {f"{_CORE}{name}" for name in ("str", "int", "float", "bool", "null", "map", "seq")}
_WHOLE = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]+")
_HEXADECIMAL = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?\.(inf|Inf|INF)")
_WORDS: dict[str, bool | None] = {"": None, "~": None}
for _word, _value in (("null", None), ("true", True), ("yes", True), ("on", True)):
    _WORDS.update({_word: _value, _word.title(): _value, _word.upper(): _value})
for _word in ("false", "no", "off"):
    _WORDS.update({_word: False, _word.title(): False, _word.upper(): False})


def read_text(path: Path, kind: str, error: type[LdcsError]) -> str:
    """Return the text of a file of at most MAX_BYTES; `kind` names its kind, such as 'mapping file'.

    Raises:
        LdcsError: The file cannot be read, is too large or is not UTF-8 text; the class is `error`.
    """
    try:
        path = user_path(path)
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise error(f"cannot read the {kind} {str(path)!r}: it is no regular file")
        if status.st_size > MAX_BYTES:
            raise error(f"got {status.st_size} bytes, expected a {kind} of at most {MAX_BYTES} @ {path}")
        return path.read_text(encoding="utf-8")
    except OSError as reason:
        raise error(f"cannot read the {kind} {str(path)!r}: {reason.strerror}") from reason
    except UnicodeDecodeError as reason:
        raise error(f"cannot read the {kind} {str(path)!r}: not UTF-8 text") from reason


def read_yaml(text: str, *, origin: str, error: type[LdcsError]) -> object:
    """Return the content of YAML text as dicts, lists, texts, numbers, truth values and None.

    >>> read_yaml("mass: 69.0e-3", origin="my.yaml", error=LdcsError)
    {'mass': 0.069}

    Args:
        text: YAML of one document.
        origin: Name of the source in errors.
        error: Class of the errors.

    Raises:
        LdcsError: The text is not valid YAML, or breaks a rule of the module's docstring.
    """
    if len(text) > MAX_BYTES:
        raise error(f"got {len(text)} characters, expected at most {MAX_BYTES} @ {origin}")
    try:
        return _Builder(yaml.parse(text, Loader=yaml.SafeLoader), origin, error).document()
    except yaml.YAMLError as reason:
        mark = getattr(reason, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        problem = getattr(reason, "problem", None) or getattr(reason, "reason", None) or "unreadable"
        raise error(f"not valid YAML: {' '.join(str(problem).split())} @ {origin}{where}") from reason


def write_yaml(content: object, *, width: int | None = None, flow: bool | None = False) -> str:
    """Return plain values as YAML text that `read_yaml` reads to the same values; keys stay in order.

    Args:
        content: Plain values, such as those of `plain_values`.
        width: Longest line; None for the library's default.
        flow: True or False for all containers in flow or block style, None for flow in the innermost ones.
    """
    text = yaml.dump(
        content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=flow, width=width
    )
    return str(text)


def plain_values(content: object, *, origin: str, error: type[LdcsError]) -> object:
    """Return a copy of a program's values as `read_yaml` would give them: tuples as lists, NumPy as numbers.

    Raises:
        LdcsError: A value contains itself or is nested too deeply; the class is `error`.
    """

    def plain(value: object, path: str, depth: int) -> object:
        if depth > MAX_DEPTH:
            raise error(f"got a value that contains itself, or nesting above {MAX_DEPTH} @ {origin}")
        if isinstance(value, (np.generic, np.ndarray)):
            value = value.tolist()
        if isinstance(value, dict):
            return {
                key: plain(item, f"{path}.{key}" if path else str(key), depth + 1)
                for key, item in value.items()
            }
        if isinstance(value, (list, tuple)):
            return [plain(item, f"{path}[{k}]", depth + 1) for k, item in enumerate(value)]
        if value is not None and not isinstance(value, (str, bool, int, float)):
            raise error(
                f"got {shown(value)}, expected a number, text, a list or a mapping @ {path or origin}"
            )
        return value

    return plain(content, "", 0)


@dataclass
class _Builder:
    """Values from the events of a YAML parser, with the path of each for errors.

    Attributes:
        events: Events of one stream.
        origin: Name of the source.
        error: Class of the errors.
        count: Values so far; an alias counts as the values that it repeats.
        anchors: Finished values by anchor, each with its count.
    """

    events: Iterator[yaml.Event]
    origin: str
    error: type[LdcsError]
    count: int = 0
    anchors: dict[str, tuple[object, int]] = field(default_factory=dict)

    def document(self) -> object:
        content: object = None
        documents = 0
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    self.refuse("got a second document, expected one", "", event)
                content = self.value(next(self.events), "", 0)
        return content

    def value(self, event: yaml.Event, path: str, depth: int) -> object:
        before = self.count
        self.add(1, path, event)
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self.anchors:
                self.refuse(f"got the alias *{event.anchor}, expected an anchor before it", path, event)
            repeated, count = self.anchors[event.anchor]
            self.add(count, path, event)
            return copy.deepcopy(repeated)
        if event.tag not in (None, "!") and event.tag not in _TAGS:
            tag = event.tag.replace(_CORE, "!!")
            self.refuse(f"got a value of the type {shown(tag)}, expected a number or text", path, event)
        if depth > MAX_DEPTH:
            self.refuse(f"nested too deeply; expected at most {MAX_DEPTH} levels", path, event)
        value: object
        if isinstance(event, yaml.MappingStartEvent):
            value = self.mapping(path, depth)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = self.sequence(path, depth)
        else:
            value = self.scalar(event, path)
        if event.anchor is not None:
            self.anchors[event.anchor] = value, self.count - before
        return value

    def sequence(self, path: str, depth: int) -> list[object]:
        values: list[object] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            values.append(self.value(event, f"{path}[{len(values)}]", depth + 1))
        return values

    def mapping(self, path: str, depth: int) -> dict[object, object]:
        mapping: dict[object, object] = {}
        merged: dict[object, object] = {}
        seen: set[str] = set()
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                self.refuse("got a list, a mapping or an alias as a key, expected text", path, event)
            key = self.value(event, path, depth + 1)
            place = f"{path}.{event.value[:60]}" if path else event.value[:60]
            if str(key) in seen:
                self.refuse(f"the key {shown(event.value)} is given twice; leave one of them", place, event)
            seen.add(str(key))
            value = self.value(next(self.events), place, depth + 1)
            if key == "<<" and event.implicit[0]:
                parts = value if isinstance(value, list) else [value]
                for part in parts:
                    if not isinstance(part, dict):
                        self.refuse(f"got {shown(part)}, expected a mapping to merge", place, event)
                    merged = {**part, **merged}
            else:
                mapping[key] = value
        return {**merged, **mapping}

    def scalar(self, event: yaml.ScalarEvent, path: str) -> object:
        text: str = event.value
        asked = None if event.tag in (None, "!") else event.tag.removeprefix(_CORE)
        if asked == "str" or (asked is None and not event.implicit[0]):
            return text
        if asked in ("map", "seq"):
            self.refuse(f"got {shown(text)}, expected the type !!{asked}", path, event)
        value: object = text
        if text in _WORDS:
            value = _WORDS[text]
        elif _LEADING_ZERO.fullmatch(text):
            self.refuse(
                f"got {shown(text)[1:-1]}, expected a number without a leading zero, or text in quotes",
                path,
                event,
            )
        elif _WHOLE.fullmatch(text) or _HEXADECIMAL.fullmatch(text):
            value = int(text, 0) if len(text) <= 20 else None
            if value is None or not -(2**63) <= value < 2**64:
                self.refuse(
                    f"got a whole number of {len(text)} digits, expected at most 64 bits", path, event
                )
        elif _FLOAT.fullmatch(text):
            value = float(text)
        elif _INFINITY.fullmatch(text) or text in (".nan", ".NaN", ".NAN"):
            value = float(text.replace(".", ""))
        if asked == "float" and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        kind = {bool: "bool", int: "int", float: "float", type(None): "null"}.get(type(value), "str")
        if asked is not None and asked != kind:
            self.refuse(f"got {shown(text)}, expected the type !!{asked}", path, event)
        return value

    def add(self, count: int, path: str, event: yaml.Event) -> None:
        self.count += count
        if self.count > MAX_VALUES:
            self.refuse(f"got more than {MAX_VALUES} values, aliases included", path, event)

    def refuse(self, problem: str, path: str, event: yaml.Event) -> NoReturn:
        place = " ".join(path.split())
        place = place if len(place) <= 120 else f"{place[:117]}..."
        where = f": {place}" if place else ""
        raise self.error(f"{problem} @ {self.origin}{where}, line {event.start_mark.line + 1}")


# The C library's takes a tenth of the time.
_BaseDumper: type = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _Dumper(_BaseDumper):  # type: ignore[misc]  # the library has no types
    """A writer without anchors that quotes each text which `read_yaml` would take for a number."""

    def ignore_aliases(self, data: object) -> bool:
        return True


_Dumper.add_implicit_resolver(f"{_CORE}float", re.compile(f"^(?:{_FLOAT.pattern})$"), list("-+.0123456789"))
