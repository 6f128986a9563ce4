"""From a rig's bag to a report: commands replayed, clocks aligned, and what is left is the tracker's noise."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from rig_bag import WALL, array, transform, write
from small_sheet import small_sheet

from ldcs_ros import load_scene
from ldcs_ros.cli.main import main
from ldcs_ros.messages.cdr import decode
from ldcs_ros.messages.messages import pressure_command
from ldcs_ros.twin.twin import Twin

SCENE = small_sheet()
MAPPING = """\
commands:
  - {topic: /valves/setpoint, to: pressure_command, unit: mbar, arms: [right, left]}
measurements:
  - {topic: /trakstar_msg, to: P0, child: trakstar0, translation: [0.05, 0, 0], rotation: [0, 1, 0, 0]}
  - {topic: /trakstar_msg, to: P1, child: trakstar1, translation: [0.05, 0, 0], rotation: [0, 1, 0, 0]}
"""
DRIVER_AHEAD = 4_400_000_000  # ns
DELAY = 0.02  # s


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A folder with the bag of a rig whose driver has a clock of its own, its mapping file, and the scene."""
    folder = tmp_path_factory.mktemp("rig")
    content = {**SCENE, "sensors": {"tracker": {**SCENE["sensors"]["tracker"], "delay": DELAY}}}
    draw, messages = np.random.default_rng(1), []

    def hear(topic, kind, cdr, time):
        if not topic.endswith("/pose") or topic.startswith("truth"):
            return
        message = decode(kind, cdr)
        place, stamp = message.pose.position, message.header.stamp
        probe = f"trakstar{topic[1]}"
        stamp = WALL + stamp.sec * 10**9 + stamp.nanosec + DRIVER_AHEAD
        # The transmitter stands half turned 50 mm along the sheet.
        report = transform(stamp, probe, (0.05 - place.x, place.y, -place.z))
        copies = int(draw.choice([0, 1, 1, 1, 1, 1, 1, 1, 1, 2]))
        messages.extend([("/trakstar_msg", WALL + time + int(draw.uniform(0, 3e6)), report)] * copies)

    twin = Twin(load_scene(content))
    twin.settle()
    twin.sinks.append(hear)
    for k in range(200):
        time = k / 100.0
        left, right = 60e3 - 40e3 * np.cos(6.0 * time + 2.0 * time**2), 60e3 - 40e3 * np.cos(5.0 * time)
        twin.advance_to(time)
        twin.receive("pressure_command", pressure_command(np.array([left, right])))
        messages.append(("/valves/setpoint", WALL + round(time * 1e9), array([right / 100, left / 100])))
    twin.advance_to(2.2)
    write(folder / "bag", sorted(messages, key=lambda message: message[1]), storage="sqlite3")
    (folder / "topics.yaml").write_text(MAPPING)
    (folder / "scene.yaml").write_text(yaml.safe_dump(SCENE))
    return folder


def run(capsys, *words):
    assert main([str(word) for word in words]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(("stiffness", "least", "most"), [(80.0, 0.0, 2.5e-4), (60.0, 8e-4, 1e-1)])
def test_what_is_left_between_rig_and_twin_is_noise_if_the_model_is_right(
    rig, tmp_path, capsys, stiffness, least, most
):
    fed = run(
        capsys,
        *("replay", rig / "bag", "--scene", rig / "scene.yaml", "--map", rig / "topics.yaml"),
        *("--bag", tmp_path / "twin", "--set", f"effects.springs.stiffness={stiffness}", "--json"),
    )
    assert fed["commands"]["applied"] == 200 and not fed["commands"]["refused"]
    words = (
        "compare",
        tmp_path / "twin",
        rig / "bag",
        "--map-b",
        rig / "topics.yaml",
        "-o",
        tmp_path / "report",
    )
    compared = run(capsys, *words, "--json")
    # What a constant offset can tell: the delay of the tracker behind the valves.
    assert compared["offset"]["value"] == pytest.approx(DELAY, abs=3e-3)
    assert least < compared["channels"]["P1"]["figures"]["distance"]["rms"] < most
    remark = compared["remarks"]["bag"][0]
    assert "with stamp and content of an earlier one" in remark and "+4.38" in remark
    assert compared["only"] == ["only in twin: left/pressure, right/pressure, 8 joints, surface"]
