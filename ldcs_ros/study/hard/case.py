"""What a hard case is made of: a scene, a start, a duration, and what counts as right."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

# The energy audit's residual, as a share of the energy moved, may be this times the asked accuracy as a share of
# the sheet's length.
AUDIT_SHARE = 10.0
# What an asked accuracy promises: nearly always that error, never more than this times it.
PROMISE = 3.0


@dataclass(frozen=True)
class Reference:
    """Right is what the same scene gives at a finer accuracy.

    Attributes:
        bound: Largest accepted error of a node [m]; None for what the asked accuracy promises.
        finer: The reference's accuracy as a share of the asked one; the audit checks both independently of
            the method.
        method: Another integrator for the reference; '' for the same.
    """

    bound: float | None = None
    finer: float = 0.01
    method: str = ""


@dataclass(frozen=True)
class Rest:
    """Right is to end at rest in a state in which the static solver finds all forces balanced.

    Attributes:
        bound: Largest accepted distance of a node from that state [m].
        shape: 'scene' for the rest state from the scene's own start, 'nearest' for the equilibrium in whose
            basin the run ended (springs along their axes have mirrored equilibria beside the scene's own).
    """

    bound: float
    shape: str = "scene"


@dataclass(frozen=True)
class Bounded:
    """Right is to stay finite and within reach; the error is reported.

    Attributes:
        limit: Largest distance of a node from the origin [m].
        reference: Method of a fine run to report the error against; '' for none.
    """

    limit: float
    reference: str = ""


@dataclass(frozen=True)
class Still:
    """Right is a rest without jitter: from a time on no node moves.

    Attributes:
        after: From when on [s].
        limit: Largest peak-to-peak motion of a node's coordinate [m].
    """

    after: float
    limit: float


@dataclass(frozen=True)
class Periodic:
    """Right is to come back to the same state in every cycle, without taking up memory.

    Attributes:
        period: Duration of a cycle [s].
        after: From when on cycles are compared [s].
        limit: Largest difference between any two cycles at the same phase [m].
        growth: Largest growth of the process's memory [byte].
    """

    period: float
    after: float
    limit: float
    growth: int = 4_000_000


@dataclass(frozen=True)
class Refused:
    """Right is an error before anything moved.

    Attributes:
        words: What the message must say.
    """

    words: str


Right = Reference | Rest | Bounded | Still | Periodic | Refused


@dataclass(frozen=True)
class HardCase:
    """One row of the catalogue.

    Attributes:
        name: Unique name.
        scene: The scene as a dict, as `load_scene` takes it.
        duration: How long to simulate [s].
        right: What counts as right.
        reason: Why the bounds are what they are, where they are not the defaults.
        start: Name in `STARTS` of the shape to start from; '' for the scene's own.
        audit: Largest relative residual of the energy audit; None for 10 times the asked accuracy over the sheet's
            length, infinite where energy says nothing.
        fast: Part of the default tests.
        patience: Wall time after which a run counts as stuck [s].
    """

    name: str
    scene: dict[str, Any] = field(repr=False)
    duration: float
    right: Right
    reason: str = ""
    start: str = ""
    audit: float | None = None
    fast: bool = False
    patience: float = 120.0

    @property
    def accuracy(self) -> float | None:
        """The asked accuracy [m], None with a fixed step."""
        solver = self.scene.get("solver", {})
        accuracy: float | None = None if "dt" in solver else solver.get("accuracy", 1e-5)
        return accuracy

    @property
    def audit_bound(self) -> float:
        """Largest accepted relative residual of the energy audit."""
        if self.audit is not None:
            return self.audit
        length = self.scene["lattice"]["size"][0]
        return float("inf") if self.accuracy is None else AUDIT_SHARE * self.accuracy / length
