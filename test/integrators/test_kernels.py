"""Kernels are executed by Python against formulas of dense matrices, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ldcs_ros.physics.compiled import HAVE_NUMBA


@pytest.mark.skipif(not HAVE_NUMBA, reason="some kernels are reached with numba only")
def test_executed_kernels_satisfy_their_formulas():
    files = sorted(map(str, Path(__file__).parent.glob("kernel_*.py")))
    assert len(files) == 3
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--timeout=0", *files],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout
