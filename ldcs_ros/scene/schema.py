"""The scene keys: each block checked key by key, with errors that name the path."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ldcs_ros.errors import SceneError
from ldcs_ros.integrators import INTEGRATORS
from ldcs_ros.physics.effects import EFFECTS, effect_class
from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.material import Material
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.scene.scene import Solver
from ldcs_ros.schema.fields import check_choice, check_number, did_you_mean

TOP_KEYS = ("title", "lattice", "material", "points", "effects", "inputs", "sensors", "solver")
MOST_NODES = 1000  # along one side: a memory limit, far above what is useful
# Effects that a scene may name more than once.
REPEATABLE = ("clamp", "force", "payload")

# Sensors by name: key -> (default, low, high, unit). 'points' is checked apart.
SENSORS: dict[str, dict[str, tuple[float, float, float, str]]] = {
    "tracker": {
        "rate": (80.0, 1e-3, 1e4, "Hz"),
        "delay": (0.0, 0.0, 10.0, "s"),
        "noise": (1.0e-4, 0.0, 1.0, "m"),
        "quantum": (2.8e-5, 0.0, 1.0, "m"),
        "seed": (1, 0, 2**63 - 1, ""),
    },
    "pressure": {
        "rate": (100.0, 1e-3, 1e4, "Hz"),
        "noise": (0.0, 0.0, 1e6, "Pa"),
        "seed": (2, 0, 2**63 - 1, ""),
    },
}


def check_mapping(
    value: Any, keys: tuple[str, ...], path: str, *, required: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return a mapping whose keys are all known; SceneError names the first that is not, or is missing."""
    if not isinstance(value, dict):
        raise SceneError(
            f"got {_shown(value)}, expected a mapping with keys out of {list(keys)} @ {path or 'the scene'}"
        )
    where = f"{path}." if path else ""
    for key in value:
        if key not in keys:
            raise SceneError(
                f"unknown key {key!r}; expected one of {list(keys)}.{did_you_mean(key, keys)} @ {where}{key}"
            )
    for key in required:
        if key not in value:
            raise SceneError(f"missing key {key!r} @ {path or 'the scene'}")
    return value


def check_scalar(
    value: Any, path: str, *, low: float = -math.inf, high: float = math.inf, unit: str = ""
) -> float:
    """Return a finite number within its bounds."""
    field = dataclasses.field(metadata={"unit": unit, "low": low, "high": high, "length": None})
    with _at(path):
        return float(check_number(value, field))


def check_vector(
    value: Any, length: int, path: str, *, unit: str = "", low: float = -math.inf
) -> tuple[float, ...]:
    """Return a tuple of finite numbers."""
    if not isinstance(value, (list, tuple)) or len(value) != length:
        raise SceneError(f"got {_shown(value)}, expected a list of {length} numbers [{unit}] @ {path}")
    return tuple(check_scalar(item, f"{path}[{i}]", low=low, unit=unit) for i, item in enumerate(value))


def check_material(value: Any, path: str) -> Material:
    """Return the material of `material: {youngs_modulus, poisson, density}`."""
    return Material(**_checked_fields(Material, value, path))


def check_lattice(value: Any, material: Material | None, path: str) -> Lattice:
    """Return the lattice of `lattice: {size, nodes, mass}`; a material has a density, and no mass is named."""
    keys = ("size", "nodes") if material else ("size", "nodes", "mass")
    if material and isinstance(value, dict) and "mass" in value:
        raise SceneError(f"a material has a density already; drop the mass @ {path}.mass")
    block = check_mapping(value, keys, path, required=keys)
    size = check_vector(block["size"], 3, f"{path}.size", unit="m", low=1e-6)
    nodes = block["nodes"]
    if (
        not isinstance(nodes, (list, tuple))
        or len(nodes) != 2
        or any(isinstance(n, bool) or not isinstance(n, int) or not 2 <= n <= MOST_NODES for n in nodes)
    ):
        raise SceneError(
            f"got {_shown(nodes)}, expected two whole numbers of 2 ... {MOST_NODES} nodes @ {path}.nodes"
        )
    shape = (size[0], size[1], size[2])
    if material:
        return Lattice(shape, (nodes[0], nodes[1]), material.mass(shape), mass_by_area=True)
    mass = check_scalar(block["mass"], f"{path}.mass", low=1e-9, high=1e6, unit="kg")
    return Lattice(shape, (nodes[0], nodes[1]), mass)


def check_points(value: Any, lattice: Lattice, path: str) -> dict[str, Point]:
    """Return the named points."""
    if not isinstance(value, dict):
        raise SceneError(f"got {_shown(value)}, expected a mapping of names to [layer, i, j] @ {path}")
    points = {}
    for name, place in value.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise SceneError(f"got the name {name!r}, expected letters, digits and underscores @ {path}")
        if name.startswith("node_") or name.endswith("_aligned"):
            raise SceneError(
                f"the name {name!r} is taken by the frames of wrenches; choose another @ {path}.{name}"
            )
        with _at(f"{path}.{name}"):
            points[name] = point_at(lattice, place)
    return points


def check_effects(value: Any, lattice: Lattice, points: dict[str, Point], path: str) -> tuple[Effect, ...]:
    """Return the effects, each made from its class's own fields."""
    if not isinstance(value, list):
        raise SceneError(f"got {_shown(value)}, expected a list of effects @ {path}")
    effects: list[Effect] = []
    for index, block in enumerate(value):
        where = f"{path}[{index}]"
        if not isinstance(block, dict) or "type" not in block:
            raise SceneError(f"got {_shown(block)}, expected a mapping with the key 'type' @ {where}")
        name = block["type"]
        if name not in EFFECTS:
            raise SceneError(
                f"unknown effect {name!r}; expected one of {sorted(EFFECTS)}."
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
    effect: Effect = cls(**_checked_fields(cls, values, path, extra=("type",)))
    for field in dataclasses.fields(cls):
        if field.metadata.get("place"):
            with _at(f"{path}.{field.name}"):
                point_at(lattice, getattr(effect, field.name), points)
    return effect


def _checked_fields(cls: type, block: Any, path: str, *, extra: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the values of a dataclass declared with `quantity`, `choice`, `words` and `place`."""
    fields = {field.name: field for field in dataclasses.fields(cls)}
    required = tuple(name for name, field in fields.items() if field.default is dataclasses.MISSING)
    check_mapping(block, (*extra, *fields), path, required=required)
    values: dict[str, Any] = {}
    for key, value in block.items():
        field = fields[key]
        with _at(f"{path}.{key}"):
            if "options" in field.metadata:
                values[key] = check_choice(value, field)
            elif field.metadata.get("place"):
                values[key] = tuple(value) if isinstance(value, list) else value
            else:
                values[key] = check_number(value, field)
    return values


def check_inputs(value: Any, path: str) -> tuple[ScheduledCommand, ...]:
    """Return the schedule; its values are checked against the effects when the scene is built."""
    if not isinstance(value, list):
        raise SceneError(f"got {_shown(value)}, expected a list of commands with a time @ {path}")
    commands: list[ScheduledCommand] = []
    for index, block in enumerate(value):
        where = f"{path}[{index}]"
        check_mapping(block, ("time", "torque", "pressure", "wrench"), where, required=("time",))
        time = check_scalar(block["time"], f"{where}.time", low=0.0, unit="s")
        if commands and time < commands[-1].time:
            raise SceneError(
                f"got {time:g} s after {commands[-1].time:g} s, expected times in order @ {where}.time"
            )
        if len(block) == 1:
            raise SceneError(f"nothing is commanded; name torque, pressure or wrench @ {where}")
        wrench = None
        if "wrench" in block:
            part = check_mapping(
                block["wrench"], ("frame", "force", "torque"), f"{where}.wrench", required=("frame",)
            )
            force = check_vector(part.get("force", [0.0] * 3), 3, f"{where}.wrench.force", unit="N")
            torque = check_vector(part.get("torque", [0.0] * 3), 3, f"{where}.wrench.torque", unit="N m")
            wrench = (str(part["frame"]), (force[0], force[1], force[2]), (torque[0], torque[1], torque[2]))
        commands.append(ScheduledCommand(time, block.get("torque"), block.get("pressure"), wrench))
    return tuple(commands)


def check_sensors(
    value: Any, lattice: Lattice, points: dict[str, Point], path: str
) -> dict[str, dict[str, Any]]:
    """Return each sensor's parameters with defaults filled in."""
    block = check_mapping(value, tuple(SENSORS), path)
    sensors: dict[str, dict[str, Any]] = {}
    for name, given in block.items():
        where, known = f"{path}.{name}", SENSORS[name]
        extra = ("points",) if name == "tracker" else ()
        given = check_mapping({} if given is None else given, (*extra, *known), where)
        values: dict[str, Any] = {}
        if extra:
            tracked = given.get("points", list(points))
            if not isinstance(tracked, list) or len(set(map(str, tracked))) != len(tracked):
                raise SceneError(
                    f"got {_shown(tracked)}, expected a list of different points @ {where}.points"
                )
            for item in tracked:
                if not isinstance(item, str):
                    raise SceneError(f"got {_shown(item)}, expected the name of a point @ {where}.points")
                with _at(f"{where}.points"):
                    point_at(lattice, item, points)
            values["points"] = tuple(tracked)
        for key, (default, low, high, unit) in known.items():
            number = check_scalar(given.get(key, default), f"{where}.{key}", low=low, high=high, unit=unit)
            values[key] = int(number) if key == "seed" else number
        sensors[name] = values
    return sensors


def check_solver(value: Any, path: str) -> Solver:
    """Return the solver: {integrator, accuracy} or {integrator, dt}."""
    block = check_mapping(value, ("integrator", "accuracy", "dt"), path)
    integrator = block.get("integrator", "auto")
    names = ("auto", *INTEGRATORS)
    if integrator not in names:
        raise SceneError(
            f"unknown integrator {integrator!r}; expected one of {list(names)}."
            f"{did_you_mean(integrator, names)} @ {path}.integrator"
        )
    if "dt" not in block:
        accuracy = check_scalar(
            block.get("accuracy", 1e-5), f"{path}.accuracy", low=1e-10, high=1e-2, unit="m"
        )
        return Solver(integrator, accuracy, None)
    if "accuracy" in block or integrator == "auto":
        raise SceneError(
            f"a fixed dt goes with a named integrator and without accuracy; drop one of them @ {path}.dt"
        )
    return Solver(integrator, None, check_scalar(block["dt"], f"{path}.dt", low=1e-9, high=1.0, unit="s"))


@contextmanager
def _at(path: str) -> Iterator[None]:
    # Names the place of what a check refuses.
    try:
        yield
    except ValueError as error:
        raise SceneError(f"{error} @ {path}") from error


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
