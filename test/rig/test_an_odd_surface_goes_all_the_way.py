"""A scene of the contract's keys through every program: run, replayed, drawn, a rig beside it, its gains identified."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from rig_bench import Bench

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.mock_rig.rig import Hidden
from ldcs_ros.rig.rig_bag import RigBag

ARMS = ("port", "slant", "starboard")
GAINS = {"port": 1.1e-6, "slant": 0.8e-6, "starboard": 0.95e-6}


def odd(gains, **more):
    """A sheet with a hole, regions, clamps on parts of an edge, two payloads and three unlike arms."""
    arms = [
        {"name": "port", "from": [0.0, 0.05], "to": [0.175, 0.052]},
        {"name": "slant", "from": [0.0, 0.005], "to": [0.09, -0.03], "links": 3},
        {"name": "starboard", "from": [0.005, -0.05], "to": [0.17, -0.045], "joint_stiffness": 0.35},
    ]
    return {
        "lattice": {
            "size": [0.180, 0.110, 0.006],
            "nodes": [8, 5],
            "holes": [{"polygon": [[0.10, -0.02], [0.14, -0.02], [0.14, 0.015]]}],
            "regions": [
                {"box": [0.0, -0.055, 0.04, 0.055], "stiffness": 2.0, "mass": 1.2},
                {"circle": [0.15, 0.035, 0.025], "thickness": 1.3, "damping": 2.0},
            ],
        },
        "material": {"youngs_modulus": 150e3, "poisson": 0.35, "density": 1070.0, "relaxation_time": 0.05},
        "points": {
            "tip": {"x": 0.180, "y": 0.0},
            "corner": {"x": 0.173, "y": 0.048, "layer": "top"},
            "inner": {"x": 0.0813, "y": -0.0117},
        },
        "effects": [
            {"type": "springs"},
            {"type": "gravity"},
            {"type": "clamp", "edge": "x_min", "between": [-0.055, -0.01]},
            {"type": "clamp", "edge": "x_min", "between": [0.01, 0.055]},
            {"type": "payload", "at": {"x": 0.180, "y": 0.0, "layer": "top"}, "mass": 0.010},
            {"type": "payload", "at": {"x": 0.150, "y": 0.04, "layer": "bottom"}, "mass": 0.005},
            {
                "type": "arms",
                "drive": "pressure",
                "joint_stiffness": 0.3,
                "arms": [{**arm, "pressure_gain": gains[arm["name"]]} for arm in arms],
            },
        ],
        "sensors": {
            "tracker": {"points": ["tip", "corner", "inner"], "rate": 80.0, "noise": 1e-4, "seed": 1},
            "pressure": {"rate": 100.0},
        },
        "solver": {"accuracy": 1e-4},
        **more,
    }


WRONG = dict.fromkeys(ARMS, 1.3e-6)
FITS = [word for arm in ARMS for word in ("--fit", f"effects.arms.arms.{arm}.pressure_gain=5e-7..2e-6")]


def identified(capsys, bag, scene):
    """Fit the three gains from wrong ones; return value and interval by arm."""
    capsys.readouterr()
    main(["identify", str(bag), "--scene", str(scene), "--starts", "1", "--processes", "1", "--json", *FITS])
    found = json.loads(capsys.readouterr().out)["parameters"]
    return {one["path"].split(".")[3]: one for one in found}


@pytest.fixture
def wrong(tmp_path):
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump(odd(WRONG), sort_keys=False))
    return path


@pytest.mark.timeout(300)  # a busy machine draws and fits for long
def test_it_runs_replays_is_drawn_and_its_gains_are_found_within_their_intervals(tmp_path, wrong, capsys):
    schedule = [
        {"time": 0.0, "pressure": [90e3, 20e3, 40e3]},
        {"time": 0.35, "pressure": [40e3, 110e3, 20e3]},
    ]
    scene = tmp_path / "odd.yaml"
    scene.write_text(yaml.safe_dump(odd(GAINS, inputs=schedule), sort_keys=False))
    bag, again, pictures = (str(tmp_path / name) for name in ("bag", "again", "pictures"))
    assert main(["simulate", str(scene), "--duration", "0.7", "--bag", bag]) == 0
    assert main(["replay", bag, "--bag", again]) == 0
    assert "the same bytes" in capsys.readouterr().out
    assert main(["plot", bag, "-o", pictures]) == 0
    for arm, one in identified(capsys, bag, wrong).items():
        assert one["low"] < GAINS[arm] < one["high"], (arm, one)
        assert one["high"] - one["low"] < 0.02 * GAINS[arm]


def test_a_rig_of_it_takes_three_pressures_and_its_bag_gives_the_gains(tmp_path, wrong, clock, capsys):
    content = odd(WRONG)
    bench = Bench("topics", clock=clock, scene=content, hidden=Hidden(1.0, 0.8, 0.0))
    bench.bridge.bag = RigBag(
        tmp_path / "rig",
        namespace="/ldcs",
        arms=ARMS,
        custom_data={"rig": bench.rig_file.text, "scene": bench.bridge.twin.scene.text},
    )
    bench.pressurise(60e3, 20e3, 40e3)
    for asked in ([60e3, 30e3, 40e3], [30e3, 80e3, 20e3]):
        bench.operator = asked
        bench.run(0.9)
        assert bench.rig.pressure == pytest.approx(np.array(asked), rel=0.1)
    bench.bridge.bag.close()
    for arm, one in identified(capsys, tmp_path / "rig", wrong).items():
        assert one["value"] == pytest.approx(0.8 * WRONG[arm], rel=0.03), (arm, one)


def test_its_places_stay_where_they_are_on_a_finer_mesh():
    coarse, fine = (load_scene(odd(GAINS)).edited({"lattice.nodes": n}).build() for n in ([8, 5], [19, 12]))
    for name in ("tip", "inner"):
        np.testing.assert_allclose(coarse.pose(name)[0], fine.pose(name)[0], atol=1e-12)
    # At the border of the thicker region only the height differs, by the cells that belong to it.
    np.testing.assert_allclose(coarse.pose("corner")[0][:2], fine.pose("corner")[0][:2], atol=1e-12)
