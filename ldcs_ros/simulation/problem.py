"""`Problem`: the part of a scene that a simulation needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from ldcs_ros.integrators.settings import Solver
from ldcs_ros.physics.effects.base import Effect
from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.points import Point

if TYPE_CHECKING:
    # A problem without a material loads none.
    from ldcs_ros.physics.material import Material


class Problem(Protocol):
    """An initial value problem: a lattice with effects, a schedule of commands and the settings of its integration.

    A `Scene` is one. Units and frames of the parts are those of their own classes.
    """

    @property
    def name(self) -> str:
        """Name for people."""

    @property
    def lattice(self) -> Lattice:
        """The lattice."""

    @property
    def points(self) -> dict[str, Point]:
        """Named points."""

    @property
    def effects(self) -> Sequence[Effect]:
        """The effects, in the order in which their forces are summed."""

    @property
    def material(self) -> Material | None:
        """Material of the sheet, if mass, stiffness and damping follow from it."""

    @property
    def inputs(self) -> Sequence[ScheduledCommand]:
        """Schedule of commands, by time."""

    @property
    def solver(self) -> Solver:
        """Settings of the integration."""

    @property
    def content(self) -> dict[str, Any]:
        """The content of its file as plain values."""

    def edited(self, changes: Mapping[str, object] | None = None, /) -> Problem:
        """Return the same with other values at some paths."""

    # Any: the fields of an effect are those of the class of that name.
    def effect(self, name: str) -> Any:
        """Return the effect of a name, or None."""
