"""An integrator of your own, without a change to the package: Heun's method, and the proof that it has order two."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.integrators import INTEGRATORS
from ldcs_ros.integrators.explicit import Explicit, WorkingState, stable_radius
from ldcs_ros.integrators.spectrum import FastestMode
from ldcs_ros.physics.inputs import HeldCommands


class Heun(Explicit):
    """Heun's method for (q, u)' = (u, a(t, q, u)): a step of Euler, then the mean of both ends' rates."""

    name: ClassVar[str] = "heun"
    order: ClassVar[int] = 2
    error_order: ClassVar[int] = 2
    evaluations_per_part: ClassVar[int] = 2

    def limit(self, mode: FastestMode) -> float:
        """Return the largest step for which |1 + z + z^2 / 2| <= 1 at the fastest mode."""
        radius = stable_radius(lambda z: 1.0 + z + 0.5 * z * z, mode, most=2.0)
        return radius / mode.spectral_radius if mode.spectral_radius > 0.0 else radius

    def part(self, working: WorkingState, inputs: HeldCommands, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Advance the working state by h; return how far Euler's step was off, as the estimated error."""
        model, free = self.model, self.model.free
        q0, u0, a0 = working.q[free], working.u[free], working.a
        working.time += h
        working.q[free], working.u[free] = q0 + h * u0, u0 + h * a0
        model.prescribe(working.time, working.q, working.u)
        u1, a1 = working.u[free], model.accelerate(working.time, working.q, working.u, inputs)
        working.q[free], working.u[free] = q0 + 0.5 * h * (u0 + u1), u0 + 0.5 * h * (a0 + a1)
        working.a = model.accelerate(working.time, working.q, working.u, inputs)
        return 0.5 * h * (u1 - u0), 0.5 * h * (a1 - a0)


INTEGRATORS["heun"] = f"{__name__}:Heun"  # from now on scenes may name it


def error(dt: float) -> float:
    """Return the largest error of P1 [m] in 0.2 s of the scene `single_spring` with a fixed step [s]."""
    content = load_scene("single_spring").content
    exact = load_scene({**content, "solver": {"accuracy": 1.0e-9}}).build()
    simulation = load_scene({**content, "solver": {"integrator": "heun", "dt": dt}}).build()
    worst = 0.0
    for time in np.linspace(0.02, 0.2, 10):
        exact.advance_to(time)
        simulation.advance_to(time)
        worst = max(worst, float(abs(simulation.pose("P1")[0][0] - exact.pose("P1")[0][0])))
    return worst


if __name__ == "__main__":
    coarse, fine = error(2.0e-3), error(1.0e-3)
    print(f"error {coarse:.2e} m with 2 ms, {fine:.2e} m with 1 ms: order {np.log2(coarse / fine):.2f}")
