"""SciPy's own solvers on the same model: what somebody gets who writes no solver."""

from __future__ import annotations

from typing import Any

import numpy as np

from ldcs_ros.integrators.first_order import FirstOrder
from ldcs_ros.threads import one_thread

# Absolute tolerance of rates against that of positions [1/s]; rates of 0.1 m/s belong to displacements of centimetres.
RATE_WEIGHT = 10.0


def solve(
    simulation: Any, method: str, accuracy: float, times: tuple[float, ...]
) -> tuple[np.ndarray, dict[str, int]]:
    """Return node positions at times [m] and counts, by `solve_ivp` with the analytic sparse Jacobian.

    The solver starts anew at each corner of the drives, as ours does. Schedules beyond t = 0 are not followed.

    Args:
        simulation: A simulation at its start.
        method: 'BDF' or 'Radau'.
        accuracy: Absolute tolerance of a position [m]; relative one 1e-3 of it per metre.
        times: When [s].

    Raises:
        RuntimeError: SciPy gives up.
    """
    from scipy.integrate import solve_ivp

    model, held = simulation.model, simulation.inputs.held()
    motion = simulation._motion()
    n_nodes, n = model.lattice.n_nodes, len(model.free)
    corners = sorted({*model.breakpoints, times[-1]} - {0.0})
    course: dict[float, np.ndarray] = {}
    counts = {"steps": 0, "evaluations": 0, "factorisations": 0}
    absolute = np.concatenate([np.full(n, accuracy), np.full(n, RATE_WEIGHT * accuracy)])
    for corner in [time for time in corners if time <= times[-1]]:
        system = FirstOrder(model, motion, held)
        asked = [time for time in times if motion.time < time <= corner]
        with one_thread():
            solution = solve_ivp(
                system.slope,
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
        counts["evaluations"] += system.evaluations
        counts["factorisations"] += int(solution.nlu)
    return np.array([course[time] for time in times]), counts
