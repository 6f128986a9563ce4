"""SciPy's own solvers on the same model: what somebody gets who writes no solver."""

from __future__ import annotations

import math
import time as wall_clock
from collections.abc import Callable

import numpy as np

from ldcs_ros.integrators.first_order import FirstOrder
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread

# Absolute tolerance of rates against that of positions [1/s]; rates of 0.1 m/s belong to displacements of centimetres.
RATE_WEIGHT = 10.0


def solve(
    simulation: Simulation,
    method: str,
    accuracy: float,
    times: tuple[float, ...],
    *,
    command: Callable[[int], float] | None = None,
    budget: float = math.inf,
) -> tuple[np.ndarray, dict[str, int]]:
    """Return node positions at times [m] and counts, by `solve_ivp` with the analytic sparse Jacobian.

    The solver starts anew at each corner of the drives and at each command, since it knows no other way. Of the
    scene's own schedule only what acts at t = 0 is followed.

    Args:
        simulation: A simulation at its start; its inputs are used up.
        method: 'BDF' or 'Radau'.
        accuracy: Absolute tolerance of a position [m]; relative one 1e-3 of it per metre.
        times: When [s].
        command: Gives command number k to the simulation's inputs and returns when the next one is due [s].
        budget: CPU time that it may take [s].

    Raises:
        RuntimeError: SciPy gives up, or the budget is spent.
    """
    from scipy.integrate import solve_ivp

    model, motion = simulation.model, simulation.motion()
    n_nodes, n = model.lattice.n_nodes, len(model.free)
    course: dict[float, np.ndarray] = {}
    counts = {"steps": 0, "evaluations": 0, "factorisations": 0}
    absolute = np.concatenate([np.full(n, accuracy), np.full(n, RATE_WEIGHT * accuracy)])
    began, due, count = wall_clock.thread_time(), 0.0 if command else math.inf, 0
    with one_thread():
        while motion.time < times[-1] - TIME_TOLERANCE:
            if command is not None and due <= motion.time + TIME_TOLERANCE:
                due, count = command(count), count + 1
            while simulation.inputs.next_switch() <= motion.time + TIME_TOLERANCE:
                simulation.inputs.switch()
            ahead = (due, simulation.inputs.next_switch(), *model.breakpoints, times[-1])
            corner = min(time for time in ahead if time > motion.time + TIME_TOLERANCE)
            system = FirstOrder(model, motion, simulation.inputs.held())

            def slope(time: float, y: np.ndarray, system: FirstOrder = system) -> np.ndarray:
                spent = wall_clock.thread_time() - began
                if spent > budget:
                    raise RuntimeError(f"too slow: stopped after {spent:.0f} CPU s at t = {time:.2g} s")
                return system.slope(time, y)

            asked = [time for time in times if motion.time < time <= corner]
            solution = solve_ivp(
                slope,
                (motion.time, corner),
                system.start,
                method=method,
                jac=system.jacobian,
                rtol=max(10.0 * accuracy, 1e-12),
                atol=absolute,
                t_eval=sorted({*asked, corner}),
            )
            if solution.status != 0:
                raise RuntimeError(f"SciPy's {method}: {solution.message}")
            for time, y in zip(solution.t, solution.y.T, strict=True):
                q, _ = system.place(time, y)
                course[float(time)] = q[: 3 * n_nodes].reshape(-1, 3).copy()
            motion = system.motion(corner, solution.y[:, -1])
            simulation.time = corner
            counts["evaluations"] += system.evaluations
            counts["factorisations"] += int(solution.nlu)
    return np.array([course[time] for time in times]), counts
