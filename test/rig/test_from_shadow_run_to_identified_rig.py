"""From a rig beside the twin to a recorded bag, a comparison and the rig's own numbers."""

from __future__ import annotations

import json

import pytest
import yaml
from rig_bench import SMALL, Bench

from ldcs_ros.bags import read_bag
from ldcs_ros.cli.main import main
from ldcs_ros.mock_rig.rig import Hidden
from ldcs_ros.rig.rig_bag import RigBag
from ldcs_ros.twin.recorder import Recorder


@pytest.fixture
def bags(tmp_path, clock):
    """Two bags of one shadow run: the twin's and the rig's."""
    bench = Bench("topics", mode="shadow", clock=clock, controller="steps", hidden=Hidden(1.2, 0.85, 0.0))
    bench.rig.course_start = clock() + 0.5
    twin = bench.bridge.twin
    recorder = Recorder(tmp_path / "twin", twin, namespace="/ldcs")
    twin.sinks.append(recorder)
    bench.bridge.bag = RigBag(
        tmp_path / "rig",
        namespace="/ldcs",
        arms=("left", "right"),
        custom_data={"rig": bench.rig_file.text, "scene": twin.scene.text},
    )
    bench.run(5.0)
    bench.bridge.bag.close()
    recorder.close()
    return tmp_path / "twin", tmp_path / "rig"


def test_the_bags_compare_and_the_hidden_numbers_are_found(bags, tmp_path, capsys):
    twin, rig = bags
    assert main(["compare", str(twin), str(rig), "-o", str(tmp_path / "report"), "--json"]) == 0
    assert '"P1"' in capsys.readouterr().out and (tmp_path / "report" / "compare.png").is_file()
    scene = tmp_path / "small.yaml"
    scene.write_text(yaml.safe_dump(SMALL))
    fits = ["effects.arms.pressure_gain=5e-7..2e-6", "effects.springs.stiffness=50..130"]
    words = ["identify", str(rig), "--scene", str(scene), "--starts", "1", "--processes", "1", "--json"]
    for fit in [*fits, "effects.arms.dead_time=0..0.06"]:
        words += ["--fit", fit]
    main(words)
    out, validation_error = capsys.readouterr()
    assert out, validation_error
    found = json.loads(out)
    values = {one["path"]: one["value"] for one in found["parameters"]}
    assert values["effects.arms.pressure_gain"] == pytest.approx(0.85e-6, rel=0.03)
    assert values["effects.springs.stiffness"] == pytest.approx(96.0, rel=0.05)


def test_raw_messages_of_the_rig_are_in_its_bag_as_they_came(bags):
    _, rig = bags
    recording = read_bag(rig)
    raw = recording.channels["/rig/left/pressure"]
    assert raw.type == "sensor_msgs/msg/FluidPressure" and len(raw) > 300
    assert raw.messages[0].header.stamp.sec >= 1000
