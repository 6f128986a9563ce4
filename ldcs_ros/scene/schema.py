"""The scene keys: each block checked key by key, with errors that name the path."""

from __future__ import annotations

import dataclasses
import math
import os
import warnings
from typing import TYPE_CHECKING, Any

from ldcs_ros.errors import SceneError
from ldcs_ros.integrators.settings import Solver
from ldcs_ros.physics.effects import EFFECTS, effect_class
from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.placed_arms import PlacedArm
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.physics.shapes import Disc, PlaneShape, Polygon, Rectangle, SheetRegion
from ldcs_ros.schema.checks import Checks
from ldcs_ros.schema.fields import as_location, did_you_mean, shown
from ldcs_ros.schema.units import MAX_ARMS
from ldcs_ros.sensors import PressureSensorParameters, TrackerParameters

if TYPE_CHECKING:
    from ldcs_ros.physics.material import Material

TOP_KEYS = ("title", "lattice", "material", "points", "effects", "inputs", "sensors", "solver")
MOST_NODES = 1000  # along one side
MOST_MEMORY = min(16e9, float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")))
"""Memory that the nodes of a scene may take [B]: that of the machine, or less."""
USUAL_SIDES = (1e-3, 10.0)
"""Sides of a sheet that are plausible in metres [m]; others are probably in millimetres."""
HOLE_SHAPES = ("box", "circle", "polygon")
# Effects that a scene may name more than once.
REPEATABLE = ("clamp", "force", "payload")

SENSORS: dict[str, type] = {"tracker": TrackerParameters, "pressure": PressureSensorParameters}
CHECKS = Checks(SceneError)


def check_material(value: object, path: str) -> Material:
    """Return the material of `material: {youngs_modulus, poisson, density}`."""
    from ldcs_ros.physics.material import Material

    return Material(**CHECKS.declared(Material, value, path))


def check_lattice(value: object, material: Material | None, path: str) -> Lattice:
    """Return the lattice of `lattice: {size, nodes, mass}`; a material has a density, and no mass is named."""
    required = ("size", "nodes") if material else ("size", "nodes", "mass")
    if material and isinstance(value, dict) and "mass" in value:
        raise SceneError(f"a material has a density already; drop the mass @ {path}.mass")
    block = CHECKS.keys(value, (*required, "holes", "regions"), path, required=required)
    size = CHECKS.numbers(block["size"], 3, f"{path}.size", unit="m", low=1e-6)
    nodes = block["nodes"]
    if (
        not isinstance(nodes, (list, tuple))
        or len(nodes) != 2
        or any(isinstance(n, bool) or not isinstance(n, int) or not 2 <= n <= MOST_NODES for n in nodes)
    ):
        raise SceneError(
            f"got {shown(nodes)}, expected two whole numbers of 2 ... {MOST_NODES} nodes @ {path}.nodes"
        )
    shape = (size[0], size[1], size[2])
    memory = _memory(2 * nodes[0] * nodes[1])
    if memory > MOST_MEMORY:
        raise SceneError(
            f"got {shown(nodes)} nodes, which take about {memory / 1e9:.0f} GB of memory, "
            f"expected at most {MOST_MEMORY / 1e9:.0f} GB @ {path}.nodes"
        )
    if min(shape[:2]) < USUAL_SIDES[0] or max(shape) > USUAL_SIDES[1]:
        warnings.warn(f"a sheet of {shown(size)} m; sizes are in metres @ {path}.size", stacklevel=1)
    holes = tuple(
        _check_shape(hole, (), f"{path}.holes[{k}]")
        for k, hole in enumerate(CHECKS.items(block.get("holes", []), f"{path}.holes"))
    )
    regions = tuple(
        _check_region(region, f"{path}.regions[{k}]")
        for k, region in enumerate(CHECKS.items(block.get("regions", []), f"{path}.regions"))
    )
    if material:
        mass = material.mass(shape)
    else:
        mass = CHECKS.number(block["mass"], f"{path}.mass", low=1e-9, high=1e6, unit="kg")
    lattice = Lattice(shape, (nodes[0], nodes[1]), mass, material is not None, holes, regions)
    if holes:
        with CHECKS.at(path):
            _ = lattice.missing
    return lattice


def _memory(count: int) -> float:
    """Return the memory of a number of nodes [B]: springs, and factors by nested dissection, as measured."""
    return 1400.0 * count * math.log2(count)


def _check_shape(value: object, more: tuple[str, ...], path: str) -> PlaneShape:
    """Return the shape of `{box: [...]}`, `{circle: [...]}` or `{polygon: [...]}`."""
    block = CHECKS.keys(value, (*HOLE_SHAPES, *more), path)
    given = [name for name in HOLE_SHAPES if name in block]
    if len(given) != 1:
        CHECKS.refuse(value, f"one of {list(HOLE_SHAPES)}", path)
    place, where = block[given[0]], f"{path}.{given[0]}"
    if given[0] == "box":
        x0, y0, x1, y1 = CHECKS.numbers(place, 4, where, unit="m")
        if x0 == x1 or y0 == y1:
            CHECKS.refuse(place, "two opposite corners of a rectangle, [x0, y0, x1, y1]", where)
        return Rectangle((x0, y0, x1, y1))
    if given[0] == "circle":
        x, y, radius = CHECKS.numbers(place, 3, where, unit="m")
        if radius <= 0.0:
            CHECKS.refuse(place, "[x, y, radius] with a radius above 0", where)
        return Disc((x, y), radius)
    corners = [
        CHECKS.numbers(one, 2, f"{where}[{k}]", unit="m") for k, one in enumerate(CHECKS.items(place, where))
    ]
    if len(corners) < 3:
        CHECKS.refuse(place, "at least three corners [x, y]", where)
    polygon = Polygon(tuple((x, y) for x, y in corners))
    if (crossing := polygon.crossing()) is not None:
        x, y = crossing
        CHECKS.refuse(place, f"an outline that does not meet itself as at [{x:.6g}, {y:.6g}]", where)
    return polygon


def _check_region(value: object, path: str) -> SheetRegion:
    """Return a region: a shape and factors."""
    factors = ("stiffness", "damping", "mass", "thickness")
    shape = _check_shape(value, factors, path)
    block = CHECKS.keys(value, (*HOLE_SHAPES, *factors), path)
    given = {
        name: CHECKS.number(block[name], f"{path}.{name}", low=1e-6, high=1e6)
        for name in factors
        if name in block
    }
    if not given:
        CHECKS.refuse(value, f"a factor out of {list(factors)}", path)
    return SheetRegion(shape, **given)


def check_points(value: object, lattice: Lattice, path: str) -> dict[str, Point]:
    """Return the named points."""
    if not isinstance(value, dict):
        raise SceneError(
            f"got {shown(value)}, expected a mapping of names to [layer, i, j] or {{x, y, layer}} @ {path}"
        )
    points = {}
    for name, place in value.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise SceneError(f"got the name {name!r}, expected letters, digits and underscores @ {path}")
        if name.startswith("node_") or name.endswith("_aligned"):
            raise SceneError(
                f"the name {name!r} is taken by the frames of wrenches; choose another @ {path}.{name}"
            )
        with CHECKS.at(f"{path}.{name}"):
            points[name] = point_at(lattice, as_location(place))
    return points


def check_effects(value: object, lattice: Lattice, points: dict[str, Point], path: str) -> tuple[Effect, ...]:
    """Return the effects, each made from its class's own fields."""
    if not isinstance(value, list):
        raise SceneError(f"got {shown(value)}, expected a list of effects @ {path}")
    effects: list[Effect] = []
    for index, block in enumerate(value):
        where = f"{path}[{index}]"
        if not isinstance(block, dict) or "type" not in block:
            raise SceneError(f"got {shown(block)}, expected a mapping with the key 'type' @ {where}")
        name = block["type"]
        if not isinstance(name, str) or name not in EFFECTS:
            raise SceneError(
                f"unknown effect {shown(name)}; expected one of {sorted(EFFECTS)}."
                f"{did_you_mean(name, EFFECTS)} @ {where}.type"
            )
        if name not in REPEATABLE and any(effect.name == name for effect in effects):
            raise SceneError(f"the effect {name!r} occurs twice; name it once @ {where}.type")
        effects.append(_check_effect(effect_class(name), block, lattice, points, where))
    return tuple(effects)


def _check_effect(
    cls: type, block: dict[str, Any], lattice: Lattice, points: dict[str, Point], path: str
) -> Effect:
    values = {key: value for key, value in block.items() if key != "type"}
    listed = [field.name for field in dataclasses.fields(cls) if "placed_arms" in field.metadata]
    declared = CHECKS.declared(cls, values, path, extra=("type", *listed))
    for key in listed:
        if key in values:
            declared[key] = _check_arms(values[key], lattice, f"{path}.{key}")
    effect: Effect = cls(**declared)
    for field in dataclasses.fields(cls):
        if "location" in field.metadata:
            with CHECKS.at(f"{path}.{field.name}"):
                point_at(lattice, getattr(effect, field.name), points)
    return effect


def _check_arms(value: object, lattice: Lattice, path: str) -> tuple[PlacedArm, ...]:
    """Return the arms of a list."""
    from ldcs_ros.physics.effects.arms import SHARED, Arms

    blocks = CHECKS.items(value, path)
    if not 1 <= len(blocks) <= MAX_ARMS:
        raise SceneError(f"got {len(blocks)} arms, expected 1 ... {MAX_ARMS} @ {path}")
    own_keys = [field.name for field in dataclasses.fields(Arms) if field.name not in SHARED]
    arms: list[PlacedArm] = []
    for index, block in enumerate(blocks):
        where, placed = f"{path}[{index}]", ("name", "from", "to")
        given = CHECKS.keys(block, (*placed, *own_keys), where, required=placed)
        name = given["name"]
        if not isinstance(name, str) or not name.isidentifier():
            CHECKS.refuse(name, "letters, digits and underscores", f"{where}.name")
        if any(arm.name == name for arm in arms):
            raise SceneError(f"the name {name!r} occurs twice; name each arm once @ {where}.name")
        start, end = (CHECKS.numbers(given[key], 2, f"{where}.{key}", unit="m") for key in ("from", "to"))
        for key, place in (("from", start), ("to", end)):
            if not lattice.covers(*place):
                raise SceneError(f"{lattice.outside(*place)} @ {where}.{key}")
        own = {key: item for key, item in given.items() if key not in placed}
        values = CHECKS.declared(Arms, own, where)
        arms.append(PlacedArm(name, (start[0], start[1]), (end[0], end[1]), values))
    return tuple(arms)


def check_inputs(value: object, path: str) -> tuple[ScheduledCommand, ...]:
    """Return the schedule; its values are checked against the effects when the scene is built."""
    if not isinstance(value, list):
        raise SceneError(f"got {shown(value)}, expected a list of commands with a time @ {path}")
    commands: list[ScheduledCommand] = []
    for index, block in enumerate(value):
        where = f"{path}[{index}]"
        CHECKS.keys(block, ("time", "torque", "pressure", "wrench"), where, required=("time",))
        time = CHECKS.number(block["time"], f"{where}.time", low=0.0, unit="s")
        if commands and time < commands[-1].time:
            raise SceneError(
                f"got {time:g} s after {commands[-1].time:g} s, expected times in order @ {where}.time"
            )
        if len(block) == 1:
            raise SceneError(f"nothing is commanded; name torque, pressure or wrench @ {where}")
        wrench = None
        if "wrench" in block:
            part = CHECKS.keys(
                block["wrench"], ("frame", "force", "torque"), f"{where}.wrench", required=("frame",)
            )
            force = CHECKS.numbers(part.get("force", [0.0] * 3), 3, f"{where}.wrench.force", unit="N")
            torque = CHECKS.numbers(part.get("torque", [0.0] * 3), 3, f"{where}.wrench.torque", unit="N m")
            wrench = (str(part["frame"]), (force[0], force[1], force[2]), (torque[0], torque[1], torque[2]))
        commands.append(ScheduledCommand(time, block.get("torque"), block.get("pressure"), wrench))
    return tuple(commands)


def check_sensors(
    value: object, lattice: Lattice, points: dict[str, Point], path: str
) -> dict[str, dict[str, Any]]:
    """Return each sensor's parameters with defaults filled in."""
    block = CHECKS.keys(value, tuple(SENSORS), path)
    sensors: dict[str, dict[str, Any]] = {}
    for name, given in block.items():
        where, cls = f"{path}.{name}", SENSORS[name]
        values: dict[str, Any] = {}
        extra: tuple[str, ...] = ()
        if cls is TrackerParameters:
            extra = ("points",)
            values["points"] = _tracked(given, lattice, points, f"{where}.points")
        given = CHECKS.declared(cls, {} if given is None else given, where, extra=extra)
        for field in dataclasses.fields(cls):
            if field.name not in extra:
                values[field.name] = given.get(field.name, field.default)
        sensors[name] = values
    return sensors


def _tracked(block: object, lattice: Lattice, points: dict[str, Point], path: str) -> tuple[str, ...]:
    tracked = block.get("points", list(points)) if isinstance(block, dict) else list(points)
    if not isinstance(tracked, list) or len(set(map(str, tracked))) != len(tracked):
        CHECKS.refuse(tracked, "a list of different points", path)
    for item in tracked:
        if not isinstance(item, str):
            CHECKS.refuse(item, "the name of a point", path)
        with CHECKS.at(path):
            point_at(lattice, item, points)
    return tuple(tracked)


def check_solver(value: object, path: str) -> Solver:
    """Return the solver: {integrator, accuracy, verify, commands} or {integrator, dt}."""
    block = CHECKS.keys(value, ("integrator", "accuracy", "dt", "verify", "commands"), path)
    accuracy = block.get("accuracy", None if "dt" in block else Solver.accuracy)
    rest = block.get("verify", False), block.get("commands", "auto")
    return Solver(block.get("integrator", "auto"), accuracy, block.get("dt"), *rest)
