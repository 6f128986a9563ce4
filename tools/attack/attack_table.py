"""The table of attacks in Markdown, between two markers of a page."""

from __future__ import annotations

import re
from pathlib import Path

from attack_run import MARGIN, PROMISE, Row

BEGIN, END = "<!-- attacks: begin -->", "<!-- attacks: end -->"
_LONGEST = 110


def write_table(page: Path, rows: list[Row]) -> None:
    """Replace the table of a page.

    Raises:
        ValueError: The page has no markers.
    """
    text = page.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise ValueError(f"{page} has no markers {BEGIN} and {END}")
    head, tail = text.split(BEGIN)[0], text.split(END)[1]
    page.write_text(f"{head}{BEGIN}\n{table(rows)}\n{END}{tail}", encoding="utf-8")


def table(rows: list[Row]) -> str:
    """Return the table with one line that sums it up."""
    unsafe = sum(not row.safe for row in rows)
    lines = [
        f"{len(rows)} events, {unsafe} unsafe. Promise: `command_timeout + vent_time` + {MARGIN:g} s = {PROMISE:g} s.",
        "",
        "| link | state | event | zero set-point | chambers empty | the operator sees | exit | verdict |",
        "|---|---|---|---|---|---|---|---|",
    ]
    return "\n".join([*lines, *map(_line, rows)])


def _line(row: Row) -> str:
    seen = row.seen if len(row.seen) <= _LONGEST else f"{row.seen[: _LONGEST - 3]}..."
    seen = re.sub(r"[|`<>]", " ", seen)
    verdict = "safe" if row.safe else f"UNSAFE: {'; '.join(row.faults)}".replace("|", "/")
    cells = (
        row.transport,
        row.phase,
        row.what,
        _time(row, row.zero),
        _time(row, row.empty),
        seen,
        row.exit_status,
        verdict,
    )
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def _time(row: Row, value: float | None) -> str:
    if row.expected in ("stays empty", "refused at the start"):
        return row.expected if row.safe else "-"
    return "never" if value is None else f"{value:.2f} s"
