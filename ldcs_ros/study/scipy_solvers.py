"""SciPy's own solvers on the same model, for comparison."""

from __future__ import annotations

import math
import time as wall_clock
from collections.abc import Callable

import numpy as np

from ldcs_ros.integrators.first_order import FirstOrder
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.statistics import Statistics
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
) -> tuple[np.ndarray, Statistics]:
    """Return node positions at times [m], shape (n_times, n_nodes, 3), and counts, by `solve_ivp`.

    The Jacobian is analytic and sparse.

    The solver restarts at each discontinuity of the drives and at each command. Of the scene's own schedule only the
    commands at t = 0 are applied.

    Args:
        simulation: A simulation at its start; its inputs are used up.
        method: 'BDF' or 'Radau'.
        accuracy: Absolute tolerance of a position [m]; relative one 1e-3 of it per metre.
        times: Increasing times [s].
        command: Gives command number k to the simulation's inputs and returns when the next one is due [s].
        budget: Largest CPU time [s].

    Raises:
        RuntimeError: SciPy gives up, or the budget is spent.
    """
    from scipy.integrate import solve_ivp

    model, motion = simulation.model, simulation.motion()
    n_nodes, n = model.lattice.n_nodes, len(model.free)
    found: dict[float, np.ndarray] = {}
    evaluations = factorisations = 0
    absolute = np.concatenate([np.full(n, accuracy), np.full(n, RATE_WEIGHT * accuracy)])
    began, due, count = wall_clock.thread_time(), 0.0 if command else math.inf, 0
    with one_thread():
        while motion.time < times[-1] - TIME_TOLERANCE:
            if command is not None and due <= motion.time + TIME_TOLERANCE:
                due, count = command(count), count + 1
            while simulation.inputs.next_valve_change() <= motion.time + TIME_TOLERANCE:
                simulation.inputs.apply_valve_change()
            ahead = (due, simulation.inputs.next_valve_change(), *model.breakpoints, times[-1])
            end = min(time for time in ahead if time > motion.time + TIME_TOLERANCE)
            system = FirstOrder(model, motion, simulation.inputs.held())

            def slope(time: float, y: np.ndarray, system: FirstOrder = system) -> np.ndarray:
                spent = wall_clock.thread_time() - began
                if spent > budget:
                    raise RuntimeError(f"too slow: stopped after {spent:.0f} CPU s at t = {time:.2g} s")
                return system.slope(time, y)

            asked = [time for time in times if motion.time < time <= end]
            solution = solve_ivp(
                slope,
                (motion.time, end),
                system.start,
                method=method,
                jac=system.jacobian,
                rtol=max(10.0 * accuracy, 1e-12),
                atol=absolute,
                t_eval=sorted({*asked, end}),
            )
            if solution.status != 0:
                raise RuntimeError(f"SciPy's {method}: {solution.message}")
            for time, y in zip(solution.t, solution.y.T, strict=True):
                q, _ = system.place(time, y)
                found[float(time)] = q[: 3 * n_nodes].reshape(-1, 3).copy()
            motion = system.motion(end, solution.y[:, -1])
            simulation.time = end
            evaluations += system.evaluations
            factorisations += int(solution.nlu)
    counts = Statistics(evaluations=evaluations, factorisations=factorisations)
    return np.array([found[time] for time in times]), counts
