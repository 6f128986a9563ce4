"""A mapping as data: which topic carries which command or measurement, and in which unit."""

from __future__ import annotations

from dataclasses import dataclass

from ldcs_ros.signals.units import STANDARD_ATMOSPHERE


@dataclass(frozen=True)
class CommandSource:
    """A topic that commands the rig.

    Attributes:
        topic: Its name in the bag.
        to: Input of the twin that it stands for: pressure_command, torque_command or external_wrench.
        scale: Factor from its unit to SI.
        field: Path of the value in the message, '' for the usual one of the type.
        arms: Arms that its values are for, in their order.
        joints: Joint names for its values, in their order; empty to take the message's own.
        frame: Frame of a wrench; '' to take the message's own.
        offset: Subtracted from the value in SI, such as the ambient pressure from absolute ones; None for what
            the message type says.
    """

    topic: str
    to: str
    scale: float = 1.0
    field: str = ""
    arms: tuple[str, ...] = ("left", "right")
    joints: tuple[str, ...] = ()
    frame: str = ""
    offset: float | None = None


@dataclass(frozen=True)
class MeasurementSource:
    """A topic that reports a measurement.

    Attributes:
        topic: Its name in the bag.
        to: What it measures: a point (`P0`), `<arm>/pressure`, or a joint (`joint/<name>`).
        scale: Factor from its unit to SI.
        field: Path of the value in the message, '' for the usual one of the type.
        child: Child frame of the transform that is meant; '' for any.
        translation: Where the sensor's base stands in ldcs_base [m].
        rotation: Unit quaternion x, y, z, w that turns the sensor's axes into those of ldcs_base.
        offset: Subtracted from the value in SI, such as the ambient pressure from absolute ones; None for what
            the message type says.
        index: Which element of an array is meant; None for a message with one value.
    """

    topic: str
    to: str
    scale: float = 1.0
    field: str = ""
    child: str = ""
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    offset: float | None = None
    index: int | None = None


@dataclass(frozen=True)
class Mapping:
    """What a bag's topics mean.

    Attributes:
        commands: Topics that command.
        measurements: Topics that report.
        time: When a message acts: 'log' (when it was recorded) or 'stamp' (what its header says).
        initial: Where a replay begins: 'rest' (the rest state without commands) or 'start' (the scene's start).
        late: Delay from stamp to recording above which a message counts as late [s].
        gap: Silence above which messages count as missing [s]; None for five of the topic's usual periods.
        ambient_pressure: Pressure of the surrounding air [Pa].
    """

    commands: tuple[CommandSource, ...] = ()
    measurements: tuple[MeasurementSource, ...] = ()
    time: str = "log"
    initial: str = "rest"
    late: float = 0.1
    gap: float | None = None
    ambient_pressure: float = STANDARD_ATMOSPHERE
