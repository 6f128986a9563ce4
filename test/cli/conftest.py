"""A small scene with arms, payload and tracker, and a way to run `ldcs` in this process."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from ldcs_ros.cli.main import main

SCENE = """\
title: A small sheet for tests
lattice: {size: [0.140, 0.140, 0.010], nodes: [5, 5], mass: 0.160}
points: {P0: [mid, centre], P1: [mid, free_edge]}
effects:
  - {type: springs, law: axial, stiffness: 80.0, damping: 5.0}
  - {type: gravity}
  - {type: clamp, edge: x_min}
  - {type: payload, at: P1, mass: 0.010}
  - {type: arms, drive: torque}
inputs:
  - {time: 0.0, torque: 0.1}
sensors:
  tracker: {points: [P0, P1], rate: 80.0, noise: 1.0e-4, seed: 1}
solver: {integrator: auto, accuracy: 1.0e-4}
"""


class Outcome(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def ldcs(capsys):
    """Call `ldcs` with words; returns exit status, stdout and stderr."""

    def call(*words):
        capsys.readouterr()
        status = main([str(word) for word in words])
        return Outcome(status, *capsys.readouterr())

    return call


@pytest.fixture
def refused(ldcs):
    """Call `ldcs` with bad input: exit status 2, one line on stderr, nothing on stdout; returns the line."""

    def call(*words):
        outcome = ldcs(*words)
        assert outcome.status == 2, outcome
        assert outcome.out == ""
        assert outcome.err.startswith("ldcs: error: ") and outcome.err.count("\n") == 1, outcome.err
        return outcome.err

    return call
