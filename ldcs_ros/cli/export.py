"""`ldcs export`: a bag or a table as CSV, Parquet or netCDF."""

from __future__ import annotations

import argparse
from pathlib import Path

from ldcs_ros.cli.output import open_bag_or_table, print_json, print_pairs
from ldcs_ros.cli.scene_argument import add_map, given_mapping

DESCRIPTION = """\
Write what a bag says over time: positions of its points in ldcs_base [m], gauge pressures and commanded pressures
[Pa], joint angles [rad]. CSV and Parquet have a row a time and a column a number, named `P1.x [m]`; a cell is empty
where nothing was measured at that time. netCDF (.nc) has the nodes, too. `ldcs identify`, `replay` and `compare`
read such a CSV or Parquet file without a mapping. Parquet and netCDF need the extra [data]."""
EXAMPLE = """\
ldcs export out/paper -o paper.csv
  ldcs export rig_bag --map rig_topics.yaml -o rig.parquet
  ldcs export out/paper --measured -o paper.nc"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "source", metavar="BAG", type=Path, help="bag folder, .mcap, .db3, .csv or .parquet file"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=Path, required=True, help="new file: .csv, .parquet or .nc"
    )
    add_map(parser)
    parser.add_argument(
        "--measured", action="store_true", help="take what a twin's tracker reports, not the truth"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the file, print what it holds; status 0."""
    from ldcs_ros.signals.run import run_of

    recording, mapping = open_bag_or_table(arguments.source, given_mapping(arguments))
    found = run_of(recording, mapping, measured=arguments.measured)
    found.write(arguments.output)
    names = list(found.columns)
    if arguments.json:
        print_json({"file": arguments.output, "rows": len(found.time), "columns": names})
    else:
        print_pairs(
            [("rows", str(len(found.time))), ("columns", ", ".join(names)), ("file", str(arguments.output))]
        )
    return 0
