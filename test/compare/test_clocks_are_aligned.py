"""The constant offset of two clocks is found from the motion, to a small part of a sample, or not believed."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.bags import read_bag
from ldcs_ros.compare.alignment import estimate_offset
from ldcs_ros.compare.comparison import Options, compare
from ldcs_ros.schema.units import AXES
from ldcs_ros.signals.series import Series, without_spikes


def lift(time):
    """A lift and a half way down, as the sheet does it [m]."""
    rise = 0.05 / (1.0 + np.exp(-20.0 * (time - 0.5)))
    fall = -0.02 / (1.0 + np.exp(-15.0 * (time - 1.4)))
    return np.stack([-0.3 * (rise + fall), 0.0 * time, rise + fall], axis=1)


def series(ahead=0.0, *, rate=50.0, begin=0.0, end=2.0, noise=0.0, seed=1, shape=lift):
    clock = np.arange(round(begin * rate), round(end * rate) + 1) / rate
    value = shape(clock)
    value = value + np.random.default_rng(seed).normal(0.0, 1.0, value.shape) * noise
    return Series(clock + ahead, value, AXES, "m", smooth=noise == 0.0)


@pytest.mark.parametrize("ahead", [0.0, 0.0137, -0.25, 0.6, -0.9, 7.003, 5e4 + 0.31])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_the_offset_is_found_to_a_small_part_of_a_sample(ahead, noise):
    found = estimate_offset({"P1": (series(), series(ahead, rate=80.0, noise=noise))})
    assert found.value == pytest.approx(ahead, abs=5e-4 if noise else 5e-5)
    assert found.unexplained < 1e-3 and found.channels == ("P1",)


@pytest.mark.slow
def test_the_uncertainty_is_honest():
    errors, said = [], []
    for seed in range(20):
        found = estimate_offset({"P1": (series(), series(0.1, rate=80.0, noise=5e-4, seed=seed))})
        errors.append(found.value - 0.1)
        said.append(found.uncertainty)
    assert 0.5 < np.std(errors) / np.mean(said) < 2.0


def test_recordings_that_share_only_a_part_are_aligned():
    found = estimate_offset({"P1": (series(end=1.6), series(3.0, begin=0.3, end=2.4, noise=1e-4))})
    assert found.value == pytest.approx(3.0, abs=1e-3)


def test_a_constant_difference_and_another_size_of_motion_do_not_shift_time():
    a, b = series(), series(0.2, noise=1e-4)
    biased = Series(b.time, 1.2 * b.value + [0.003, -0.002, 0.01], b.axes, b.unit, b.smooth)
    assert estimate_offset({"P1": (a, biased)}).value == pytest.approx(0.2, abs=2e-3)


@pytest.mark.parametrize("ahead", [0.0, 0.137])
def test_values_that_stand_alone_do_not_shift_time(ahead):
    # Each 25th value misses the 20 mm by which all others are too high.
    def swing(at, wrong):
        height = 0.02 * np.sin(2.0 * np.pi * at)
        high = np.where(np.arange(len(at)) % 25 == 0, 0.0, 0.02) if wrong else 0.0
        return np.stack([0.0 * at, 0.0 * at, height + high], axis=1)

    time = np.arange(0.0, 3.0, 0.02)
    a = Series(time, swing(time, False), AXES, "m", False)
    found = estimate_offset({"P1": (a, Series(time + ahead, swing(time, True), AXES, "m", False))})
    assert found.value == pytest.approx(ahead, abs=1e-3 if ahead else 0.0)


def test_fast_motion_is_no_value_that_stands_alone():
    time = np.arange(0.0, 4.0, 0.02)
    value = np.where(abs(time - 2.0) < 0.3, 0.02 * np.sin(80.0 * time), 0.0)[:, None] * np.ones(3)
    burst = Series(time, value, AXES, "m", False)
    assert len(without_spikes(burst, 2e-4).time) == len(time)
    value[30] += 0.05
    assert len(without_spikes(Series(time, value, AXES, "m", False), 2e-4).time) == len(time) - 1


def test_an_offset_within_its_uncertainty_is_none():
    values = [estimate_offset({"P1": (series(), series(noise=1e-3, rate=80.0, seed=k))}) for k in range(8)]
    assert sum(found.value == 0.0 for found in values) >= 2
    assert all(abs(found.value) < 4.0 * found.uncertainty for found in values)


def test_stillness_says_nothing_about_time():
    still = [series(ahead, noise=1e-5, shape=lambda time: np.zeros((len(time), 3))) for ahead in (0.0, 0.3)]
    found = estimate_offset({"P1": (still[0], still[1])})
    assert found.value == 0.0 and found.estimate is None and "0 is assumed" in found.reason


def test_motions_with_nothing_in_common_are_not_aligned():
    a = series(shape=lambda time: np.stack([0.01 * np.sin(30.0 * time)] * 3, axis=1))
    b = series(shape=lambda time: np.stack([0.01 * np.sin(41.0 * time**2)] * 3, axis=1))
    found = estimate_offset({"P1": (a, b)})
    assert found.value == 0.0 and found.unexplained > 0.5 and "too little in common" in found.reason


def test_a_rigs_bag_is_aligned_with_the_run_and_says_so(run, rig, tracker_mapping):
    # The driver's clock runs 0.137 s before the recorder's, in other axes and units.
    source = rig(ahead=0.0, begin=0.1)
    result = compare(read_bag(run), read_bag(source), Options(mappings=(None, tracker_mapping)))
    assert result.offset.value == pytest.approx(0.0, abs=2e-3)
    assert result.channels["P1"].overall.rms < 4e-4
    assert "estimated from motion" in result.offset.reason


def test_two_runs_in_simulation_time_are_not_shifted(run, softer):
    result = compare(read_bag(run), read_bag(softer), Options())
    assert result.offset.value == 0.0 and result.offset.estimate is not None
    assert "simulation time" in result.offset.reason
    estimated = compare(read_bag(run), read_bag(softer), Options(estimate=True))
    assert estimated.offset.value == result.offset.estimate
    given = compare(read_bag(run), read_bag(softer), Options(offset=0.05))
    assert given.offset.value == 0.05 and given.offset.reason == "given"
    assert given.channels["P1"].overall.rms > result.channels["P1"].overall.rms


@pytest.mark.parametrize("late", [0.1, -0.3, 0.0])
def test_a_periodic_motion_gives_the_smallest_offset_and_names_the_others(late):
    time, draw = np.arange(0.0, 6.0, 0.02), np.random.default_rng(4)

    def swing(at, lead):
        value = 0.02 * np.sin(2.0 * np.pi * (at - lead))[:, None] * [1.0, 0.0, 0.5]
        return Series(at, value + draw.normal(0.0, 1e-4, value.shape), AXES, "m", False)

    found = estimate_offset({"P1": (swing(time, 0.0), swing(time, late))})
    assert found.value == pytest.approx(late, abs=2e-3)
    expected = sorted((late + k for k in (-2.0, -1.0, 1.0, 2.0)), key=abs)
    assert found.alternatives[:2] == pytest.approx(expected[:2], abs=5e-3)


def test_a_motion_that_does_not_repeat_has_no_other_offset():
    time = np.arange(0.0, 6.0, 0.02)

    def step(lead):
        value = 0.02 * np.tanh(time - 2.0 - lead)[:, None] * [1.0, 0.0, 0.5]
        return Series(time, value, AXES, "m", False)

    found = estimate_offset({"P1": (step(0.0), step(0.4))})
    assert found.value == pytest.approx(0.4, abs=2e-3) and found.alternatives == ()
