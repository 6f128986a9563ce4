"""The kernel cache lies where no other user can plant a pickle."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from ldcs_ros.physics.compiled import HAVE_NUMBA, private_folder


def test_a_new_cache_folder_is_closed_to_others_whatever_the_umask(tmp_path):
    before = os.umask(0)
    try:
        folder = private_folder("kernels", [tmp_path / "cache"])
    finally:
        os.umask(before)
    assert folder == tmp_path / "cache" / "kernels"
    assert folder.stat().st_mode & 0o777 == folder.parent.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("writable", ["cache", "cache/kernels"])
def test_a_folder_that_others_can_write_to_is_passed_over(tmp_path, writable):
    (tmp_path / "cache/kernels").mkdir(parents=True)
    (tmp_path / writable).chmod(0o777)
    found = private_folder("kernels", [tmp_path / "cache", tmp_path / "home"])
    assert found == tmp_path / "home" / "kernels"


def test_a_planted_link_is_not_followed(tmp_path):
    (tmp_path / "planted").mkdir()
    (tmp_path / "cache").mkdir(mode=0o700)
    (tmp_path / "cache/kernels").symlink_to(tmp_path / "planted")
    assert private_folder("kernels", [tmp_path / "cache", tmp_path / "home"]).parent == tmp_path / "home"


def test_a_folder_of_another_user_is_passed_over(tmp_path, monkeypatch):
    (tmp_path / "cache/kernels").mkdir(parents=True, mode=0o700)
    owner = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    found = private_folder("kernels", [tmp_path / "cache"])
    assert tmp_path not in found.parents


def test_without_a_sound_parent_the_folder_is_new_and_unguessable():
    first, second = private_folder("kernels", []), private_folder("kernels", [])
    assert first != second
    assert all(folder.stat().st_mode & 0o777 == 0o700 for folder in (first, second))


@pytest.mark.skipif(not HAVE_NUMBA, reason="numba is not installed")
def test_the_package_uses_a_private_folder():
    environment = {name: text for name, text in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    said = subprocess.run(
        [
            sys.executable,
            "-c",
            "import ldcs_ros.physics.compiled as c, numba; print(numba.config.CACHE_DIR)",
        ],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout.strip()
    status = os.stat(said)
    assert status.st_uid == os.getuid() and not status.st_mode & 0o022
