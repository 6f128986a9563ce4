"""`ldcs simulate --settle` of a scene that comes to rest only later: time begins when its rises are over."""

from __future__ import annotations

import json

from ldcs_ros.bags import read_bag


def test_a_run_from_rest_begins_when_the_rises_are_over(ldcs, tmp_path):
    words = ("simulate", "arc", "--settle", "--duration", "0.1", "--set", "lattice.nodes=[5,5]")
    report = json.loads(ldcs(*words, "--bag", tmp_path / "bag", "--json").out)
    assert round(report["simulated"], 9) == 0.1 and report["time"] == 1.1
    times = read_bag(tmp_path / "bag").channels["/ldcs/nodes"].times
    assert times.tolist() == [1_000_000_000 + 20_000_000 * k for k in range(6)]
