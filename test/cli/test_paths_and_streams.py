"""Paths of any bytes, `~`, output that nobody reads, files that are none, sizes in millimetres."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from ldcs_ros.compare.tolerances import load_tolerances
from ldcs_ros.errors import LdcsError
from ldcs_ros.rig.rig_file import load_rig
from ldcs_ros.signals import load_mapping

NAME = os.fsdecode(b"b\xff\xfeg")


def test_a_path_may_hold_bytes_that_are_no_text(ldcs, scene_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert ldcs("simulate", scene_file, "--duration", "0.02", "--bag", NAME).status == 0
    for words in (
        ("replay", NAME, "--bag", f"{NAME}2"),
        ("compare", NAME, f"{NAME}2", "-o", f"{NAME}3"),
        ("recover", NAME),
    ):
        outcome = ldcs(*words)
        assert outcome.status == 0, outcome
    assert (tmp_path / f"{NAME}3" / "compare.md").exists()


def test_the_home_folder_may_be_a_tilde(ldcs, scene_file, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    scene = f"~/{scene_file.name}"
    assert ldcs("simulate", scene, "--duration", "0.02", "--bag=~/bag").status == 0
    assert ldcs("recover", "~/bag").status == 0
    assert (tmp_path / "bag" / "metadata.yaml").exists()
    assert not (tmp_path / "~").exists()


@pytest.mark.parametrize("closed", [">&-", "> /dev/full"])
def test_output_that_cannot_be_written_is_no_traceback(closed):
    command = f"exec {sys.executable} -m ldcs_ros scenes {closed}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == (0 if closed == ">&-" else 2)
    assert done.stderr.count("\n") <= 1 and "Traceback" not in done.stderr


@pytest.mark.parametrize("load", [load_tolerances, load_mapping, load_rig])
def test_a_pipe_or_a_device_is_no_file_to_read(tmp_path, load):
    os.mkfifo(tmp_path / "pipe")
    for file in (tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(LdcsError, match="no regular file"):
            load(file)


def test_a_mesh_is_refused_with_the_memory_that_it_takes(refused, scene_file, tmp_path):
    words = ("simulate", scene_file, "--duration", "0.1", "--bag", tmp_path / "bag")
    line = refused(*words, "--set", "lattice.nodes=[1000,1000]")
    assert re.search(r"take about 59 GB of memory, expected at most \d+ GB @ .*lattice.nodes", line)


@pytest.mark.parametrize("size", ["[140.0, 140.0, 10.0]", "[1.4e-4, 1.4e-4, 1e-5]"])
def test_a_size_that_is_hardly_in_metres_is_told_once(ldcs, scene_file, tmp_path, size):
    scene_file.write_text(scene_file.read_text().replace("[0.140, 0.140, 0.010]", size))
    outcome = ldcs("simulate", scene_file, "--duration", "1e-6", "--bag", tmp_path / "bag")
    told = [line for line in outcome.err.splitlines() if "sizes are in metres" in line]
    assert len(told) == 1 and told[0].startswith("ldcs: note: a sheet of ("), outcome
