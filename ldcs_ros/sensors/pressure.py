"""The pressure sensors of the arms: gauge pressure at their own rate, with noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldcs_ros.errors import SceneError
from ldcs_ros.schema.fields import check_fields, quantity
from ldcs_ros.sensors.ticks import Ticks


@dataclass(frozen=True)
class PressureSensorParameters:
    """The parameters of the pressure sensors.

    Attributes:
        rate: Measurements per second [Hz].
        noise: Standard deviation [Pa].
        seed: Seed of the noise.
    """

    rate: float = quantity(100.0, "Hz", "measurements per second", low=1e-3, high=1e4)
    noise: float = quantity(0.0, "Pa", "standard deviation", low=0.0, high=1e6)
    seed: int = quantity(2, "", "seed of the noise", low=0, high=2**63 - 1)

    def __post_init__(self) -> None:
        check_fields(self, "sensors.pressure", SceneError)


class PressureSensor:
    """Measures the gauge pressure of every arm at its ticks.

    Args:
        parameters: Parameters of the scene.
        generator: Source of the noise; each tick draws one number an arm.
        start: Time of the first possible tick [s].
    """

    def __init__(
        self, parameters: PressureSensorParameters, generator: np.random.Generator, start: float = 0.0
    ) -> None:
        self.parameters = parameters
        self._generator = generator
        self._ticks = Ticks.starting_at(parameters.rate, start)

    @property
    def next_tick(self) -> float:
        """Time of the next measurement [s]."""
        return self._ticks.time

    def measure(self, pressure: np.ndarray) -> np.ndarray:
        """Return the report at the present tick for gauge pressures [Pa] of shape (n_arms,)."""
        self._ticks.advance()
        pressure = np.asarray(pressure, dtype=float)
        return pressure + self._generator.normal(0.0, 1.0, pressure.shape) * self.parameters.noise
