"""Sensors keep their time exactly and their noise honestly."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ldcs_ros.errors import SceneError
from ldcs_ros.sensors import PressureSensor, PressureSensorParameters, Ticks, Tracker, TrackerParameters

STILL = (np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


def tracker(seed=0, **changes):
    parameters = TrackerParameters(**{"points": ("P0", "P1"), "rate": 80.0, **changes})
    return Tracker(parameters, np.random.default_rng(seed))


@given(st.integers(1, 10_000), st.integers(0, 10**8))
def test_a_tick_is_the_nearest_double_of_its_exact_time(rate, index):
    assert Ticks(float(rate), index).time == float(Fraction(index, rate))


@given(st.floats(0.01, 5e3), st.integers(0, 10**6))
def test_a_grid_started_on_a_tick_begins_with_it(rate, index):
    assert Ticks.starting_at(rate, index / rate).index == index


def test_a_measurement_is_delivered_after_the_delay_and_not_before():
    sensor = tracker(delay=0.03)
    for _ in range(3):
        sensor.measure(lambda point: STILL)
    assert sensor.next_delivery == 0.03
    assert sensor.deliver(0.0299) == []
    assert [(m.probe, m.point, m.time) for m in sensor.deliver(0.043)] == [
        (0, "P0", 0.0), (1, "P1", 0.0), (0, "P0", 0.0125), (1, "P1", 0.0125),
    ]  # fmt: skip
    assert sensor.next_delivery == 0.025 + 0.03


def test_the_noise_has_the_deviation_that_was_asked_for_on_each_axis():
    sensor = tracker(noise=1e-4)
    for _ in range(4000):
        sensor.measure(lambda point: STILL)
    errors = np.array([m.position for m in sensor.deliver(1e9)])
    assert np.allclose(errors.std(axis=0), 1e-4, rtol=0.05)
    assert np.allclose(errors.mean(axis=0), 0.0, atol=5e-6)


def test_positions_come_in_whole_quanta():
    sensor = tracker(noise=1e-4, quantum=2.8e-5)
    sensor.measure(lambda point: STILL)
    steps = np.array([m.position for m in sensor.deliver(0.0)]) / 2.8e-5
    assert np.allclose(steps, np.round(steps), atol=1e-9)


def test_the_orientation_is_reported_as_it_is():
    orientation = np.array([0.0, 0.6, 0.0, 0.8])
    sensor = tracker(noise=1.0)
    sensor.measure(lambda point: (np.zeros(3), orientation))
    assert np.array_equal(sensor.deliver(0.0)[0].orientation, orientation)


def test_equal_seeds_give_equal_noise():
    def positions(seed):
        sensor = tracker(seed, noise=1e-4)
        sensor.measure(lambda point: STILL)
        return [m.position.tolist() for m in sensor.deliver(0.0)]

    assert positions(1) == positions(1) != positions(2)


def test_pressures_are_measured_with_noise_at_their_own_rate():
    sensor = PressureSensor(PressureSensorParameters(rate=100.0, noise=50.0), np.random.default_rng(0))
    values = np.array([sensor.measure(np.array([1e5, 5e4])) for _ in range(2000)])
    assert sensor.next_tick == 20.0
    assert np.allclose(values.std(axis=0), 50.0, rtol=0.1)
    assert np.allclose(values.mean(axis=0), [1e5, 5e4], atol=10.0)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"rate": 0.0}, "rate"),
        ({"rate": float("nan")}, "rate"),
        ({"delay": -0.1}, "delay"),
        ({"noise": "much"}, "noise"),
        ({"quantum": float("inf")}, "quantum"),
        ({"points": ()}, "points"),
        ({"points": ("P0", "P0")}, "points"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused_by_name(changes, named):
    with pytest.raises(SceneError, match=rf"sensors\.tracker\.{named}"):
        tracker(**changes)


def test_a_pressure_sensor_that_cannot_be_is_refused_by_name():
    with pytest.raises(SceneError, match=r"sensors.pressure.rate"):
        PressureSensorParameters(rate=-1.0)


@pytest.mark.parametrize("rate", [1e-3, 1e4])
def test_rates_are_accepted_up_to_their_bounds_and_refused_beyond(rate):
    beyond = rate * (0.999 if rate < 1.0 else 1.001)
    for make in (
        lambda value: TrackerParameters(("P0",), rate=value),
        lambda value: PressureSensorParameters(value),
    ):
        assert make(rate).rate == rate
        with pytest.raises(SceneError, match="rate"):
            make(beyond)


def test_the_noise_of_both_sensors_has_seeds_of_its_own_within_63_bits():
    assert (TrackerParameters(("P0",)).seed, PressureSensorParameters().seed) == (1, 2)
    assert TrackerParameters(("P0",), seed=2**63 - 1).seed == 2**63 - 1
    with pytest.raises(SceneError, match="seed"):
        TrackerParameters(("P0",), seed=2**64)
