"""The modes of a scene's sheet: main directions of its equilibria over pressures, loads and stiffnesses."""

from __future__ import annotations

import itertools

import numpy as np

from ldcs_ros.errors import DivergenceError
from ldcs_ros.scene import Scene

PRESSURES = tuple((fraction, fraction) for fraction in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)) + (
    (0.7, 0.4),
    (0.4, 0.7),
    (0.8, 0.6),
    (0.6, 0.8),
)
"""Gauge pressures left and right, as fractions of the scene's limit."""
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
    limit = float(scene.effect("arms").pressure_limit)
    for stiffness, load in itertools.product(STIFFNESSES, LOADS):
        simulation = loaded(scene, point, load / GRAVITY, stiffness).build()
        for fraction in PRESSURES:
            simulation.inputs.set_pressure(tuple(limit * one for one in fraction))
            try:
                simulation.settle()
            except DivergenceError:
                continue
            state = simulation.state
            found.append(np.concatenate([state.position.ravel(), state.link_angle.ravel()]))
    if len(found) < len(PRESSURES):
        raise DivergenceError(
            "the scene comes to rest under hardly any load: there are no modes to estimate with"
        )
    return np.array(found)


def main_directions(samples: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of samples, shape (n,), and their main directions around it, orthonormal, shape (count, n)."""
    mean = samples.mean(axis=0)
    _, _, directions = np.linalg.svd(samples - mean, full_matrices=False)
    return mean, directions[:count]


def loaded(scene: Scene, point: str, mass: float, stiffness: float) -> Scene:
    """Return a scene with another mass [kg] at a point, a factor on its springs, and no schedule."""
    content = scene.content
    effects = content["effects"]
    for block in effects:
        if block["type"] == "springs":
            block["stiffness"] = stiffness * scene.effect("springs").stiffness
    if mass > 0.0:
        effects.append({"type": "payload", "at": point, "mass": mass})
    return scene.edited(effects=effects, inputs=None)
