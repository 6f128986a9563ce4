"""The modes of a scene's sheet: main directions of its equilibria over pressures, loads and stiffnesses."""

from __future__ import annotations

import itertools

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.scene import Scene
from ldcs_ros.simulation.simulation import Simulation

COMMON_PRESSURES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Gauge pressures of all arms alike, as fractions of their limits."""
SINGLE_PRESSURES = ((0.7, 0.4), (0.2, 0.5), (0.3, 0.1))
"""Gauge pressures of one arm and of the others, likewise."""
GRAVITY = 9.81
LOADS = (0.0, 0.3)
STIFFNESSES = (0.8, 1.25)


def equilibria(scene: Scene, point: str) -> np.ndarray:
    """Return the coordinates [m, rad] of equilibria, shape (n, n_coordinates).

    Args:
        scene: A scene whose arms are driven by pressure.
        point: Point that carries the loads.

    Raises:
        DivergenceError: Hardly any equilibrium was found.
    """
    found = []
    patterns: list[np.ndarray] = []
    for stiffness, load in itertools.product(STIFFNESSES, LOADS):
        simulation = loaded(scene, point, load / GRAVITY, stiffness).build()
        patterns = pressure_patterns(simulation)
        for pattern in patterns:
            simulation.inputs.set_pressure(pattern)
            try:
                simulation.settle()
            except DivergenceError:
                continue
            found.append(simulation.last_step.at(simulation.time, simulation.model).q)
    if len(found) < len(patterns):
        raise DivergenceError(
            "the scene comes to rest under hardly any load: there are no modes to estimate with"
        )
    return np.array(found)


def pressure_patterns(simulation: Simulation) -> list[np.ndarray]:
    """Return gauge pressures of all arms [Pa], shape (n_arms,) each: all alike, then each arm beside the others."""
    arms = simulation.model.arms
    assert arms is not None
    limit = np.array([own.pressure_limit for own in arms.each])
    patterns = [fraction * limit for fraction in COMMON_PRESSURES]
    for one, others in SINGLE_PRESSURES:
        patterns += [np.where(unit > 0.0, one, others) * limit for unit in np.eye(len(limit))]
    return patterns


def main_directions(samples: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of samples, shape (n,), and their main directions around it, orthonormal, shape (count, n)."""
    mean = samples.mean(axis=0)
    _, _, directions = np.linalg.svd(samples - mean, full_matrices=False)
    return mean, directions[:count]


def loaded(scene: Scene, point: str, mass: float, stiffness: float) -> Scene:
    """Return a scene with another mass [kg] at a point, a factor on its springs, and no schedule."""
    effects = scene.content["effects"]
    if mass > 0.0:
        effects.append({"type": "payload", "at": point, "mass": mass})
    return scene.edited(effects=effects, inputs=None).stiffened(stiffness)
