"""The parameters that the paper leaves open: path, physical bounds, plausible spread and the reason of both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ldcs_ros.schema.paths import get_number

CALIBRATED = "paper_calibrated"
# Not a key of the scene: the height above the mid-plane at which P0 and P1 are taken [m].
SENSOR_HEIGHT = "sensor_height"


@dataclass(frozen=True)
class Parameter:
    """A number that the paper does not print, or that could be read otherwise.

    Attributes:
        short: Name for tables.
        path: Its path in the scene.
        unit: SI unit.
        low, high: Physical bounds.
        spread: Half the width of the plausible range, as believed without the data.
        origin: Reason of the bounds.
    """

    short: str
    path: str
    unit: str
    low: float
    high: float
    spread: float
    origin: str


PARAMETERS = (
    Parameter(
        "joint stiffness", "effects.arms.joint_stiffness", "N m/rad", 0.02, 2.0, 0.2,
        "not printed; stiffer than a 35 mm strip of the sheet (0.006), softer than a rigid arm",
    ),
    Parameter(
        "joint torque at 1.4 bar", "inputs[0].torque", "N m", 0.02, 0.19, 0.08,
        "not printed; at most 1.4 bar on all of the arm's section under the backbone, times the lever",
    ),
    Parameter(
        "backbone height", "effects.arms.backbone_height", "m", -0.005, 0.005, 0.0025,
        "not printed; the rig's inextensible layer lies inside the sheet, above the chambers if the arm bends up",
    ),
)  # fmt: skip

# All other parameters that the paper leaves open, with their values in the scene. k and the payload's height show the
# effect of other readings of the text.
OPEN = (
    Parameter("base joint share", "effects.arms.base_joint_share", "", 0.25, 4.0, 0.5, "1: all joints alike"),
    Parameter("stiff base", "effects.arms.rigid_base", "m", 0.0, 0.017, 0.005, "0: bends from the clamp on"),
    Parameter("coupling stiffness", "effects.arms.coupling_stiffness", "N/m", 500.0, 1e5, 4000.0, "100 k"),
    Parameter("link mass", "effects.arms.link_mass", "kg", 1e-4, 0.02, 0.004, "arms weigh 40 g of their own"),
    Parameter(
        "spring stiffness", "effects.springs.stiffness", "N/m", 80.0, 200.0, 20.0, "from E = 75.35 kPa"
    ),
    Parameter("sheet mass", "lattice.mass", "kg", 0.14, 0.21, 0.005, "printed: 160 g"),
    Parameter("payload mass", "effects.payload.mass", "kg", 0.03, 0.05, 0.001, "printed: 40 g"),
    Parameter("sensor height", SENSOR_HEIGHT, "m", -0.005, 0.005, 0.0025, "0: on the mid-plane"),
)


def present(content: dict[str, Any], parameter: Parameter) -> float:
    """Return a parameter's value in a scene; the scene must name it."""
    return 0.0 if parameter.path == SENSOR_HEIGHT else get_number(content, parameter.path)
