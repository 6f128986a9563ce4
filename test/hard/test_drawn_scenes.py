"""Whatever scene the schema allows: a run ends finite, or stops with a diagnosis, and makes no energy."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, event, given, settings

from ldcs_ros import load_scene
from ldcs_ros.errors import DivergenceError, SceneError
from ldcs_ros.study.hard.case import AUDIT_FACTOR, run_samples

sys.path.insert(0, str(Path(__file__).parent))
from drawn_scenes import DURATION, scenes

EXAMPLES = int(os.environ.get("LDCS_EXAMPLES", "40"))
TIMEOUT = 4.0  # s: a scene of stiff and light parts may take long, which is an event of its own
DIAGNOSIS = re.compile(r"t = \S+ s.*no step above \S+ s.*(node_\w+|link \d).*(check|reduce)")


def _slack(simulation, accuracy: float, moved: float) -> float:
    """Energy that an error of the asked accuracy stands for: in the motion as a whole, and in its stiffest parts."""
    model = simulation.model
    length = max(simulation.lattice.size)
    motion = simulation.last_step.right
    by_position, _ = model.jacobian(
        motion.time, motion.q, motion.u, simulation.inputs.held(), positive_definite=True
    )
    stiffest = float(np.abs(by_position).max(initial=0.0)) * len(model.free)
    return AUDIT_FACTOR * accuracy / length * moved + stiffest * (3.0 * accuracy) ** 2


@settings(
    max_examples=EXAMPLES, deadline=None, derandomize=EXAMPLES <= 40, suppress_health_check=list(HealthCheck)
)
@given(scenes())
def test_a_run_ends_finite_or_with_a_diagnosis_and_makes_no_energy(content):
    try:
        simulation = load_scene(content).build()
    except SceneError as error:
        assert "@" in str(error)
        event("refused")
        return
    sample_times = list(np.linspace(0.0, DURATION, 6)[1:])
    try:
        run = run_samples(simulation, sample_times, TIMEOUT, audited=True)
    except DivergenceError as error:
        assert DIAGNOSIS.search(str(error))
        event("stopped with a diagnosis")
        run = None
    except TimeoutError:
        event("still running")
        run = None
    state = simulation.state
    for values in (state.position, state.velocity, state.link_angle, state.link_rate):
        assert np.isfinite(values).all()
    if run is None:
        return
    event("ended")
    accuracy = content["solver"]["accuracy"]
    allowed = _slack(simulation, accuracy, run.audit.moved)
    if run.audit.growth > allowed:
        # A jump of a command starts a transient of microseconds: where it leads is right, what dampers took in it is
        # known roughly. That goes away with the accuracy; energy that a method makes does not.
        event("audited again")
        finer = load_scene(content).with_accuracy(max(1e-10, 1e-3 * accuracy)).build()
        try:
            run = run_samples(finer, sample_times, 10.0 * TIMEOUT, audited=True)
        except (DivergenceError, TimeoutError):
            event("too fine")
            return
        assert run.audit.growth <= allowed
