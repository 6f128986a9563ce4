"""Filters of entities and worlds: regular expressions of names, regions of space, tags.

An expression is a tree of tuples. The part that remains to be matched after a character is a set of such trees, its
partial derivatives (Antimirov 1996). A set has no more trees than the expression has characters once its counts are
written out, so nothing backtracks.
"""

from __future__ import annotations

import string
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Tree = tuple[Any, ...]  # of a kind and, by the kind, characters, counts and further trees

_EMPTY: Tree = ("empty",)
_START: Tree = ("start",)
_END: Tree = ("end",)
_LONGEST = 256
_LARGEST_COUNT = 255
_MOST_CHARACTERS = 1000
_CLASSES = {
    "alpha": string.ascii_letters,
    "digit": string.digits,
    "alnum": string.ascii_letters + string.digits,
    "upper": string.ascii_uppercase,
    "lower": string.ascii_lowercase,
    "space": string.whitespace,
    "blank": " \t",
    "punct": string.punctuation,
    "xdigit": string.hexdigits,
    "print": string.ascii_letters + string.digits + string.punctuation + " ",
    "graph": string.ascii_letters + string.digits + string.punctuation,
    "cntrl": "".join(map(chr, [*range(32), 127])),
}


class NameFilter:
    """A filter of whole names by an expression; an empty one lets every name pass.

    Args:
        expression: POSIX extended regular expression.

    Raises:
        ValueError: It is invalid; the text names the place.
    """

    def __init__(self, expression: str) -> None:
        if len(expression) > _LONGEST:
            raise ValueError(f"filter of {len(expression)} characters, expected at most {_LONGEST}")
        self._everything = not expression
        self._first = frozenset({_Parser(expression).tree()})
        self._next: dict[tuple[frozenset[Tree], str, bool], frozenset[Tree]] = {}

    def matches(self, name: str) -> bool:
        """Return whether the name matches."""
        if self._everything:
            return True
        states = self._first
        for place, character in enumerate(name):
            key = (states, character, place == 0)
            if key not in self._next:
                self._next[key] = frozenset().union(
                    *(_derivatives(tree, character, place == 0) for tree in states)
                )
            states = self._next[key]
        return any(_may_be_empty(tree, start=not name, end=True) for tree in states)


def _may_be_empty(tree: Tree, *, start: bool, end: bool) -> bool:
    # Whether it matches nothing at a place that is the start or the end of the name, or neither.
    kind = tree[0]
    if kind == "sequence":
        return all(_may_be_empty(part, start=start, end=end) for part in tree[1:])
    if kind == "either":
        return any(_may_be_empty(part, start=start, end=end) for part in tree[1:])
    if kind == "repeat":
        return tree[2] == 0 or _may_be_empty(tree[1], start=start, end=end)
    return kind == "empty" or (kind == "start" and start) or (kind == "end" and end)


def _derivatives(tree: Tree, character: str, start: bool) -> frozenset[Tree]:
    # The possible remainders of a tree after a character.
    kind = tree[0]
    if kind == "one":
        return frozenset({_EMPTY}) if (character in tree[1]) != tree[2] else frozenset()
    if kind == "either":
        return frozenset().union(*(_derivatives(part, character, start) for part in tree[1:]))
    if kind == "sequence":
        first, rest = tree[1:]
        remains = frozenset(_sequence(one, rest) for one in _derivatives(first, character, start))
        if _may_be_empty(first, start=start, end=False):
            remains |= _derivatives(rest, character, start)
        return remains
    if kind == "repeat":
        _, part, low, high = tree
        if high == 0:
            return frozenset()
        # Iterations that match nothing here, such as ^ at the start, may come before the one that takes the character.
        least = 0 if _may_be_empty(part, start=start, end=False) else max(low - 1, 0)
        again = ("repeat", part, least, None if high is None else high - 1)
        return frozenset(_sequence(one, again) for one in _derivatives(part, character, start))
    return frozenset()


def _characters(tree: Tree) -> int:
    # Its length with its counts written out.
    kind = tree[0]
    if kind == "repeat":
        _, part, low, high = tree
        return _characters(part) * max(low if high is None else high, 1)
    return sum(map(_characters, tree[1:])) if kind in ("sequence", "either") else 1


def _sequence(first: Tree, rest: Tree) -> Tree:
    if first == _EMPTY:
        return rest
    return first if rest == _EMPTY else ("sequence", first, rest)


class _Parser:
    """Reads an expression by recursive descent."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0

    def tree(self) -> Tree:
        try:
            tree = self._either()
        except RecursionError:
            raise self._error("parentheses nested too deeply") from None
        if self._at < len(self._text):
            raise self._error("')' without '('")
        if _characters(tree) > _MOST_CHARACTERS:
            raise self._error(f"its counts multiply to more than {_MOST_CHARACTERS} characters")
        return tree

    def _either(self) -> Tree:
        branches = [self._branch()]
        while self._take("|"):
            branches.append(self._branch())
        return branches[0] if len(branches) == 1 else ("either", *branches)

    def _branch(self) -> Tree:
        pieces = []
        while self._at < len(self._text) and self._text[self._at] not in "|)":
            pieces.append(self._piece())
        tree = _EMPTY
        for piece in reversed(pieces):
            tree = _sequence(piece, tree)
        return tree

    def _piece(self) -> Tree:
        tree = self._atom()
        while self._at < len(self._text) and self._text[self._at] in "*+?{":
            low, high = self._counts()
            tree = ("repeat", tree, low, high)
        return tree

    def _counts(self) -> tuple[int, int | None]:
        sign = self._next()
        if sign != "{":
            return {"*": (0, None), "+": (1, None), "?": (0, 1)}[sign]
        end = self._text.find("}", self._at)
        low, comma, high = self._text[self._at : end].partition(",")
        counts = [low, *([high] if high else [])]
        if end < 0 or not all(one.isascii() and one.isdigit() for one in counts):
            raise self._error("expected {m}, {m,} or {m,n}")
        least, most = int(counts[0]), int(counts[-1])
        if least > most or most > _LARGEST_COUNT:
            raise self._error(f"expected counts that rise, at most {_LARGEST_COUNT}")
        self._at = end + 1
        return least, None if comma and not high else most

    def _atom(self) -> Tree:
        character = self._next()
        if character == "(":
            tree = self._either()
            if not self._take(")"):
                raise self._error("'(' without ')'")
            return tree
        if character == "[":
            return self._bracket()
        if character in "*+?{":
            raise self._error(f"nothing before {character!r} that it could repeat")
        if character == "\\":
            if self._at == len(self._text):
                raise self._error("nothing after the last backslash")
            return ("one", frozenset({self._next()}), False)
        if character == ".":
            return ("one", frozenset(), True)
        return {"^": _START, "$": _END}.get(character, ("one", frozenset({character}), False))

    def _bracket(self) -> Tree:
        negated = self._take("^")
        members: set[str] = set()
        first = True
        while first or not self._take("]"):
            if self._at == len(self._text):
                raise self._error("'[' without ']'")
            members |= self._members()
            first = False
        return ("one", frozenset(members), negated)

    def _members(self) -> set[str]:
        character = self._next()
        if character == "[" and self._text[self._at : self._at + 1] in (":", ".", "="):
            end = self._text.find(":]", self._at)
            name = self._text[self._at : end] if self._take(":") and end >= 0 else ""
            if name not in _CLASSES:
                raise self._error(f"expected one of the classes [:{':] [:'.join(_CLASSES)}:]")
            self._at = end + 2
            return set(_CLASSES[name])
        ahead = self._text[self._at : self._at + 2]
        if len(ahead) < 2 or ahead[0] != "-" or ahead[1] == "]":
            return {character}
        self._at += 2
        if ord(ahead[1]) < ord(character) or not ahead[1].isascii():
            raise self._error(f"expected a range that rises, of ASCII, got {character}-{ahead[1]}")
        return set(map(chr, range(ord(character), ord(ahead[1]) + 1)))

    def _next(self) -> str:
        self._at += 1
        return self._text[self._at - 1]

    def _take(self, character: str) -> bool:
        taken = self._text.startswith(character, self._at)
        self._at += taken
        return taken

    def _error(self, reason: str) -> ValueError:
        return ValueError(f"filter {self._text!r} is no regular expression: {reason} @ character {self._at}")


Corner = tuple[float, float, float]


class Region(ABC):
    """A closed region of space."""

    @classmethod
    @abstractmethod
    def of(cls, points: Sequence[Corner]) -> Region:
        """Return the region that two points describe; ValueError for what describes none."""

    @abstractmethod
    def intersects(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return which segments meet it, from where they begin and end [m], shape (n, 3); shape (n,)."""


@dataclass(frozen=True)
class Box(Region):
    """An axis-aligned box.

    Attributes:
        low: Its corner with the smallest coordinates [m], shape (3,).
        high: The opposite one [m], shape (3,).
    """

    low: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, points: Sequence[Corner]) -> Box:
        """Return the box between two opposite corners, in any order."""
        corners = _two(points, "a box by two opposite corners")
        return cls(corners.min(axis=0), corners.max(axis=0))

    def intersects(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return which segments meet it, shape (n,): whether the parts inside the three slabs overlap."""
        way = end - begin
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (self.low - begin) / way, (self.high - begin) / way
        # A segment along a slab is in all of it or in none of it.
        inside = (self.low <= begin) & (begin <= self.high)
        enter = np.where(way == 0.0, np.where(inside, -np.inf, np.inf), np.minimum(one, other))
        leave = np.where(way == 0.0, np.where(inside, np.inf, -np.inf), np.maximum(one, other))
        met: np.ndarray = np.maximum(enter.max(axis=1), 0.0) <= np.minimum(leave.min(axis=1), 1.0)
        return met


@dataclass(frozen=True)
class Sphere(Region):
    """A sphere.

    Attributes:
        centre: Its centre [m], shape (3,).
        radius: Its radius [m].
    """

    centre: np.ndarray
    radius: float

    @classmethod
    def of(cls, points: Sequence[Corner]) -> Sphere:
        """Return the sphere by its centre and, in x of the second point, its radius; ValueError for a negative one."""
        centre, second = _two(points, "a sphere by its centre and, in x of the second point, its radius")
        if second[0] < 0.0:
            raise ValueError(f"bounds with a radius of {second[0]:g} m, expected 0 and more")
        return cls(centre, float(second[0]))

    def intersects(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return which segments meet it, shape (n,): whether their nearest points are inside."""
        way = end - begin
        length = np.sum(way**2, axis=1)
        along = np.sum((self.centre - begin) * way, axis=1) / np.where(length > 0.0, length, 1.0)
        nearest = begin + np.clip(along, 0.0, 1.0)[:, None] * way
        met: np.ndarray = np.linalg.norm(nearest - self.centre, axis=1) <= self.radius
        return met


def _two(points: Sequence[Corner], what: str) -> np.ndarray:
    pair = np.array(points, dtype=float)
    if pair.shape != (2, 3) or not np.isfinite(pair).all():
        raise ValueError(f"bounds with {len(points)} points, expected {what}, all finite")
    return pair
