"""The answer of a scene to the commands of an experiment, and its distance from the measurements."""

from __future__ import annotations

from typing import Any

import numpy as np

from ldcs_ros.errors import LdcsError
from ldcs_ros.identify.experiments import Experiment
from ldcs_ros.scene import load_scene
from ldcs_ros.schema.paths import with_values
from ldcs_ros.twin.commands import Commands

# Adaptive steps change with the parameters, and the answer with them by up to the accuracy. At the usual 1e-5 m the
# error of a difference over 1e-4 of a value is 0.05 to 0.4 %. A bias of 6e-6 m then exceeds the noise of 1e-4 m
# averaged over a bag. At 1e-7 m both are below 1e-4 of that, at 1.7 times the cost (on the scene paper_calibrated).
# Fixed steps would have to be short everywhere because of the discontinuities after commands.
FIT_ACCURACY = 1e-7


def predict(content: dict[str, Any], experiment: Experiment, *, accuracy: float = FIT_ACCURACY) -> np.ndarray:
    """Return the positions of a scene's points at the experiment's times [m], shape (n, n_points, 3).

    Raises:
        LdcsError: The scene is not sound, or cannot follow the commands.
    """
    # The commands are known: the bag's schedule replaces the scene's.
    scene = load_scene({**content, "inputs": list(experiment.schedule)})
    simulation = scene.with_accuracy(accuracy).build()
    if experiment.settled:
        simulation.settle()
    receiver = Commands(simulation)
    points = [simulation.points[name] for name in experiment.points]
    places = np.empty((len(experiment.time), len(points), 3))
    waiting = list(reversed(experiment.commands))
    for row, time in enumerate(experiment.time):
        while waiting and waiting[-1][0] <= time:
            due, topic, cdr = waiting.pop()
            simulation.advance_to(max(due, simulation.time))
            receiver.receive(topic, cdr)
        simulation.advance_to(max(float(time), simulation.time))
        position = simulation.state.position
        for number, point in enumerate(points):
            places[row, number] = point.position(position)
    return places


def residuals(
    content: dict[str, Any],
    values: dict[str, float],
    experiment: Experiment,
    *,
    accuracy: float = FIT_ACCURACY,
) -> np.ndarray | None:
    """Return (predicted - measured) / noise of every measured coordinate, shape (n,); None if there is no answer."""
    try:
        places = predict(with_values(content, values), experiment, accuracy=accuracy)
    except LdcsError:
        return None
    measured = np.isfinite(experiment.position)
    gap: np.ndarray = (places[measured] - experiment.position[measured]) / experiment.noise
    return gap
