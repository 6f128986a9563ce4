"""A run as a data frame, a dataset, a picture and files; a missing package is named with the command to install it."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from ldcs_ros import load_scene
from ldcs_ros.errors import MissingPackageError, RecordingError
from ldcs_ros.tables.run import Run


@pytest.fixture(scope="module")
def run():
    simulation = load_scene("rig").without_schedule().build()
    simulation.inputs.set_pressure([20e3, 40e3])
    return simulation.run(0.05, every=0.02)


def test_a_run_has_the_asked_times_and_the_state_at_each(run):
    np.testing.assert_allclose(run.time, [0.0, 0.02, 0.04, 0.05], atol=1e-12)
    simulation = load_scene("rig").without_schedule().build()
    simulation.inputs.set_pressure([20e3, 40e3])
    simulation.advance_to(0.05)
    np.testing.assert_allclose(run.channels["P1"][-1], simulation.pose("P1")[0], atol=1e-5)
    np.testing.assert_allclose(run.nodes[-1].reshape(-1, 3), simulation.state.position, atol=1e-5)
    np.testing.assert_allclose(run.channels["right/pressure"][-1], simulation.state.pressure[1])


def test_a_second_run_goes_on_where_the_first_one_ended():
    simulation = load_scene("single_spring").build()
    simulation.run(0.02)
    assert simulation.run(0.02).time[0] == pytest.approx(0.02)
    with pytest.raises(ValueError, match="expected finite times above 0"):
        simulation.run(0.0)


def test_pandas_and_xarray_hold_the_same_numbers(run):
    frame, dataset = run.to_pandas(), run.to_xarray()
    np.testing.assert_array_equal(frame["P1.z [m]"], dataset["position"].sel(point="P1", axis="z"))
    np.testing.assert_array_equal(
        frame["pressure_command.right [Pa]"], dataset["pressure_command"].sel(arm="right")
    )
    assert dataset["node"].dims == ("node_time", "layer", "i", "j", "axis")
    assert dataset["joint_angle"].attrs["units"] == "rad" and dataset.attrs["frame"] == "ldcs_base"


def test_a_netcdf_file_gives_the_dataset_again(run, tmp_path):
    import xarray

    run.write(tmp_path / "run.nc")
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as found:
        np.testing.assert_array_equal(found["node"], run.to_xarray()["node"])
        assert list(found["point"].values.astype(str)) == ["P0", "P1"]


def test_a_picture_has_a_panel_for_each_kind_of_channel(run):
    axes = run.plot().axes
    assert [one.get_ylabel() for one in axes] == [
        "displacement [mm]",
        "pressure [kPa, gauge]",
        "joint angle [deg]",
    ]
    assert len(axes[1].lines) == 4


def test_an_existing_file_and_an_unknown_suffix_are_refused(run, tmp_path):
    (tmp_path / "there.csv").write_text("mine")
    with pytest.raises(RecordingError, match="exists; name another file"):
        run.write(tmp_path / "there.csv")
    with pytest.raises(RecordingError, match=r"expected one of \['.csv', '.parquet', '.nc'\]"):
        run.write(tmp_path / "run.xlsx")
    assert (tmp_path / "there.csv").read_text() == "mine"


@pytest.mark.parametrize(
    ("package", "use"),
    [
        ("pandas", lambda run, _: run.to_pandas()),
        ("xarray", lambda run, _: run.to_xarray()),
        ("pyarrow", lambda run, folder: run.write(folder / "run.parquet")),
    ],
)
def test_a_missing_package_is_named_with_the_command_that_installs_it(
    run, tmp_path, monkeypatch, package, use
):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=rf"'{package}'.*-m pip install .*{package}"):
        use(run, tmp_path)


def test_a_run_without_channels_is_a_picture_without_lines():
    assert not Run(np.zeros(0), {}).plot().axes[0].lines


def test_a_run_without_channels_makes_no_empty_table(tmp_path):
    with pytest.raises(RecordingError, match="would have no column"):
        Run(np.zeros(0), {}).write(tmp_path / "run.csv")
    assert not (tmp_path / "run.csv").exists()
