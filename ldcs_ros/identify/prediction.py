"""The answer of a scene to the commands of an experiment, its distance from the measurements, and its derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ldcs_ros.errors import LdcsError
from ldcs_ros.identify.experiments import Experiment
from ldcs_ros.identify.parameters import FitParameter, scene_values, start_values
from ldcs_ros.integrators import DEFAULT_INTEGRATOR
from ldcs_ros.scene import Scene, load_scene
from ldcs_ros.schema.paths import with_values
from ldcs_ros.schema.units import TIME_TOLERANCE
from ldcs_ros.simulation.run_sensitivity import TangentRun
from ldcs_ros.simulation.run_starts import StartProfile
from ldcs_ros.simulation.simulation import Simulation
from ldcs_ros.simulation.threads import one_thread
from ldcs_ros.twin.commands import Commands

# Adaptive steps change with the parameters, and the answer with them by up to the accuracy. At the usual 1e-5 m the
# error of a difference over 1e-4 of a value is 0.05 to 0.4 %. A bias of 6e-6 m then exceeds the noise of 1e-4 m
# averaged over a bag. At 1e-7 m both are below 1e-4 of that.
# Fixed steps would have to be short everywhere because of the discontinuities after commands.
FIT_ACCURACY = 1e-7
# A scene or a part of it, as plain values.
Content = dict[str, Any]
# A command at the instant of a rest state acts after it [s].
AFTER = 5.0 * TIME_TOLERANCE


@dataclass(frozen=True)
class Begun:
    """A simulation at the start of an experiment.

    Attributes:
        simulation: The simulation; the experiment's commands are its schedule.
        rest: Coordinates of the rest state that it started from or was moved from; None without one.
    """

    simulation: Simulation
    rest: np.ndarray | None


def begin(
    content: Content,
    values: Mapping[str, float],
    number: int,
    experiment: Experiment,
    solver: Mapping[str, object],
) -> Begun:
    """Return a simulation at the start of an experiment.

    Args:
        content: The scene.
        values: Values by path, of the scene and of starts.
        number: Index of the experiment, by which the numbers of its start are named.
        experiment: The experiment.
        solver: Settings of the integration.

    Raises:
        LdcsError: The scene is not valid, or has no rest state.
    """
    given = with_values(content, scene_values(values))
    start, time = experiment.start, rest_time(given, experiment)
    pressure, along, speed = (
        (None, None, None) if start is None else start.split(start_values(values, number))
    )
    inputs = schedule(given, experiment, time, pressure)
    scene = load_scene({**given, "inputs": inputs, "solver": dict(solver)})
    simulation = scene.build()
    if not experiment.settled:
        return Begun(simulation, None)
    simulation.settle(until=time)
    motion, free = simulation.motion(), simulation.model.free
    if start is not None:
        q, u, n = motion.q.copy(), np.zeros_like(motion.u), 3 * simulation.lattice.n_nodes
        q[free] += along
        u[free] = speed
        arms = (-1, simulation.model.arms.n_links) if simulation.model.arms is not None else (0, 0)
        simulation.start_from(
            q[:n].reshape(-1, 3),
            u[:n].reshape(-1, 3),
            link_angle=q[n:].reshape(arms),
            link_rate=u[n:].reshape(arms),
        )
    return Begun(simulation, motion.q)


def rest_time(content: Content, experiment: Experiment) -> float:
    """Return the time until which an experiment rests [s]; 0 if it begins with the scene's own start."""
    if experiment.start is not None:
        return experiment.start.time
    if not experiment.settled:
        return 0.0
    breakpoints = load_scene({**content, "inputs": []}).build().model.breakpoints
    return max([0.0, *breakpoints, *(float(one["time"]) for one in experiment.schedule)])


def schedule(
    content: Content, experiment: Experiment, rest: float, pressure: np.ndarray | None = None
) -> list[Content]:
    """Return the commands of an experiment as the schedule of a scene.

    Args:
        content: The scene.
        experiment: The experiment.
        rest: Time until which it rests [s].
        pressure: Pressures of the rest state, if they are not those of the experiment [Pa], shape (n_arms,).
    """
    simulation = load_scene({**content, "inputs": list(experiment.schedule)}).build()
    receiver, inputs = Commands(simulation), simulation.inputs
    live: list[Content] = []
    begun: dict[str, float] = {}
    for due, topic, cdr in experiment.commands:
        wrenches = inputs.wrenches
        receiver.receive(topic, cdr)
        time = max(due, rest + AFTER) if experiment.settled else max(due, 0.0)
        for kind, value in (("pressure", inputs.pressure), ("torque", inputs.torque)):
            if value is not None and topic.startswith(kind):
                live.append({"time": time, kind: value.tolist()})
                begun.setdefault(kind, time)
        for frame in {*wrenches, *inputs.wrenches} if topic == "external_wrench" else ():
            one = inputs.wrenches.get(frame)
            if one != wrenches.get(frame):
                push = (
                    {"force": [0.0] * 3}
                    if one is None
                    else {"force": list(one.force), "torque": list(one.torque)}
                )
                live.append({"time": time, "wrench": {"frame": frame, **push}})
                begun.setdefault(frame, time)
    kept = []
    for entry in experiment.schedule:
        # A command that came in the meantime replaces the schedule of its kind.
        left = {
            kind: value
            for kind, value in entry.items()
            if float(entry["time"]) < begun.get(value["frame"] if kind == "wrench" else kind, np.inf)
        }
        if len(left) > 1:
            kept.append(left)
    if pressure is not None and len(pressure):
        held = [one["pressure"] for one in kept if "pressure" in one and one["time"] <= rest]
        now = [{"time": rest + AFTER, "pressure": held[-1]}] if held and "pressure" not in begun else []
        if "pressure" in begun and begun["pressure"] > rest + AFTER:
            now = [{"time": rest + AFTER, "pressure": held[-1] if held else 0.0}]
        live = [*now, *live]
        kept = [{"time": 0.0, "pressure": pressure.tolist()}, *_without_pressure(kept, rest)]
    return sorted([*kept, *live], key=lambda entry: float(entry["time"]))


def _without_pressure(entries: Sequence[Content], until: float) -> list[Content]:
    found = []
    for entry in entries:
        left = {k: v for k, v in entry.items() if k != "pressure" or entry["time"] > until}
        if len(left) > 1:
            found.append(left)
    return found


def _accurate(content: Content, accuracy: float) -> Content:
    return {"integrator": content.get("solver", {}).get("integrator", "auto"), "accuracy": accuracy}


def predict(
    content: Content,
    experiment: Experiment,
    values: Mapping[str, float] | None = None,
    *,
    number: int = 0,
    accuracy: float = FIT_ACCURACY,
) -> np.ndarray:
    """Return the positions of a scene's points at the experiment's times [m], shape (n, n_points, 3).

    Args:
        content: The scene.
        experiment: The experiment.
        values: Other values by path, of the scene and of the start.
        number: Index of the experiment, by which the numbers of its start are named.
        accuracy: Accuracy of the run [m].

    Raises:
        LdcsError: The scene is not sound, or cannot follow the commands.
    """
    simulation = begin(content, values or {}, number, experiment, _accurate(content, accuracy)).simulation
    points = [simulation.points[name] for name in experiment.points]
    places = np.empty((len(experiment.time), len(points), 3))
    for row, time in enumerate(experiment.time):
        simulation.advance_to(max(float(time), simulation.time))
        position = simulation.state.position
        for k, point in enumerate(points):
            places[row, k] = point.position(position)
    return places


def residuals(
    content: Content,
    values: Mapping[str, float],
    experiment: Experiment,
    *,
    number: int = 0,
    accuracy: float = FIT_ACCURACY,
) -> np.ndarray | None:
    """Return (predicted - measured) / noise of every measured coordinate, shape (n,); None if there is no answer."""
    try:
        places = predict(content, experiment, values, number=number, accuracy=accuracy)
    except LdcsError:
        return None
    measured = np.isfinite(experiment.position)
    gap: np.ndarray = (places[measured] - experiment.position[measured]) / experiment.noise
    return gap


def linearised(
    content: Content,
    values: Mapping[str, float],
    experiment: Experiment,
    *,
    number: int = 0,
    accuracy: float,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the residuals and their derivatives by every value, shape (n, n_values), by the tangents of one run.

    A start of another experiment has no influence. None is returned if there is no answer.

    Raises:
        ValueError: The run has no tangents by one of the numbers.
    """
    try:
        solver = {"integrator": DEFAULT_INTEGRATOR, "accuracy": accuracy}
        begun = begin(content, values, number, experiment, solver)
    except LdcsError:
        return None
    simulation, start = begun.simulation, experiment.start
    paths = [path for path in scene_values(values)]
    names = [path for path in values if path not in paths]
    own: list[str | StartProfile] = []
    if start is not None:
        own += [f"inputs[0].pressure[{k}]" for k in range(len(start.pressure))]
        still = np.zeros(len(start.shapes))
        own += [StartProfile(f"displacement {k}", shape, still) for k, shape in enumerate(start.shapes.T)]
        own += [StartProfile(f"velocity {k}", still, shape) for k, shape in enumerate(start.shapes.T)]
    times = np.maximum(experiment.time, simulation.time)
    with one_thread():
        run = TangentRun(
            simulation,
            times,
            experiment.points,
            [*paths, *own],
            settled=experiment.settled,
            rest=begun.rest,
        )
        try:
            run.go()
        except LdcsError:
            return None
    measured = np.isfinite(experiment.position)
    shape = experiment.position.shape
    gap = (run.places.reshape(shape)[measured] - experiment.position[measured]) / experiment.noise
    slopes = run.values.reshape(*shape, -1)[measured] / experiment.noise
    whole = np.zeros((len(gap), len(values)))
    order = list(values)
    columns = [order.index(path) for path in paths]
    columns += [order.index(name) for name in names if name.startswith(f"start[{number}].")]
    whole[:, columns] = slopes
    return gap, whole


def no_tangents_reason(
    scene: Scene, parameters: Sequence[FitParameter], experiments: Sequence[Experiment]
) -> str | None:
    """Return why runs have no tangents, in words; None if they have."""
    simulation = scene.build()
    if simulation.integrator.name != DEFAULT_INTEGRATOR:
        return f"tangents need the method {DEFAULT_INTEGRATOR}, the scene has {simulation.integrator.name}"
    touching = [term.name for term in simulation.model.terms if term.contact_width < np.inf]
    if touching:
        return f"the slope of a contact jumps, and the scene has {touching[0]}"
    values = {one.path: one.start for one in parameters}
    for number, experiment in enumerate(experiments):
        brief = replace(experiment, time=experiment.time[:1], position=experiment.position[:1])
        try:
            linearised(scene.content, values, brief, number=number, accuracy=1e-3)
        except ValueError as error:
            return str(error)
    return None
