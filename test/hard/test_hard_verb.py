"""`ldcs study --hard` as a user meets it: a row a case, a page, a status."""

from __future__ import annotations

import json

from ldcs_ros.cli.main import main


def test_chosen_cases_leave_a_page_and_a_status(capsys, tmp_path):
    assert main(["study", "--hard", "--only", "lattice [2, 2]", "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "lattice [2, 2] with arms" in printed and "2 within 1" in printed
    page = (tmp_path / "hard_cases.md").read_text()
    assert "| lattice [2, 2] | 1e-05 | within 1 |" in page and "nan" not in page
    assert "ldcs study --hard --only 'lattice [2, 2]'" in page


def test_a_stopped_case_says_why_in_json(capsys, tmp_path):
    assert main(["study", "--hard", "--only", "rk4, dt", "-o", str(tmp_path), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["outcome"] for row in rows] == ["stopped"] and "stability limit" in rows[0]["note"]


def test_an_unknown_word_is_told(capsys, tmp_path):
    assert main(["study", "--hard", "--only", "no such case", "-o", str(tmp_path)]) == 2
    assert "no such case" in capsys.readouterr().err
