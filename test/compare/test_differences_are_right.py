"""The numbers of a comparison are those of the differences that were put in."""

from __future__ import annotations

import numpy as np
import pytest

from ldcs_ros.bags import read_bag
from ldcs_ros.compare.comparison import Options, compare
from ldcs_ros.compare.difference import channel_difference, field_difference
from ldcs_ros.errors import RecordingError
from ldcs_ros.schema.units import AXES
from ldcs_ros.signals import MappingError
from ldcs_ros.signals.mapping import parse_mapping
from ldcs_ros.signals.series import Series, clean


def series(time, value, *, unit="m", smooth=True):
    value = np.asarray(value, dtype=float)
    axes = AXES if value.shape[1] == 3 else ("",)
    return Series(np.asarray(time, dtype=float), value, axes, unit, smooth)


def swing(time):
    return np.stack([np.sin(12.0 * time), 0.0 * time, np.cos(9.0 * time)], axis=1) * 0.02


def test_a_recording_does_not_differ_from_itself(run):
    result = compare(read_bag(run), read_bag(run), Options())
    assert all(channel.overall.max == 0.0 for channel in result.channels.values())
    assert result.surface.statistics.max == 0.0 and result.offset.value == 0.0
    assert {"P0", "P1", "left/pressure", "joint/left_joint_1"} <= set(result.channels)


def test_figures_are_those_of_the_difference_put_in():
    time = np.linspace(0.0, 2.0, 401)
    put_in = np.stack([0.001 * np.sin(20.0 * time), np.full_like(time, -0.002), 0.003 * time / 2.0], axis=1)
    found = channel_difference(
        "P1",
        series(time, swing(time) + put_in),
        series(time, swing(time)),
        0.0,
        side_length=0.14,
        relative=False,
    )
    for axis, column in zip(AXES, put_in.T, strict=True):
        assert found.statistics[axis].rms == pytest.approx(np.sqrt(np.mean(column**2)))
        assert found.statistics[axis].max == pytest.approx(np.abs(column).max())
        assert found.statistics[axis].p95 == pytest.approx(np.percentile(np.abs(column), 95))
        assert found.statistics[axis].mean == pytest.approx(column.mean())
    distance = np.linalg.norm(put_in, axis=1)
    assert found.overall.rms == pytest.approx(np.sqrt(np.mean(distance**2)))
    assert found.overall.normalised_rms == pytest.approx(found.overall.rms / 0.14)
    assert found.statistics["z"].end == pytest.approx(0.003 * 0.975, rel=1e-2)


def test_resampling_a_smooth_motion_adds_microns_at_most():
    # 50 Hz and 80 Hz: straight lines would add a quarter of a millimetre here.
    slow, fast = np.arange(101) / 50.0, np.arange(161) / 80.0
    noise = np.random.default_rng(1).normal(0.0, 1e-4, (161, 3))
    a, b = series(slow, swing(slow)), series(fast, swing(fast) + noise, smooth=False)
    found = channel_difference("P1", a, b, 0.0, side_length=None, relative=False)
    assert len(found.time) == 161
    assert np.allclose(found.a - swing(fast), 0.0, rtol=0.0, atol=5e-6)
    assert found.overall.rms == pytest.approx(1e-4 * np.sqrt(3.0), rel=0.1)


def test_nothing_is_made_up_in_a_silence():
    time = np.arange(200) / 100.0
    talking = (time < 0.5) | (time > 1.2)
    a = series(time, swing(time))
    b = series(time[talking], swing(time[talking]))
    found = channel_difference("P1", a, b, 0.0, side_length=None, relative=False)
    assert found.overall.max < 1e-12 and found.skipped == 0, (
        "the times of the silent side are the common ones"
    )
    noisy = series(time, swing(time), smooth=False)
    found = channel_difference("P1", b, noisy, 0.0, side_length=None, relative=False)
    assert found.skipped == pytest.approx(70, abs=2) and found.overall.max < 1e-5


def test_an_offset_moves_b_onto_as_clock():
    time = np.arange(200) / 100.0
    b = series(time + 5.0, swing(time))
    found = channel_difference("P1", series(time, swing(time)), b, 5.0, side_length=None, relative=False)
    assert found.overall.max < 1e-9 and len(found.time) == 200
    assert (
        channel_difference("P1", series(time, swing(time)), b, 0.0, side_length=None, relative=False) is None
    )


def test_relative_takes_out_where_each_begins():
    time = np.arange(200) / 100.0
    found = channel_difference(
        "P1",
        series(time, swing(time)),
        series(time, swing(time) + [0.01, -0.02, 0.03]),
        0.0,
        side_length=None,
        relative=True,
    )
    assert found.overall.max < 1e-12


def test_values_out_of_order_twice_or_not_finite_are_dropped_and_counted():
    time = np.array([0.0, 0.2, 0.1, 0.1, 0.3, 0.4])
    value = np.array([0.0, 2.0, 1.0, 1.5, np.nan, 4.0])[:, None]
    time, value, dropped = clean(time, value)
    assert time.tolist() == [0.0, 0.1, 0.2, 0.4] and value[:, 0].tolist() == [0.0, 1.0, 2.0, 4.0]
    assert dropped == 2


class Sheet:
    """A surface of given positions."""

    def __init__(self, nodes, time, rise):
        self.nodes, self.time, self.rise = nodes, np.asarray(time), rise

    def __len__(self):
        return len(self.time)

    def position(self, index):
        x, y = np.meshgrid(*(np.linspace(0.0, 0.14, n) for n in self.nodes), indexing="ij")
        z = self.rise(self.time[index], x, y)
        return np.stack([np.stack([x, y, z + shift], axis=-1) for shift in (-0.005, 0.005)])


def test_the_surface_error_is_where_it_was_put():
    time = np.arange(11) / 50.0
    flat = Sheet((5, 4), time, lambda t, x, y: 0.1 * t + 0.0 * x)
    bent = Sheet((5, 4), time, lambda t, x, y: 0.1 * t + t * (x > 0.13) * (y > 0.13))
    found = field_difference(bent, flat, 0.0, side_length=0.14)
    assert found.worst == 10 and found.statistics.max == pytest.approx(0.2)
    assert np.count_nonzero(found.rms_over_time > 1e-12) == 1
    assert found.rms_over_time[4, 3] == pytest.approx(np.sqrt(np.mean(time**2)))
    assert found.statistics.end == pytest.approx(0.2 / np.sqrt(20.0))


def test_surfaces_of_different_lattices_and_rates_are_compared_on_the_coarser_one():
    def wave(t, x, y):
        return 0.05 * np.sin(8.0 * t) * (1.0 + x + 2.0 * y)

    fine = Sheet((9, 9), np.arange(41) / 40.0, wave)
    coarse = Sheet((5, 3), np.arange(26) / 25.0 + 2.0, lambda t, x, y: wave(t - 2.0, x, y))
    for a, b, offset in ((fine, coarse, 2.0), (coarse, fine, -2.0)):
        found = field_difference(a, b, offset, side_length=None)
        assert found.nodes == (5, 3) and found.statistics.max < 2e-5
    assert field_difference(fine, coarse, 0.0, side_length=None) is None


def test_a_tracker_in_other_axes_and_units_agrees_but_for_its_noise(run, rig, tracker_mapping):
    # Bias put in: 2 mm along z; a silence of 0.3 s, which both sides' clocks must survive.
    bag = read_bag(rig(ahead=0.0, noise=1e-4, bias=0.002, silent=(0.7, 1.0)))
    result = compare(read_bag(run), bag, Options(mappings=(None, tracker_mapping)))
    p1 = result.channels["P1"].statistics
    assert p1["z"].mean == pytest.approx(-0.002, abs=5e-5)
    assert p1["x"].rms == pytest.approx(1e-4, rel=0.3) and p1["y"].rms == pytest.approx(1e-4, rel=0.3)
    assert any("missing" in remark for remark in result.b.warnings)
    relative = compare(read_bag(run), bag, Options(mappings=(None, tracker_mapping), relative=True))
    assert abs(relative.channels["P1"].statistics["z"].mean) < 2e-4


def test_recordings_without_a_common_channel_are_refused(run, rig):
    other = parse_mapping({"measurements": [{"topic": "/tracker", "to": "P7", "child": "probe0"}]})
    with pytest.raises(RecordingError, match="no channel in common"):
        compare(read_bag(run), read_bag(rig()), Options(mappings=(None, other)))
    with pytest.raises(RecordingError, match="name its topics in a mapping file"):
        compare(read_bag(run), read_bag(rig("plain")), Options())
    lost = parse_mapping({"measurements": [{"topic": "/trakcer", "to": "P0"}]})
    with pytest.raises(MappingError, match="no topic '/trakcer'"):
        compare(read_bag(run), read_bag(rig("lost")), Options(mappings=(None, lost)))
