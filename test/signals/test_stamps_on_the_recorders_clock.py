"""Header stamps that are unset, stuck, coarse, or of a clock that was set still give the right times."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "replay"))

import rig_bag

from ldcs_ros.bags import read_bag
from ldcs_ros.signals.channels import ChannelReport, read_channel
from ldcs_ros.signals.stamps import SECOND, on_recorders_clock

WALL = 1_700_000_000 * SECOND
MS = SECOND // 1000


def found(stamps, logs, copies=False):
    return on_recorders_clock(
        np.array(stamps, dtype=np.int64), np.array(logs, dtype=np.int64), np.full(len(logs), copies)
    )


def logs(count, period):
    return [WALL + k * period for k in range(count)]


@pytest.mark.parametrize("lead", [0, 5 * SECOND, -WALL + SECOND])
def test_a_stamp_that_never_changes_gives_way_to_the_log_time(lead):
    times = found([WALL + lead] * 5, logs(5, SECOND // 2))
    assert times.time.tolist() == logs(5, SECOND // 2)


@pytest.mark.parametrize("period", [250 * MS, 300 * MS, 1300 * MS])
def test_stamps_in_whole_seconds_give_way_to_log_times(period):
    recorded = [time + 100 * MS for time in logs(20, period)]
    times = found([time // SECOND * SECOND for time in recorded], recorded)
    assert times.time.tolist() == recorded and not times.usable.any()


def test_stamps_that_happen_to_be_whole_seconds_are_kept():
    recorded = [time + 3 * MS for time in logs(10, SECOND)]
    assert found(logs(10, SECOND), recorded).time.tolist() == logs(10, SECOND)


@pytest.mark.parametrize("unset", [0, 7, 149])
def test_one_unset_stamp_of_another_clock_moves_no_other(unset):
    stamps = [k * 10 * MS for k in range(1, 151)]
    stamps[unset] = 0
    times = found(stamps, logs(150, 10 * MS))
    assert times.time.tolist() == logs(150, 10 * MS)
    assert times.usable.sum() == 149 and times.clock_offset == 10 * MS - WALL


@pytest.mark.parametrize(
    ("first", "then"), [(5 * SECOND - WALL, 0), (0, -3600 * SECOND), (-60 * SECOND, 7 * SECOND)]
)
def test_a_clock_that_is_set_moves_no_message(first, then):
    recorded = logs(150, 10 * MS)
    stamps = [time - 2 * MS + (first if k < 70 else then) for k, time in enumerate(recorded)]
    times = found(stamps, recorded)
    assert np.abs(times.time - recorded).max() <= 2 * MS
    assert times.clock_steps == (then - first,)


@pytest.mark.parametrize("step", [0.08, -0.3, 0.5, -0.9])
@pytest.mark.parametrize("lead", [0, -1000 * SECOND])
def test_a_clock_that_is_set_by_less_than_a_second_moves_no_message(step, lead):
    recorded = logs(200, 10 * MS)
    delays = np.random.default_rng(3).integers(MS, 3 * MS, 200)
    stamps = np.array(recorded) - delays + lead + np.where(np.arange(200) < 90, 0, round(step * SECOND))
    times = found(stamps, recorded)
    assert np.abs(times.time - recorded).max() <= 3 * MS
    assert times.clock_steps == (pytest.approx(step * SECOND, abs=2 * MS),)


@pytest.mark.parametrize("delay", [0.08, 0.3, 0.9])
def test_a_delay_that_changes_is_no_step_of_a_clock(delay):
    stamps = logs(200, 10 * MS)
    recorded = [stamp + (MS if k < 90 else round(delay * SECOND)) for k, stamp in enumerate(stamps)]
    times = found(stamps, recorded)
    assert times.time.tolist() == stamps and not times.clock_steps


def test_stamps_after_their_recording_are_counted(tmp_path):
    stamps = [WALL + k * 20 * MS for k in range(20)]
    messages = [("/v", stamp - 300 * MS, rig_bag.fluid(stamp, 101325.0)) for stamp in stamps]
    report = ChannelReport("/v")
    bag = read_bag(rig_bag.write(tmp_path / "bag", messages))
    read_channel(bag, "/v", report, by="stamp", late=0.1, gap=None)
    assert (report.early, report.late) == (20, 0)
    assert report.warnings() == ["20 recorded before their stamp (the clocks differ)"]


def test_a_late_message_keeps_its_stamp_and_one_from_the_future_does_not():
    recorded = logs(50, 20 * MS)
    stamps = list(recorded)
    stamps[20] -= 3 * SECOND
    stamps[30] += 3 * SECOND
    times = found(stamps, recorded)
    assert times.time[20] == stamps[20] and times.time[30] == recorded[30]
    assert not times.clock_steps and times.clock_offset is None


def test_messages_that_were_held_up_and_come_at_once_are_late_and_no_step_of_a_clock():
    recorded = logs(200, 20 * MS)
    stamps = list(recorded)
    recorded[50:150] = [recorded[149]] * 100
    times = found(stamps, recorded)
    assert times.time.tolist() == stamps and not times.clock_steps


def test_a_copy_of_a_message_holds_at_the_stamp_of_the_first():
    stamps = [stamp for stamp in logs(40, 20 * MS) for _ in range(2)]
    recorded = [stamp + (k % 2) * 8 * MS for k, stamp in enumerate(stamps)]
    assert found(stamps, recorded, copies=True).time.tolist() == stamps
    assert found(stamps, recorded, copies=False).usable.sum() == 40


@pytest.mark.parametrize("length", [0.2, 2.0, 200.0])
def test_a_silence_is_counted_whatever_its_length(length):
    report = ChannelReport("/v")
    times = [WALL + k * 20 * MS for k in range(50)]
    times += [times[-1] + round(length * SECOND) + k * 20 * MS for k in range(50)]
    report.count_gaps(np.array(times), None, WALL)
    assert report.silences == ((pytest.approx(0.98), pytest.approx(length)),)
    assert report.missing == round(length / 0.02) - 1
    assert f"a silence of {length:.3g} s at 0.980 s" in report.warnings()[0]


def test_the_start_of_a_simulation_is_a_time_of_its_own():
    recorded = [k * 20 * MS for k in range(10)]
    times = found(recorded, recorded)
    assert times.usable.all() and times.time.tolist() == recorded


@pytest.mark.parametrize("before", [2, 3, 4])
def test_a_clock_that_is_set_after_three_messages_or_more_shows_a_step(before):
    recorded = logs(150, 10 * MS)
    stamps = [time - 2 * MS - (60 * SECOND if k < before else 0) for k, time in enumerate(recorded)]
    times = found(stamps, recorded)
    assert len(times.clock_steps) == (1 if before >= 3 else 0)


def test_one_long_period_of_three_is_the_usual_one():
    report = ChannelReport("/topic")
    report.count_gaps(np.array([0, 1, 2, 102]) * SECOND, None, 0)
    assert report.silences == () and report.longest_gap == pytest.approx(100.0)
    report.count_gaps(np.array([0, 1, 2, 3, 103]) * SECOND, None, 0)
    assert report.silences == ((3.0, 100.0),)
