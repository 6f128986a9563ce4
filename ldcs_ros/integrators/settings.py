"""`Solver`: the settings of a scene's integration, which check themselves."""

from __future__ import annotations

from dataclasses import dataclass

from ldcs_ros.errors import SceneError
from ldcs_ros.integrators import INTEGRATORS
from ldcs_ros.schema.fields import check_field, choice, did_you_mean, quantity, shown

COMMANDS = ("auto", "held")


@dataclass(frozen=True)
class Solver:
    """A method with an accuracy, or with a fixed step.

    Attributes:
        integrator: A name of `INTEGRATORS`, or 'auto'.
        accuracy: Largest node position error asked for [m]; None with a fixed step.
        dt: Fixed step [s]; None with adaptive steps.
        verify: A second solution at a tenth of the accuracy measures the error of a run.
        commands: 'auto' lets a smooth drive replace commands that are known beforehand, where its estimated
            difference is a small fraction of the accuracy; 'held' holds every command.

    Raises:
        SceneError: A value is out of bounds, or an accuracy and a fixed step exclude each other.
    """

    integrator: str = choice("auto", ("auto", *INTEGRATORS), "method; auto is the recommended one")
    accuracy: float | None = quantity(1.0e-5, "m", "largest node position error", low=1e-10, high=1e-2)
    dt: float | None = quantity(None, "s", "fixed step of a named integrator", low=1e-9, high=1.0)
    verify: bool = False
    commands: str = choice("auto", COMMANDS, "known commands: smooth where the accuracy allows it, or held")

    def __post_init__(self) -> None:
        names = ("auto", *INTEGRATORS)
        if self.integrator not in names:
            hint = did_you_mean(self.integrator, names)
            raise SceneError(
                f"unknown integrator {shown(self.integrator)}; expected one of {list(names)}.{hint}"
                " @ solver.integrator"
            )
        if self.dt is None and self.accuracy is None:
            raise SceneError("got neither an accuracy nor a fixed dt, expected one of them @ solver")
        if self.dt is not None and (self.accuracy is not None or self.integrator == "auto"):
            raise SceneError(
                "a fixed dt goes with a named integrator and without accuracy; drop one of them @ solver.dt"
            )
        if self.commands not in COMMANDS:
            raise SceneError(
                f"got {shown(self.commands)}, expected one of {list(COMMANDS)} @ solver.commands"
            )
        if not isinstance(self.verify, bool):
            raise SceneError(f"got {shown(self.verify)}, expected true or false @ solver.verify")
        if self.verify and self.accuracy is None:
            raise SceneError(
                "a fixed step has no accuracy to verify; compare runs of two steps instead @ solver.verify"
            )
        fields = type(self).__dataclass_fields__
        for name in ("accuracy", "dt"):
            value = getattr(self, name)
            if value is not None:
                try:
                    object.__setattr__(self, name, check_field(value, fields[name]))
                except ValueError as error:
                    raise SceneError(f"{error} @ solver.{name}") from error
