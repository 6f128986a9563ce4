"""The models that are compared with the experiment: everything as printed under each spring law, and the calibrated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from scipy.optimize import brentq

from ldcs_ros.errors import DivergenceError, LdcsError
from ldcs_ros.physics.effects.springs import LAWS
from ldcs_ros.scene import load_scene
from ldcs_ros.schema.fields import finite_number
from ldcs_ros.validate import paper
from ldcs_ros.validate.measure import Rest, at_rest
from ldcs_ros.validate.parameters import CALIBRATED, PARAMETERS

# The search for the torque: first guess, growth, and its end [N m].
FIRST_TORQUE, TORQUE_GROWTH, LARGEST_TORQUE = 0.02, 1.25, 2.0
RADIUS_TOLERANCE = 1e-5  # of the radius


class ValidationError(LdcsError, RuntimeError):
    """A case of the validation cannot be computed."""


@dataclass(frozen=True)
class ComparedModel:
    """One column of the comparison.

    Attributes:
        name: Short name.
        title: Description.
        fitted: Fitted quantities, in words.
        torque: Torque of each joint [N m]; None without a torque.
        rest: The equilibrium.
    """

    name: str
    title: str
    fitted: str
    torque: float | None
    rest: Rest


def as_printed(law: str, *, torque: float | None) -> dict[str, Any]:
    """Return the paper's test with every printed number and nothing else changed, as a scene.

    Numbers that are not printed have the defaults of the effects. Arms act on the border lines only, and all their
    joints are alike. The payload hangs at the top node of P1.

    Args:
        law: Spring law.
        torque: Torque of every joint [N m]; None holds both side edges exactly on the arc instead.
    """
    effects: list[dict[str, Any]] = [
        {"type": "springs", "law": law, "stiffness": 80.0, "damping": 5.0},
        {"type": "gravity"},
        {"type": "clamp", "edge": "x_min"},
        {"type": "payload", "at": ["top", 8, 4], "mass": 0.040},
    ]
    content: dict[str, Any] = {
        "lattice": {"size": [0.140, 0.140, 0.010], "nodes": [9, 9], "mass": 0.160},
        "points": {"P0": ["mid", 4, 4], "P1": ["mid", 8, 4]},
        "effects": effects,
    }
    if torque is None:
        effects.append({"type": "driven_edges", "edges": ["y_min", "y_max"], "curvature": 1.0 / paper.RADIUS})
    else:
        effects.append({"type": "arms", "drive": "torque", "links": 4, "width": 0, "base_joint_share": 1.0})
        content["inputs"] = [{"time": 0.0, "torque": torque}]
    return content


def torque_for_radius(scene_at: Callable[[float], dict[str, Any]], radius: float = paper.RADIUS) -> float:
    """Return the smallest joint torque [N m] that bends the actuated edges up to a radius [m].

    Args:
        scene_at: The scene at a torque [N m].
        radius: Radius asked for [m].

    Raises:
        ValidationError: No torque up to `LARGEST_TORQUE` does.
    """

    def excess(torque: float) -> float:
        return 1.0 / at_rest(scene_at(torque)).radius - 1.0 / radius

    low, high = 0.0, FIRST_TORQUE
    try:
        while excess(high) < 0.0:
            low, high = high, TORQUE_GROWTH * high
            if high > LARGEST_TORQUE:
                raise ValidationError(f"no torque up to {LARGEST_TORQUE:g} N m gives the radius {radius:g} m")
    except DivergenceError as error:
        raise ValidationError(f"no torque gives the radius {radius:g} m: {error}") from error
    return float(brentq(excess, low, high, xtol=1e-7 * high, rtol=RADIUS_TOLERANCE))


def printed_case(law: str) -> ComparedModel:
    """Return the test as printed under a spring law, with the torque that gives the printed radius."""
    torque = torque_for_radius(lambda value: as_printed(law, torque=value))
    rest = at_rest(as_printed(law, torque=torque))
    return ComparedModel(
        f"printed {law}", f"as printed, {law} springs", "torque to r = 0.115 m", torque, rest
    )


def arc_case(law: str) -> ComparedModel:
    """Return the test as printed with arms so stiff that both edges lie on the arc exactly."""
    rest = at_rest(as_printed(law, torque=None))
    return ComparedModel(
        f"arc {law}", f"as printed, {law} springs, edges held on the arc", "nothing", None, rest
    )


def calibrated_case() -> ComparedModel:
    """Return the shipped calibrated scene."""
    scene = load_scene(CALIBRATED)
    torque = finite_number(scene.inputs[-1].torque)

    names = ", ".join(parameter.short for parameter in PARAMETERS)
    return ComparedModel("calibrated", "the calibrated twin", names, torque, at_rest(scene))


def all_cases(progress: Callable[[float], None] = lambda fraction: None) -> list[ComparedModel]:
    """Return every case: (a) and (b) as printed under each law, the edges on the arc, (c) the calibrated twin.

    Args:
        progress: Called with the fraction of the work that is done.
    """
    makers: list[Callable[[], ComparedModel]] = [
        *(partial(printed_case, law) for law in LAWS),
        partial(arc_case, "axial"),
        calibrated_case,
    ]
    cases = []
    for number, make in enumerate(makers, start=1):
        cases.append(make())
        progress(number / len(makers))
    return cases
