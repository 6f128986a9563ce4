"""What the bridge publishes of a rig: its readings in the twin's terms, and the residuals."""

from __future__ import annotations

import numpy as np

from ldcs_ros.messages import messages
from ldcs_ros.messages.cdr import encode, header, message_class, nanoseconds
from ldcs_ros.messages.topics import BASE_FRAME
from ldcs_ros.rig.intake import Sample
from ldcs_ros.rig.units import AMBIENT
from ldcs_ros.twin.twin import Twin

_UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class RigReport:
    """Emits through a twin, so that publishers and recorders get everything in one stream.

    Args:
        twin: The twin; its topics hold those of the bridge.
    """

    def __init__(self, twin: Twin) -> None:
        self._twin = twin

    def sample(self, sample: Sample, time: float) -> None:
        """Report a sound sample that was measured at a time of the twin [s]."""
        made = sample_message(sample, time, self._twin.simulation.arm_names)
        if made is not None:
            self._emit(f"rig/{made[0]}", made[1])

    def residual(self, point: str, time: float, residual: np.ndarray) -> None:
        """Report measured minus predicted position [m], shape (3,)."""
        x, y, z = residual.tolist()
        vector = message_class("geometry_msgs/msg/Vector3")(x=x, y=y, z=z)
        stamped = message_class("geometry_msgs/msg/Vector3Stamped")
        self._emit(f"residual/{point}", encode(stamped(header=_head(time), vector=vector)))

    def _emit(self, name: str, cdr: bytes) -> None:
        topic = self._twin.topics.get(name)
        if topic is not None:
            self._twin.emit(topic, cdr, nanoseconds(self._twin.time))


def sample_message(sample: Sample, time: float, arms: tuple[str, ...]) -> tuple[str, bytes] | None:
    """Return the twin's topic for a sample and its message; None for a set-point, which goes in pairs."""
    if sample.kind == "position":
        return f"{sample.name}/pose", messages.pose(nanoseconds(max(time, 0.0)), sample.value, _UPRIGHT)
    if sample.kind == "pressure" and sample.name in arms:
        stamp = nanoseconds(max(time, 0.0))
        cdr = messages.fluid_pressure(stamp, BASE_FRAME, float(sample.value) + AMBIENT, 0.0)
        return f"{sample.name}/pressure", cdr
    return None


def _head(time: float) -> object:
    return header(nanoseconds(max(time, 0.0)), BASE_FRAME)
