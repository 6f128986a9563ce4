"""A node without the packages that it can do without, or with one that does not load, runs and says so truthfully."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from ldcs_ros.ros.common import optional
from ldcs_ros.ros.common.optional import build_advice

PROGRAM = """\
import sys
sys.modules.update(dict.fromkeys(['ldcs_msgs', 'simulation_interfaces']))
from ldcs_ros.ros.__main__ import sim
sys.exit(sim())
"""


@pytest.fixture
def broken_tf2_msgs(tmp_path, monkeypatch):
    """Nodes that are started find a tf2_msgs first whose libraries are of another Python."""
    package = tmp_path / "broken" / "tf2_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "msg" / "__init__.py").write_text("raise ImportError('undefined symbol:\\n  PyOther')\n")
    paths = filter(None, [str(package.parent), os.environ.get("PYTHONPATH")])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))


def test_the_advice_on_ldcs_msgs_is_what_this_user_can_run(monkeypatch):
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    assert build_advice() == "build it with `make msgs`"
    # From a wheel: its sources lie in the package, and colcon comes with a distribution.
    monkeypatch.setattr(optional, "in_checkout", lambda: False)
    sources = build_advice().partition("--base-paths ")[2].split()[0]
    assert (Path(sources) / "package.xml").is_file() and build_advice().endswith("in a ROS 2 distribution")
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    assert build_advice().endswith("source install/setup.bash`")


def test_it_runs_and_says_what_is_left_out_and_why(start, tmp_path, broken_tf2_msgs):
    program = tmp_path / "without.py"
    program.write_text(PROGRAM)
    node, user = start(program=program, scene="single_spring", publish_tf=True, record=tmp_path / "bag")
    user.listen("/diagnostics", "diagnostic_msgs/DiagnosticArray")
    told = user.diagnostics("interfaces")
    assert told["ldcs_msgs"].startswith("not installed (")
    assert told["tf2_msgs"] == "cannot be loaded: undefined symbol: PyOther (/tf and /tf_static)"
    (line,) = [line for line in node.output.splitlines() if "left out" in line]
    assert "not installed, left out: ldcs_msgs (" in line
    assert line.endswith(build_advice())
    assert "cannot be loaded: undefined symbol: PyOther, left out: tf2_msgs" in line
    services = {name for name, _ in user.node.get_service_names_and_types()}
    assert "/ldcs/ldcs_sim/pause" in services and "/ldcs/ldcs_sim/load_scene" not in services
    topics = {name for name, _ in user.node.get_topic_names_and_types()}
    assert "/ldcs/nodes" in topics and not {"/tf", "/ldcs/lattice_state", "/ldcs/arm_command"} & topics
    assert node.stop(signal.SIGINT) == 0
    assert (tmp_path / "bag" / "metadata.yaml").is_file()
