"""Numbers that may only fall: Any in annotations, private access, and names that the glossary replaces."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PATHS = sorted((ROOT / "ldcs_ros").rglob("*.py"))
TREES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in PATHS}

# The numbers reached; lower them with the code, never raise them.
MAX_ANY = 40
MAX_PRIVATE_ACCESS = 6
MAX_CLASSES_OF_ONE_NAME = 0
MAX_OLD_NAMES = 0
MAX_UNTYPED_CENTRAL = 0

# Public in spite of their underscore: those of named tuples, and the exit without clean-up.
PUBLIC = ("_asdict", "_replace", "_exit")
CENTRAL = ("scene", "simulation", "model", "recording", "twin", "state", "integrator")
# Names of the left column of the glossary that are no words of another meaning in this code.
OLD_NAMES = (
    "take_in", "place_in", "forgetting", "soften", "_coasting", "refuse_wild", "whole_steps",
    "couple", "turning_jacobian", "HeldInputs", "SAME_TIME", "Sensing", "WrenchCourse", "Shown",
    "start_over", "PatchedMessage", "shows_a_sheet", "_Gate", "LiveShow", "Subject", "promise", "promises",
    "Rivals", "Still", "Stuck", "march", "_HANDFUL", "hand_in", "Namesakes", "BagKeeper", "ClockWatch", "NotNow",
    "NotActive", "told", "obstacle", "complaint", "LastStage", "ValveWatch", "Side", "side_of", "Figures", "_leads",
    "NO_ANSWER", "honest", "_DISHONEST", "Heard", "usual_offset", "stabilised", "StandInRig", "Stand", "Speaker",
    "Course", "Outputs", "Mirror", "Watched", "Trail",
    "rest_position", "rest_state", "fill_turns", "turned_vectors", "crosspiece_end", "next_switch", "NO_ENTRIES",
    "WILD", "_fresh", "_live", "Means", "Motions", "turning", "turning_rate", "stairs", "WrenchCourses", "sentinel",
    "deaf", "chores", "_chore", "Periodic", "_turn", "obstacles", "stop_signals", "starved", "corrections", "anew",
    "Intake", "_called_for", "called", "beats", "RawFrame", "take_frames", "valve_watch", "_stand", "stand_in_rig",
    "throttled_log", "TagChoice", "meets", "dress", "sure", "ways", "judgement", "courses", "PatchedMessage",
    "IN_LAYER_SHARE", "END_SHARE", "SHAPES",
)  # fmt: skip


def annotations(tree: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """Yield the name and the annotation of every parameter, return value and attribute."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            arguments = node.args
            extra = [one for one in (arguments.vararg, arguments.kwarg) if one is not None]
            for one in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, *extra):
                if one.annotation is not None:
                    yield one.arg, one.annotation
            if node.returns is not None:
                yield node.name, node.returns
        elif isinstance(node, ast.AnnAssign):
            yield ast.unparse(node.target).split(".")[-1], node.annotation


def holds_any(annotation: ast.expr) -> bool:
    """Return whether an annotation names Any; plain values `dict[str, Any]` of files and JSON are no objects."""
    return "Any" in re.findall(r"\w+", ast.unparse(annotation).replace("dict[str, Any]", ""))


def aliases_of_any(tree: ast.Module) -> dict[str, bool]:
    """Return the names that a file makes of Any, such as `X = list[Any]`, and whether each is nothing but Any."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            found |= {one.asname: True for one in node.names if one.name == "Any" and one.asname}
        elif isinstance(node, ast.ClassDef) and any(ast.unparse(base) == "Any" for base in node.bases):
            found[node.name] = True
        elif (
            isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None and holds_any(node.value)
        ):
            text = re.sub(
                r"typing\.|Optional|Union|NewType|TypeVar|TypeAlias|None|object|'\w+'",
                "",
                ast.unparse(node.value),
            )
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            found[ast.unparse(target)] = re.sub(r"\W", "", text) == "Any"
    return found


def listed(counter: Counter[str]) -> str:
    """Return the counts for a failure."""
    return f"{sum(counter.values())}: " + ", ".join(
        f"{name} {count}" for name, count in counter.most_common(40)
    )


def test_any_in_annotations_becomes_rarer():
    found = Counter()
    for path, tree in TREES.items():
        annotated = sum(holds_any(annotation) for _, annotation in annotations(tree))
        found[str(path.relative_to(ROOT))] = annotated + len(aliases_of_any(tree))
    assert sum(found.values()) <= MAX_ANY, listed(found)


def test_any_has_no_other_name():
    lines = (
        ("X = Any", True),
        ("X = list[Any]", False),
        ("X = Any | None", True),
        ("X = NewType('X', Any)", True),
        ("class X(Any): ...", True),
        ("from typing import Any as X", True),
    )
    assert all(aliases_of_any(ast.parse(line)) == {"X": whole} for line, whole in lines)
    found = {
        path.name: [name for name, whole in aliases_of_any(tree).items() if whole]
        for path, tree in TREES.items()
    }
    assert not any(found.values()), found


def test_a_scene_a_simulation_and_their_like_have_types():
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for path, tree in TREES.items()
        for name, annotation in annotations(tree)
        if name in CENTRAL and ast.unparse(annotation) in ("Any", "Any | None")
    ]
    assert len(found) <= MAX_UNTYPED_CENTRAL, found


def test_private_names_are_used_through_self_only():
    own = {"self", "cls", "other", "super"}
    found = Counter()
    for path, tree in TREES.items():
        classes = {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
        for node in ast.walk(tree):
            if (
                isinstance(node, ast.Attribute)
                and re.fullmatch(r"_[a-z]\w*", node.attr)
                and node.attr not in PUBLIC
            ):
                owner = node.value
                if not (isinstance(owner, ast.Name) and (owner.id in own or owner.id in classes)):
                    found[f"{path.relative_to(ROOT)} {ast.unparse(node)}"] += 1
    assert sum(found.values()) <= MAX_PRIVATE_ACCESS, listed(found)


def test_a_class_name_has_one_meaning():
    where = defaultdict(list)
    for path, tree in TREES.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                where[node.name].append(str(path.relative_to(ROOT)))
    several = {name: files for name, files in where.items() if len(files) > 1}
    assert len(several) <= MAX_CLASSES_OF_ONE_NAME, several


def test_names_that_the_glossary_replaces_disappear():
    found = Counter()
    for tree in TREES.values():
        for node in ast.walk(tree):
            names = [getattr(node, field, None) for field in ("name", "id", "attr", "arg", "asname")]
            found.update(name for name in names if isinstance(name, str) and name in OLD_NAMES)
    assert sum(found.values()) <= MAX_OLD_NAMES, listed(found)
