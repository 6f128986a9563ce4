"""The statistics of a run."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass
class Statistics:
    """The cost and the estimated error of a run.

    Attributes:
        steps: Accepted steps.
        rejected_steps: Steps taken again with a smaller size.
        evaluations: Force evaluations.
        factorisations: Matrices factored.
        solves: Linear systems solved.
        error_estimate: Largest estimated error of a node position so far [m]; 0 with a fixed step.
        velocity_estimate: Largest estimated error of a node velocity so far [m/s]; 0 with a fixed step.
        wall_time: Time spent in `advance_to` [s].
    """

    steps: int = 0
    rejected_steps: int = 0
    evaluations: int = 0
    factorisations: int = 0
    solves: int = 0
    error_estimate: float = 0.0
    velocity_estimate: float = 0.0
    wall_time: float = 0.0

    def as_dict(self) -> dict[str, float]:
        """Return the figures by name."""
        return asdict(self)
