"""Mutated bags are read, repaired, or refused in one line; no other exception leaves the room."""

from __future__ import annotations

import random
import shutil
import sys
from pathlib import Path

import pytest
from other_recorders import card, write_mcap, write_sqlite3

from ldcs_ros.bags import read_bag, recover
from ldcs_ros.errors import RecordingError

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools" / "stress"))
from mutations import mutate_bag

COUNT = 60


def outcome(call):
    """Return what a call gives, or its one line."""
    try:
        return call()
    except RecordingError as error:
        assert "\n" not in str(error)
        return str(error)


def read(folder):
    recording = read_bag(folder)
    messages = list(recording.in_order())
    for message in messages:
        outcome(lambda message=message: recording.decode(message))
    return len(messages) == recording.count


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_mutated_bags_are_read_or_refused_in_one_line(tmp_path, storage):
    seed = tmp_path / "seed"
    seed.mkdir()
    if storage == "mcap":
        write_mcap(seed / "rig.mcap", chunk_size=200)
        card(seed, ["rig.mcap"], 6)
    else:
        write_sqlite3(seed / "rig.db3", [1e5, 2e5, 3e5, 4e5])
        card(seed, ["rig.db3"], 4, storage="sqlite3")
    refused = 0
    for number in range(COUNT):
        folder = tmp_path / str(number)
        shutil.copytree(seed, folder)
        mutate_bag(folder, random.Random(number))
        found = outcome(lambda folder=folder: read(folder))
        assert found is True or isinstance(found, str), number
        refused += isinstance(found, str)
        repaired = outcome(lambda folder=folder: recover(folder))
        if not isinstance(repaired, str):
            again = outcome(lambda folder=folder: read(folder))
            # A repair never keeps less than the reader gets.
            assert again is True or isinstance(found, str), number
    assert 0 < refused < COUNT
