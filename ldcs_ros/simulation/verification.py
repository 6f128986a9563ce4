"""`VerifiedSimulation`: a second solution at a tenth of the accuracy beside the first measures its error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ldcs_ros.physics.inputs import ScheduledCommand
from ldcs_ros.physics.state import State
from ldcs_ros.simulation.checkpoint import Checkpoint
from ldcs_ros.simulation.problem import Problem
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.stability import Stability

# Accuracy of the second solution, as a fraction of the first one's.
FINER = 0.1


class VerifiedSimulation(Simulation):
    """A simulation whose `statistics.error_estimate` is measured: the largest distance of a node from a finer solution.

    Both solutions take the same commands; distances are taken at the times that the simulation is advanced to. The
    finer solution costs about twice what the first one does; `ldcs study` measures it.

    Args:
        scene: The problem to simulate.
        finer: The same problem with `FINER` times its accuracy.
    """

    def __init__(self, scene: Problem, finer: Problem) -> None:
        self._finer = Simulation(finer)
        self._followed = self._finer.inputs.version
        self._measured = 0.0
        super().__init__(scene)

    def advance_to(self, time: float) -> None:
        """Advance both solutions to a time [s], and measure their distance there; raises as `Simulation.advance_to`."""
        self._pass_commands()
        super().advance_to(time)
        self._finer.advance_to(time)
        self._followed = self.inputs.version
        n = 3 * self.lattice.n_nodes
        gap = (self.motion().q[:n] - self._finer.motion().q[:n]).reshape(-1, 3)
        self._measured = max(self._measured, float(np.linalg.norm(gap, axis=1).max()))
        self.statistics.error_estimate = self._measured

    def reset(self, state: State | None = None) -> None:
        """Go back to the start or to a state of this simulation; raises as `Simulation.reset`."""
        checkpoint = None if state is None else state.memory
        if isinstance(checkpoint, Checkpoint) and checkpoint.finer is None:
            raise ValueError(
                "reset: got a state of a run without verification, expected one of this simulation"
            )
        super().reset(state)
        self._finer.reset(checkpoint.finer if isinstance(checkpoint, Checkpoint) else None)
        self._measured = self.statistics.error_estimate
        self._followed = self.inputs.version

    def start_from(
        self,
        position: np.ndarray,
        velocity: np.ndarray | None = None,
        *,
        link_angle: np.ndarray | None = None,
        link_rate: np.ndarray | None = None,
    ) -> None:
        """Put both solutions into a given shape; raises as `Simulation.start_from`."""
        super().start_from(position, velocity, link_angle=link_angle, link_rate=link_rate)
        self._pass_commands()
        self._finer.start_from(position, velocity, link_angle=link_angle, link_rate=link_rate)

    def announce(self, commands: Sequence[ScheduledCommand]) -> None:
        """Announce commands to both solutions, as `Simulation.announce`."""
        super().announce(commands)
        self._finer.announce(commands)

    def settle(self, *, follow: bool = False, until: float = math.inf) -> Stability:
        """Move both solutions to one equilibrium; raises as `Simulation.settle`."""
        self._pass_commands()
        found = super().settle(follow=follow, until=until)
        self._finer.settle(until=until)
        state = self.state
        angles = {"link_angle": state.link_angle, "link_rate": state.link_rate} if self.arm_names else {}
        self._finer.start_from(state.position, state.velocity, **angles)
        self._followed = self.inputs.version
        return found

    def build_state(self) -> State:
        state = super().build_state()
        assert isinstance(state.memory, Checkpoint)
        return replace(state, memory=replace(state.memory, finer=self._finer.state))

    def _pass_commands(self) -> None:
        # Both run the schedule; only commands from outside are passed on.
        if self.inputs.version != self._followed:
            self._finer.inputs.set_state(self.inputs.get_state())
            self._followed = self.inputs.version
