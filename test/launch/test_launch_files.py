"""The launch files, executed: arguments are explained, processes exist and take their arguments."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")
sys.path.insert(0, str(Path(__file__).parent))

import stand_in

from ldcs_ros.ros.rig.rig_parameters import BRIDGE_PARAMETERS, MOCK_RIG_PARAMETERS
from ldcs_ros.ros.sim.parameters import PARAMETERS

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "ldcs_ros/launch"
FILES = sorted(path.name for path in FOLDER.glob("*.py"))
TABLES = {"sim": PARAMETERS, "bridge": BRIDGE_PARAMETERS, "mock_rig": MOCK_RIG_PARAMETERS}
# Arguments that a launch requires.
REQUIRED = {"replay.launch.py": {"bag": str(ROOT / "bags/impulse")}}


@pytest.fixture
def launch(monkeypatch):
    """Return a function that executes a launch file with arguments."""
    stand_in.install(monkeypatch)

    def execute(name, **given):
        spec = importlib.util.spec_from_file_location(name.replace(".", "_"), FOLDER / name)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        context = stand_in.LaunchContext(**{**REQUIRED.get(name, {}), **given})
        return stand_in.Launched(context).visit(module.generate_launch_description().entities)

    yield execute
    sys.modules.pop("ldcs_ros.ros.common.launching", None)


def console_scripts():
    """Return the executables that setup.py installs."""
    for node in ast.walk(ast.parse((ROOT / "setup.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.List) and node.elts and "= ldcs_ros." in ast.unparse(node):
            return {element.value.split(" = ")[0] for element in node.elts}
    raise AssertionError("no entry points in setup.py")


def every_start(launch, name):
    """Return what a launch file starts, one way or another."""
    for given in ({}, {"live": "true"}, {"rig": "valve_island"}, {"graph": "x"}, {"foxglove": "true"}):
        launched = launch(name, **given)
        started = list(launched.started)
        for executable in list(launched.handlers):
            launched.say(executable, b"running")
        yield from (*started, *launched.started)


@pytest.mark.parametrize("name", FILES)
def test_each_argument_has_a_meaning_and_a_default(launch, name):
    for argument in launch(name).declared:
        assert argument.description and len(argument.description) > 10, argument.name
        assert (argument.default_value is None) == (argument.name in REQUIRED.get(name, {})), argument.name


@pytest.mark.parametrize("name", FILES)
def test_what_is_started_exists_and_takes_its_parameters(launch, name):
    scripts = console_scripts()
    for started in every_start(launch, name):
        if started.package == "ldcs_ros":
            assert started.executable in scripts
            table = TABLES[started.executable]
            for parameter, value in started.parameters.items():
                assert type(value) is type(table[parameter].default), parameter
        elif started.package is None and ":" in started.command[0]:
            package, executable = started.command[0].split(":")
            assert package == "ldcs_ros" and executable in scripts


@pytest.mark.parametrize("name", FILES)
def test_the_files_that_are_named_are_shipped(launch, name):
    for started in every_start(launch, name):
        for word in started.command:
            if word.startswith("SHARE(ldcs_ros)/"):
                assert (ROOT / "ldcs_ros" / word.removeprefix("SHARE(ldcs_ros)/")).is_file()


def test_only_what_was_given_reaches_the_node_and_before_its_file(launch, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("{}")
    (twin,) = launch("sim.launch.py").started
    assert (twin.parameters, twin.files, twin.namespace) == ({}, [], "/ldcs")
    given = {
        "scene": "rig",
        "duration": "2",
        "publish_clock": "true",
        "params_file": str(file),
        "namespace": "/left",
    }
    (twin,) = launch("sim.launch.py", **given).started
    assert twin.parameters == {"scene": "rig", "duration": 2.0, "publish_clock": True}
    assert twin.files == [str(file)] and twin.namespace == "/left" and twin.ends_all


def test_a_parameter_file_that_is_missing_ends_the_launch(launch):
    for name in ("sim.launch.py", "record.launch.py", "rig.launch.py"):
        with pytest.raises((FileNotFoundError, RuntimeError), match=r"absent.yaml"):
            launch(name, params_file="absent.yaml", rig="valve_island")


def test_a_process_that_fails_fails_the_launch(launch):
    recorder, twin = launch("record.launch.py", record="out/mine", graph="out/graph").started
    for started in (recorder, twin):
        with pytest.raises(RuntimeError, match="has ended with status 2"):
            started.ended(2)
    assert twin.ends_all and not recorder.ends_all
    (player,) = launch("view.launch.py", rviz="false", bag="out/x").started
    with pytest.raises(RuntimeError, match="ros2 bag play has ended with status 1"):
        player.ended(1)


def test_a_process_that_a_ctrl_c_ended_is_no_failure(launch):
    launched = launch("record.launch.py", record="out/mine", graph="out/graph")
    launched.context.is_shutdown = True
    assert all(not isinstance(started.ended(-2), Exception) for started in launched.started)


def test_record_records_without_being_told_where(launch):
    (twin,) = launch("record.launch.py").started
    assert twin.parameters["record"].startswith("out/")
    recorder, twin = launch("record.launch.py", record="out/mine", graph="out/graph").started
    assert twin.parameters["record"] == "out/mine"
    assert recorder.command[:3] == ["ros2", "bag", "record"] and recorder.command[-1] == "out/graph"


def test_the_bridge_waits_for_the_mock_rig(launch):
    launched = launch("rig.launch.py", mode="live", scene="rig", load="0.01")
    (rig,) = launched.started
    rig_file = Path(rig.parameters["rig_file"])
    assert rig.parameters == {"controller": "remote", "scene": "rig", "load": 0.01, "rig_file": str(rig_file)}
    launched.say("mock_rig", b"rig: not yet")
    assert len(launched.started) == 1
    rig_file.write_text("links: []")
    launched.say("mock_rig", b"rig: ready")
    launched.say("mock_rig", b"rig: left 0.0 kPa")
    _, bridge = launched.started
    assert bridge.parameters == {"mode": "live", "scene": "rig", "rig": str(rig_file)}
    assert rig.ends_all and bridge.ends_all


def test_a_real_rig_needs_no_mock_rig(launch):
    (bridge,) = launch("rig.launch.py", rig="my_rig.yaml", mode="mirror").started
    assert bridge.executable == "bridge" and bridge.parameters == {"rig": "my_rig.yaml", "mode": "mirror"}


@pytest.mark.parametrize("section", ["/**", "/ldcs/ldcs_bridge", "/*/ldcs_bridge", "/**/ldcs_bridge"])
def test_the_rig_of_a_parameter_file_is_followed_without_a_mock_rig(launch, tmp_path, section):
    path = tmp_path / "bridge.yaml"
    path.write_text(f"{section}: {{ros__parameters: {{rig: my_rig.yaml, mode: live}}}}")
    (bridge,) = launch("rig.launch.py", params_file=str(path)).started
    assert bridge.executable == "bridge" and bridge.files == [str(path)]
    assert "rig" not in bridge.parameters, "the file decides"


def test_the_shipped_parameter_file_of_the_bridge_starts_no_mock_rig(launch):
    (bridge,) = launch("rig.launch.py", params_file=str(ROOT / "ldcs_ros/config/bridge.yaml")).started
    assert bridge.executable == "bridge"


@pytest.mark.parametrize(
    "text", ["/other/node: {ros__parameters: {rig: r.yaml}}", "/**: {ros__parameters: {mode: live}}"]
)
def test_a_parameter_file_without_a_rig_leaves_the_mock_rig(launch, tmp_path, text):
    path = tmp_path / "bridge.yaml"
    path.write_text(text)
    (rig,) = launch("rig.launch.py", params_file=str(path)).started
    assert rig.executable == "mock_rig"
    assert rig.parameters.get("controller") == ("remote" if "live" in text else None)


def test_a_bag_commands_a_live_twin_of_its_own_scene(launch):
    from ldcs_ros import load_scene
    from ldcs_ros.bags import read_bag

    (exact,) = launch("replay.launch.py", output="out/again").started
    assert exact.command == ["ldcs_ros:ldcs", "replay", str(ROOT / "bags/impulse"), "--bag", "out/again"]
    launched = launch("replay.launch.py", live="true", output="out/live")
    (twin,) = launched.started
    recording = read_bag(ROOT / "bags/impulse")
    assert load_scene(twin.parameters["scene"]).text == recording.custom_data["scene_complete"]
    assert twin.parameters["record"] == "out/live" and twin.parameters["duration"] > recording.end / 1e9
    launched.say("sim", b"not installed, left out: tf2_msgs")
    assert len(launched.started) == 1
    launched.say("sim", b"t 1.980 s 0.99x P0 (68.76 0.00 11.69) mm running")
    launched.say("sim", b"t 3.980 s 0.99x P0 (68.76 0.00 11.69) mm running")
    _, player = launched.started
    assert player.command[-2:] == ["--topics", "/ldcs/external_wrench"]


def test_viewers_are_a_choice(launch):
    (rviz,) = launch("view.launch.py").started
    assert rviz.package == "rviz2"
    foxglove, player = launch("view.launch.py", rviz="false", foxglove="true", bag="out/x").started
    assert foxglove.package == "foxglove_bridge" and player.command[-1] == "out/x"
    assert foxglove.parameters["address"] == "127.0.0.1"


def test_rviz_shows_a_twin_of_any_namespace(launch):
    (rviz,) = launch(
        "view.launch.py", namespace="/left", display=str(ROOT / "ldcs_ros/config/ldcs.rviz")
    ).started
    display = Path(rviz.command[-1]).read_text(encoding="utf-8")
    assert "Value: /left/surface" in display and "/ldcs/" not in display


def test_the_stand_ins_have_the_names_and_arguments_of_the_real_ones():
    pytest.importorskip("launch_ros", reason="launch is not installed")
    for module, members in stand_in.MODULES.items():
        for member in members:
            real = getattr(import_module(module), member.__name__)
            known = {
                name
                for cls in real.__mro__
                if "__init__" in vars(cls)
                for name in inspect.signature(cls.__init__).parameters
            }
            used = {name for name in inspect.signature(member.__init__).parameters if name != "given"}
            assert used <= known, member


def test_the_real_launch_runs_the_twin_to_its_end(tmp_path):
    pytest.importorskip("launch_ros", reason="launch is not installed")
    prefix = tmp_path / "prefix"
    for folder in ("share/ament_index/resource_index/packages", "lib/ldcs_ros", "share/ldcs_ros"):
        (prefix / folder).mkdir(parents=True)
    (prefix / "share/ament_index/resource_index/packages/ldcs_ros").touch()
    sim = prefix / "lib/ldcs_ros/sim"
    sim.write_text(f'#!/bin/sh\nexec {sys.executable} -m ldcs_ros.ros sim "$@"\n')
    sim.chmod(0o755)
    program = f"""
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
given = [('scene', 'arc'), ('duration', '0.2'), ('record', {str(tmp_path / "bag")!r})]
source = PythonLaunchDescriptionSource({str(FOLDER / "sim.launch.py")!r})
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(source, launch_arguments=given)]))
sys.exit(service.run())
"""
    paths = os.pathsep.join([str(prefix), os.environ.get("AMENT_PREFIX_PATH", "")])
    environment = {**os.environ, "AMENT_PREFIX_PATH": paths, "ROS_DOMAIN_ID": "213"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=50
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "bag/metadata.yaml").is_file()
