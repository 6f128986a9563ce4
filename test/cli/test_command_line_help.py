"""Help, unknown words and broken pipes: the common part of every verb."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys

import pytest

import ldcs_ros
from ldcs_ros.cli.main import VERBS, main


def in_a_process(*words, **options):
    return subprocess.run(
        [sys.executable, "-m", "ldcs_ros", *words], capture_output=True, text=True, timeout=50, **options
    )


@pytest.mark.timed
def test_help_is_fast_and_loads_no_numpy():
    # CPU time, and the best of a few: the machine may be busy.
    assert min(timed(HELP) for _ in range(5)) < 0.2


HELP = """\
import sys, time
from ldcs_ros.cli.main import main
main(['--help'])
print(sorted(sys.modules))
print(time.process_time())
"""


def timed(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    *_, loaded, elapsed = done.stdout.splitlines()
    for heavy in ("'numpy'", "'rosbags'", "'mcap'", "'matplotlib'", "'rclpy'", "'numba'", "'yaml'"):
        assert heavy not in loaded
    return float(elapsed)


def test_help_lists_every_verb():
    done = in_a_process("--help")
    assert done.returncode == 0
    for name, verb in VERBS.items():
        assert f"  {name}" in done.stdout and verb.summary in done.stdout


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_explains_itself_with_an_example(name, capsys):
    with pytest.raises(SystemExit) as stop:
        main([name, "--help"])
    text = capsys.readouterr().out
    assert stop.value.code == 0
    assert f"usage: ldcs {name}" in text and "--json" in text
    assert f"example:\n  ldcs {name}" in text
    assert importlib.import_module(VERBS[name].module).DESCRIPTION.split("\n")[0] in text


def test_an_unknown_verb_is_refused_with_the_nearest_one(refused):
    assert "Did you mean 'simulate'" in refused("simulat", "paper")


@pytest.mark.parametrize("name", VERBS)
def test_a_mistyped_option_is_refused_with_the_right_one(name, refused, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    # Each begins a line; others of the text may be of other verbs.
    options = set(re.findall(r"^  (?:-\w[^\n-]*, )?(--[a-z][a-z-]+)", capsys.readouterr().out, re.MULTILINE))
    assert "--json" in options
    for option in sorted(options):
        if len(option) > 7:  # a shorter one may be nearest to another
            typed = option[:3] + option[4:]
            assert f"Did you mean '{option}'" in refused(name, f"{typed}=1"), typed


REACH = ("reach", "rig", "--target", "P1.z=0.05", "--vary", "pressure.left=0..1e5")
SWEEP = ("sweep", "rig", "--over", "pressure.left=0..1e5:3", "--measure", "P1.z", "--settle", "-o", "x.csv")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((*REACH, "--slew", "pressure.left=1e5"), "--slew goes with --trajectory, which is not given"),
        ((*REACH, "--rate", "fast"), "rate is 'fast', expected a number in Hz"),
        ((*REACH, "-o", "picture"), "expected a file that ends in .png, .pdf, .svg"),
        (
            ("sensitivity", "rig", "--of", "P1", "--to", "pressure.left", "-o", "x.bmp"),
            "ends in .png, .pdf, .svg",
        ),
        ((*SWEEP, "--samples", "8"), "--samples goes with --sampling latin or sobol"),
        (("simulate", "paper", "--duration", "1", "--detail"), "--detail goes with --bag"),
        (("study", "--only", "floor"), "--only goes with --hard or --accuracy"),
        (("study", "--hard", "--first-seed", "7"), "--first-seed goes with --accuracy"),
        (("view", "bags/paper", "--panel"), "--panel goes with --live"),
    ],
)
def test_an_option_that_would_be_ignored_or_fail_late_is_refused_at_once(words, expected, refused):
    assert expected in refused(*words)


def test_the_version_is_told(ldcs):
    assert ldcs("--version").out == f"ldcs {ldcs_ros.__version__}\n"


def test_an_unknown_option_is_refused(refused):
    assert "--bogus" in refused("effects", "--bogus")


def test_no_verb_at_all_prints_the_overview_and_fails(ldcs):
    outcome = ldcs()
    assert outcome.status == 2 and "verbs:" in outcome.out


def test_a_reader_that_leaves_is_no_error():
    with subprocess.Popen(
        [sys.executable, "-m", "ldcs_ros", "effects"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        error = process.stderr.read()
        process.wait(timeout=50)
    assert process.returncode == 141
    assert error == b""
