"""Sweeps: a scene at many values of its numbers and commands; a table of what was measured, and Sobol indices."""

from __future__ import annotations

from ldcs_ros.sweep.design import Design, Factor, Sampling, SweepError
from ldcs_ros.sweep.indices import SobolIndices, sobol_indices
from ldcs_ros.sweep.sweep import Sweep, SweepResult, run_sweep

__all__ = [
    "Design",
    "Factor",
    "Sampling",
    "SobolIndices",
    "Sweep",
    "SweepError",
    "SweepResult",
    "run_sweep",
    "sobol_indices",
]
