"""The notebooks of the docs run from top to bottom, and say what they promise."""

from __future__ import annotations

import contextlib
import io
import json
import re
from pathlib import Path

import matplotlib
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "docs/notebooks"
NOTEBOOKS = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
QUICKEST = "first_run"
SAID = {
    "closed_loop": r"at the end (39|40)\.\d\d mm, asked 40 mm",
    "cost_of_accuracy": r"asked 1e-07 +real \d\.\de-0[89]",
    "first_run": r"P1 is at \[127\.\d+ ",
    "own_recording": r"fitted 8\.[789]\d*e-07, hidden 8\.8e-07",
    "own_surface": r"\[25, 13\] \[ *1\.61",
    "which_pressures": r"pressure\.left +140\.8",
}


def cells(name: str) -> list[str]:
    notebook = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]


@pytest.mark.timeout(120)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == QUICKEST else pytest.mark.slow) for name in NOTEBOOKS]
)
def test_a_notebook_runs_and_says_what_it_promises(name, monkeypatch):
    if name == "closed_loop":
        pytest.importorskip("rclpy", reason="ROS 2 is not installed")
        pytest.importorskip("ldcs_msgs", reason="ldcs_msgs is not built")
    if name == "first_run":
        pytest.importorskip("pandas", reason="the extra [data] is not installed")
    matplotlib.use("Agg")
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")  # put back afterwards; a notebook with a node takes its own
    space: dict[str, object] = {"__name__": "__main__"}
    with contextlib.redirect_stdout(io.StringIO()) as said:
        for source in cells(name):
            exec(compile(re.sub(r"(?m)^%.*$", "", source), name, "exec"), space)
    assert re.search(SAID[name], said.getvalue()), said.getvalue()


def test_each_notebook_is_small_and_has_its_outputs():
    assert sorted(SAID) == NOTEBOOKS
    for name in NOTEBOOKS:
        path = FOLDER / f"{name}.ipynb"
        assert path.stat().st_size < 250_000, name
        notebook = json.loads(path.read_text(encoding="utf-8"))
        assert any(cell.get("outputs") for cell in notebook["cells"]), f"{name}: run `make notebooks`"
