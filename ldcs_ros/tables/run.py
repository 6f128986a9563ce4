"""Run: what a simulation or a recording did over time, as labelled arrays for pandas, xarray, pictures and files."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ldcs_ros import __version__, extras
from ldcs_ros.errors import RecordingError, one_line
from ldcs_ros.schema.units import AXES

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

SUFFIXES = (".csv", ".parquet", ".nc")
# Prefix or suffix of a channel's name -> the variable of a dataset, its dimension, its unit.
_PRESSURE, _COMMAND, _JOINT = "/pressure", "pressure_command.", "joint/"


@dataclass(frozen=True)
class Run:
    """Channels over common times in SI units and `ldcs_base`.

    Attributes:
        time: Times [s], shape (n,), rising without repetition.
        channels: Values by name, shape (n, 3) for points (`P1`) [m], else (n,): `left/pressure` (gauge) [Pa],
            `joint/left_joint_1` [rad], `pressure_command.left` (gauge) [Pa]. NaN where there is no value.
        node_time: Times of the node positions [s], shape (m,); empty if they are not known.
        nodes: Node positions [m], shape (m, 2, nx, ny, 3): layer (bottom, top), i along x, j along y.
        title: Title or name of the scene, '' if it is not known.
    """

    time: np.ndarray
    channels: Mapping[str, np.ndarray]
    node_time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    nodes: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 0, 0, 3)))
    title: str = ""

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Every number of the channels over time by `NAME [UNIT]`, without the time, shape (n,) each.

        A coordinate that is never known has no column.
        """
        found: dict[str, np.ndarray] = {}
        for name, values in self.channels.items():
            if values.ndim == 2:
                found |= {f"{name}.{AXES[k]} [m]": values[:, k] for k in known_axes(values)}
            else:
                found[f"{name} [{'rad' if name.startswith(_JOINT) else 'Pa'}]"] = values
        return found

    def to_pandas(self) -> DataFrame:
        """Return a pandas.DataFrame of `columns` with the index `time [s]`.

        Raises:
            MissingPackageError: pandas is not installed.
        """
        pandas = extras.load("pandas", extra="data", purpose="to_pandas")
        return pandas.DataFrame(self.columns, index=pandas.Index(self.time, name="time [s]"))

    def to_xarray(self) -> Dataset:
        """Return an xarray.Dataset.

        Variables with their dimensions: position (time, point, axis) [m], pressure and pressure_command (time, arm)
        [Pa, gauge], joint_angle (time, joint) [rad], and node (node_time, layer, i, j, axis) [m] if nodes are known.

        Raises:
            MissingPackageError: xarray is not installed.
        """
        xarray = extras.load("xarray", extra="data", purpose="to_xarray")
        kinds: tuple[tuple[str, tuple[str, ...], str, Callable[[str], bool]], ...] = (
            ("position", ("time", "point", "axis"), "m", lambda name: name.isidentifier()),
            ("pressure", ("time", "arm"), "Pa", lambda name: name.endswith(_PRESSURE)),
            ("pressure_command", ("time", "arm"), "Pa", lambda name: name.startswith(_COMMAND)),
            ("joint_angle", ("time", "joint"), "rad", lambda name: name.startswith(_JOINT)),
        )
        arms = list(
            dict.fromkeys(_label(name) for name in self.channels if _PRESSURE in name or _COMMAND in name)
        )
        variables: dict[str, object] = {}
        labels: dict[str, object] = {"time": ("time", self.time, {"units": "s"})}
        for variable, dimensions, unit, belongs in kinds:
            values = {_label(name): value for name, value in self.channels.items() if belongs(name)}
            if not values:
                continue
            if dimensions[1] == "arm":
                absent = np.full(len(self.time), np.nan)
                values = {arm: values.get(arm, absent) for arm in arms}
            labels[dimensions[1]] = list(values)
            variables[variable] = (dimensions, np.stack(list(values.values()), axis=1), {"units": unit})
        if len(self.node_time):
            labels |= {"node_time": ("node_time", self.node_time, {"units": "s"}), "layer": ["bottom", "top"]}
            variables["node"] = (("node_time", "layer", "i", "j", "axis"), self.nodes, {"units": "m"})
        if "position" in variables or "node" in variables:
            labels["axis"] = list(AXES)
        about = {"title": self.title, "frame": "ldcs_base", "source": f"ldcs_ros {__version__}"}
        return xarray.Dataset(variables, labels, about)

    def plot(self) -> Figure:
        """Return a matplotlib figure: displacement of each point since the first time, pressures, joint angles."""
        from matplotlib.figure import Figure

        panels: dict[str, dict[str, np.ndarray]] = {}
        for name, values in self.channels.items():
            if values.ndim == 2:
                first = values[np.argmax(np.isfinite(values), axis=0), range(3)]
                panels.setdefault("displacement [mm]", {}).update(
                    {f"{name}.{AXES[k]}": 1e3 * (values - first)[:, k] for k in known_axes(values)}
                )
            elif name.startswith(_JOINT):
                panels.setdefault("joint angle [deg]", {})[_label(name)] = np.rad2deg(values)
            else:
                label = _label(name) + (" commanded" if name.startswith(_COMMAND) else "")
                panels.setdefault("pressure [kPa, gauge]", {})[label] = 1e-3 * values
        figure = Figure(figsize=(7.0, 2.4 * max(1, len(panels))), layout="constrained")
        grid = figure.subplots(max(1, len(panels)), sharex=True, squeeze=False)[:, 0]
        for axes, (label, lines) in zip(grid, panels.items(), strict=False):
            for name, values in lines.items():
                known = np.isfinite(values)
                axes.plot(self.time[known], values[known], label=name, linewidth=1.2)
            axes.set_ylabel(label)
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
        grid[-1].set_xlabel("time [s]")
        figure.suptitle(self.title)
        return figure

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a new file: .csv or .parquet with a row a time, or .nc (netCDF 3) with the dataset of `to_xarray`.

        Raises:
            RecordingError: The suffix is another one, the file exists or cannot be written, or has no columns.
            MissingPackageError: The package for the format is not installed.
        """
        file = Path(path)
        if file.suffix not in SUFFIXES:
            raise RecordingError(f"{file}: got the suffix {file.suffix!r}, expected one of {list(SUFFIXES)}")
        if file.exists():
            raise RecordingError(f"{file} exists; name another file")
        if file.suffix != ".nc" and not self.columns:
            raise RecordingError(f"{file} would have no column: there are nodes alone, which .nc files hold")
        try:
            if file.suffix == ".nc":
                self.to_xarray().to_netcdf(file, engine="scipy")
            elif file.suffix == ".csv":
                write_csv(file, {"time [s]": self.time, **self.columns})
            else:
                arrow = extras.load("pyarrow", extra="data", purpose=f"{file.name} (Parquet)")
                parquet = extras.load("pyarrow.parquet", extra="data", purpose=f"{file.name} (Parquet)")
                parquet.write_table(arrow.table({"time [s]": self.time, **self.columns}), file)
        except OSError as error:
            raise RecordingError(f"{file} cannot be written: {one_line(error)}") from error


def known_axes(values: np.ndarray) -> list[int]:
    """Return the coordinates of positions, shape (n, 3), that are known at some time; all if none is."""
    known = np.flatnonzero(np.isfinite(values).any(axis=0))
    return known.tolist() if len(known) else [0, 1, 2]


def write_csv(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, shape (n,) each, into a CSV file: shortest digits that give the same number again, NaN empty."""
    with path.open("x", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in np.column_stack(list(columns.values())).tolist():
            writer.writerow(["" if value != value else repr(value) for value in row])


def _label(name: str) -> str:
    return name.removeprefix(_JOINT).removeprefix(_COMMAND).removesuffix(_PRESSURE)
