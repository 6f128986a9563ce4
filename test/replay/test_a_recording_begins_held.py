"""A table begins at rest under the commands of its first row: nothing moves until they change."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.bags import read_bag
from ldcs_ros.cli.main import main
from ldcs_ros.signals.tracks import point_tracks

COLUMNS = ("time=t", "pressure_command=l,r:kPa", "P1=x,y,z")


@pytest.mark.parametrize(("initial", "largest"), [("held", 1e-6), ("rest", 1.0)])
def test_constant_pressure_moves_nothing_from_the_state_that_it_holds(tmp_path, initial, largest):
    rows = [f"{0.02 * k},60,80,0.14,0,0" for k in range(11)]
    (tmp_path / "lab.csv").write_text("\n".join(["t,l,r,x,y,z", *rows]) + "\n")
    words = ["replay", str(tmp_path / "lab.csv"), "--scene", "rig", "--bag", str(tmp_path / "twin")]
    assert main([*words, "--columns", *COLUMNS, f"initial={initial}"]) == 0
    track = point_tracks(read_bag(tmp_path / "twin"), truth=True)["P1"]
    moved = np.abs(track.value - track.first).max()
    assert moved <= largest
    assert initial == "held" or moved > 1e-3
