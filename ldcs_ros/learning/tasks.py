"""The tasks of the environment: targets of a point over time, all of which it can reach at rest."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ldcs_ros.learning.drives import Drives

INSIDE = 0.8
"""Targets stay within this fraction of the actions, so that feedback has room on both sides."""
_KNOTS = 16


@dataclass(frozen=True)
class EpisodeTarget:
    """A target over time.

    Attributes:
        first_action: Action under which the episode begins at rest, shape (n_arms,).
        curve: Times [s] -> positions in ldcs_base [m]; None for a constant one.
        place: The constant position [m], shape (3,).
    """

    first_action: np.ndarray
    place: np.ndarray
    curve: CubicSpline | None = None

    def position(self, time: float) -> np.ndarray:
        """Return the position at a time after the episode's start [m], shape (3,)."""
        return self.place if self.curve is None else np.asarray(self.curve(time))

    def velocity(self, time: float) -> np.ndarray:
        """Return the velocity at a time after the episode's start [m/s], shape (3,)."""
        return np.zeros(3) if self.curve is None else np.asarray(self.curve(time, 1))


class LearningTask(ABC):
    """A distribution of targets."""

    @abstractmethod
    def draw(self, drives: Drives, generator: np.random.Generator) -> EpisodeTarget:
        """Return a target; the simulation of `drives` is at rest.

        Raises:
            DivergenceError: A rest state was not found.
        """


class Reach(LearningTask):
    """One place for the whole episode, which begins at rest without commands."""

    def draw(self, drives: Drives, generator: np.random.Generator) -> EpisodeTarget:
        action = generator.uniform(-INSIDE, INSIDE, drives.count)
        return EpisodeTarget(np.full(drives.count, -1.0), drives.rest_positions(action[None])[0])


class Follow(LearningTask):
    """A closed curve of rest positions in 4 to 8 s, each command a sine; the episode begins at rest on it."""

    def draw(self, drives: Drives, generator: np.random.Generator) -> EpisodeTarget:
        period = generator.uniform(4.0, 8.0)
        amplitude = generator.uniform(0.2, 0.5 * INSIDE, drives.count)
        middle = generator.uniform(amplitude - INSIDE, INSIDE - amplitude)
        phase = generator.uniform(0.0, 2.0 * np.pi, drives.count)
        times = np.linspace(0.0, period, _KNOTS + 1)
        actions = middle + amplitude * np.sin(2.0 * np.pi * times[:, None] / period + phase)
        places = drives.rest_positions(actions[:-1])
        curve = CubicSpline(times, np.vstack([places, places[:1]]), bc_type="periodic")
        return EpisodeTarget(actions[0], places[0], curve)


TASKS: dict[str, LearningTask] = {"reach": Reach(), "follow": Follow()}
