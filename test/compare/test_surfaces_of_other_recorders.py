"""The surface of any recorder's clouds is compared: of any layout of the points, and only where it was measured."""

from __future__ import annotations

import numpy as np
import pytest
import rig_bag

from ldcs_ros.bags import read_bag
from ldcs_ros.compare.comparison import Options, compare
from ldcs_ros.compare.report import summary
from ldcs_ros.errors import RecordingError

ROWS, COLUMNS = 10, 4
NUMBERS = {"<f4": 7, "<f8": 8, ">f4": 7}


def cloud(stamp, places, *, number="<f4", padding=0, rows=ROWS):
    """Return both layers of a sheet as a cloud; `padding` bytes of garbage follow each row."""
    columns = len(places) // rows
    points = np.zeros((rows, columns), np.dtype([("x", number), ("y", number), ("z", number)]))
    for k, axis in enumerate("xyz"):
        points[axis] = places[:, k].reshape(rows, columns)
    step = points.dtype.itemsize
    garbage = b"\xff" * padding
    fields = [
        rig_bag.build(
            "sensor_msgs/msg/PointField",
            name=axis,
            offset=k * step // 3,
            datatype=NUMBERS[number],
            count=1,
        )
        for k, axis in enumerate("xyz")
    ]
    return rig_bag.build(
        "sensor_msgs/msg/PointCloud2",
        header=rig_bag.header(stamp, "camera"),
        height=rows,
        width=columns,
        fields=fields,
        is_bigendian=number.startswith(">"),
        point_step=step,
        row_step=columns * step + padding,
        data=np.frombuffer(b"".join(row.tobytes() + garbage for row in points), np.uint8),
        is_dense=True,
    )


def sheet(time, lifted=0.0):
    x, y = np.meshgrid(np.linspace(0.0, 0.14, ROWS // 2), np.linspace(0.0, 0.14, COLUMNS), indexing="ij")
    z = 0.02 * np.sin(3.0 * time) * x / 0.14 + lifted
    return np.concatenate([np.stack([x, y, z + layer], axis=-1).reshape(-1, 3) for layer in (-0.005, 0.005)])


TIMES = np.arange(40) * 0.05


def bag(folder, *, times=TIMES, lifted=0.0, lost=(), **layout):
    """Write the sheet's clouds; `lost` has (moment, node) that are NaN."""
    messages = []
    for k, time in enumerate(times):
        places = sheet(time, lifted)
        for moment, node in lost:
            if moment == k:
                places[node] = np.nan
        stamp = rig_bag.WALL + round(time * 1e9)
        messages.append(("/camera/nodes", stamp, cloud(stamp, places, **layout)))
    return read_bag(rig_bag.write(folder, messages))


def compared(tmp_path, *, limit=1e-6, **change):
    a = bag(tmp_path / "a")
    limits = {"surface": {"max": limit}}
    return compare(a, bag(tmp_path / "b", **change), Options(offset=0.0, tolerances=limits))


@pytest.mark.parametrize(
    "layout", [{}, {"number": "<f8"}, {"padding": 8}, {"number": ">f4"}, {"number": "<f8", "padding": 3}]
)
def test_clouds_of_any_layout_are_the_same_surface(tmp_path, layout):
    found = compared(tmp_path, **layout)
    assert found.passed and found.surface.nodes == (5, 4)
    assert (len(found.surface.time), found.surface.measured, found.surface.coverage) == (40, 1.0, 1.0)


def test_nodes_that_were_not_measured_are_left_out_at_their_moment_alone(tmp_path):
    lost = [(k, k) for k in range(40)]
    found = compared(tmp_path, lost=lost)
    assert found.surface.measured == pytest.approx(1.0 - 40 / 1600)
    assert found.passed and "97.5 % of the nodes" in dict(summary(found))["surface"]


def test_a_cloud_of_one_row_is_no_sheet(tmp_path):
    with pytest.raises(RecordingError, match="1 rows of 40 points"):
        compared(tmp_path, rows=1)


def test_a_surface_that_is_hardly_measured_keeps_no_limit(tmp_path):
    lost = [(k, node) for k in range(40) for node in range(39)]
    found = compared(tmp_path, lost=lost)
    assert found.surface.statistics.max < 1e-6 and not found.passed
    assert "2 % of the nodes do not count" in dict(summary(found))["FAILED"]


@pytest.mark.parametrize(("count", "passed"), [(4, False), (40, True)])
def test_a_surface_of_a_few_moments_keeps_no_limit(tmp_path, count, passed):
    found = compared(tmp_path, times=TIMES[:count])
    assert found.surface.statistics.max < 1e-6 and found.passed == passed


def test_no_surface_is_made_up_in_a_silence(tmp_path):
    talking = (TIMES < 0.3) | (TIMES > 1.5)
    found = compared(tmp_path, times=TIMES[talking])
    assert len(found.surface.time) == talking.sum() and found.surface.statistics.max < 1e-6
    assert not found.passed and "of the overlap do not count" in dict(summary(found))["FAILED"]


def test_a_surface_that_is_higher_breaks_its_limit(tmp_path):
    found = compared(tmp_path, lifted=1e-3, limit=0.9e-3)
    assert found.surface.statistics.rms == pytest.approx(1e-3, rel=1e-4) and not found.passed
