"""Cost of a verified run: its CPU time over that of the plain run, measured in turns, and both of its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.study.problems import scene_of
from ldcs_ros.study.rows import Row, Task
from ldcs_ros.study.timing import in_turns

SCENES = ("arc", "paper", "rig", "hanging_sheet")
ACCURACY = 1e-5  # m
# Duration [s] and looks per second, as often as the twin reports its state.
DURATION, LOOKS = 3.0, 50
ROUNDS = 3


def verified_runs(task: Task) -> list[Row]:
    """Return the row of a scene: the measured error, in `extra` the plain run's CPU time and its estimate."""
    scene = scene_of(task.scene, accuracy=ACCURACY)
    plain, verified = scene.build(), scene.build(verify=True)
    for simulation in (plain, verified):
        simulation.advance_to(0.01)  # loads and compiles
    costs = in_turns(_run(plain), _run(verified), rounds=ROUNDS)
    extra = f"plain {costs[0] / DURATION:.6g} estimate {plain.statistics.error_estimate:.3g}"
    row = replace(
        task.row(),
        nodes=scene.lattice.nodes[0],
        method=plain.integrator.name,
        value=ACCURACY,
        error=verified.statistics.error_estimate,
        cpu=costs[1] / DURATION,
        extra=extra,
    )
    return [row.counted(verified.statistics)]


@dataclass(frozen=True)
class VerificationCost:
    """The cost of a verified run of a scene.

    Attributes:
        scene: Scene by name.
        plain, verified: CPU seconds per simulated second.
        measured, estimated: Largest error of the run as measured and as estimated by the plain run [m].
    """

    scene: str
    plain: float
    verified: float
    measured: float
    estimated: float

    @property
    def ratio(self) -> float:
        """CPU time of the verified run over that of the plain one."""
        return self.verified / self.plain


def verification_costs(rows: Sequence[Row]) -> list[VerificationCost]:
    """Return the cost by scene, in the order of the rows."""
    found = []
    for row in rows:
        if row.kind == "verified" and not row.failure:
            plain, estimate = (float(word) for word in row.extra.split()[1::2])
            found.append(VerificationCost(row.scene, plain, row.cpu, row.error, estimate))
    return found


def _run(simulation: Simulation) -> Callable[[], None]:
    def run() -> None:
        simulation.reset()
        for look in range(1, round(DURATION * LOOKS) + 1):
            simulation.advance_to(look / LOOKS)

    return run
