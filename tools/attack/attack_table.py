"""The table of attacks in Markdown, between two markers of a page; its rows are kept beside it as JSON."""

from __future__ import annotations

import dataclasses
import fcntl
import json
import os
import platform
import re
from collections.abc import Iterable
from pathlib import Path

from attack_run import MARGIN, PROMISE, REFUSED, STAYS_EMPTY, SURVIVES, Event, Row
from bridge_process import BRIDGE_PRIORITY, DEVICE_PRIORITY

BEGIN, END = "<!-- attacks: begin -->", "<!-- attacks: end -->"
_LONGEST = 110

Key = tuple[str, str, str]


def write_table(page: Path, rows: Iterable[Row], order: Iterable[Row | Event]) -> None:
    """Replace the measured rows of a page's table in an order; other rows stay as they were measured last.

    Raises:
        ValueError: The page has no markers.
    """
    store = page.with_name("attacks.json")
    with open(page, encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        text = page.read_text(encoding="utf-8")
        if BEGIN not in text or END not in text:
            raise ValueError(f"{page} has no markers {BEGIN} and {END}")
        known = {_key(row): row for row in _read(store)} | {_key(row): row for row in rows}
        keys = dict.fromkeys(_key(one) for one in order)
        kept = [known[key] for key in keys if key in known]
        content = [dataclasses.asdict(row) for row in kept]
        store.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        head, tail = text.split(BEGIN)[0], text.split(END)[1]
        page.write_text(f"{head}{BEGIN}\n{table(kept)}\n{END}{tail}", encoding="utf-8")


def safe_rows(page: Path) -> set[Key]:
    """Return the keys of the rows of a page that were measured as safe."""
    return {_key(row) for row in _read(page.with_name("attacks.json")) if row.safe}


def table(rows: list[Row]) -> str:
    """Return the table with one line that sums it up."""
    unsafe = sum(not row.safe for row in rows)
    lines = [
        f"{len(rows)} events, {unsafe} unsafe. Promise: `command_timeout + vent_time` + {MARGIN:g} s = {PROMISE:g} s.",
        f"Measured beside other work on {os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python "
        f"{platform.python_version()}; nice {DEVICE_PRIORITY} of devices, operator and busy loops, "
        f"{BRIDGE_PRIORITY} of the bridge.",
        "",
        "| link | state | event | zero set-point | chambers empty | the operator sees | exit | verdict |",
        "|---|---|---|---|---|---|---|---|",
    ]
    return "\n".join([*lines, *map(_line, rows)])


def _read(store: Path) -> list[Row]:
    if not store.exists():
        return []
    content = json.loads(store.read_text(encoding="utf-8"))
    return [Row(**{**one, "faults": tuple(one["faults"])}) for one in content]


def _key(row: Row | Event) -> Key:
    return row.transport, row.phase, row.what


def _line(row: Row) -> str:
    seen = row.seen if len(row.seen) <= _LONGEST else f"{row.seen[: _LONGEST - 3]}..."
    verdict = "safe" if row.safe else f"UNSAFE: {'; '.join(row.faults)}"
    times = _time(row, row.zero), _time(row, row.empty)
    cells = (row.transport, row.phase, row.what, *times, seen, row.exit_status, verdict)
    return f"| {' | '.join(re.sub(r'[|`<>]', ' ', str(cell)) for cell in cells)} |"


def _time(row: Row, value: float | None) -> str:
    if row.expected in (STAYS_EMPTY, REFUSED, SURVIVES):
        return row.expected if row.safe else "-"
    return "never" if value is None else f"{value:.2f} s"
