"""The figures of long runs as rows (what, measured, required, kept), and the page that shows them."""

from __future__ import annotations

import json
from pathlib import Path

HEAD = """# Under load and fault

Written by the commands in it. A row says what was measured and what is required; one that does not keep it ends the
command with status 1. The same runs, of a few seconds each, are tests (`test/faults`). The node is a process of its
own; what it did is read from its diagnostics, from its bag and, for memory and processor time, from the system. DDS
goes over shared memory.
"""
TITLES = {
    "soak": ("A long run at 200 Hz, recorded", "make soak"),
    "soak_short": ("The same for nine minutes, to its regular end", "make soak SECONDS={seconds:.0f}"),
    "flood": ("A flood of commands", "make faults"),
    "joins": ("A hundred subscribers join and leave", "make faults"),
    "kill": ("Killed while it records", "make faults"),
    "disk": ("A full disk", "make faults"),
    "fuzz": ("Random messages, services and parameters", "make fuzz SEED={seed}"),
}


def row(what: str, measured: object, required: str, kept: bool) -> dict[str, object]:
    """Return one row; a number is shown with four figures."""
    shown = f"{measured:.4g}" if isinstance(measured, float) else str(measured)
    return {"what": what, "measured": shown, "required": required, "kept": bool(kept)}


def save(docs: Path, name: str, run: dict[str, object]) -> None:
    """Keep the figures of a run beside those of the others, and write the page anew."""
    docs.mkdir(parents=True, exist_ok=True)
    file = docs / "under_load.json"
    runs = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    runs[name] = run
    file.write_text(json.dumps(runs, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    (docs / "under_load.md").write_text(page(runs), encoding="utf-8")


def page(runs: dict[str, dict]) -> str:
    """Return the page as Markdown."""
    parts = [HEAD]
    for name, (title, command) in TITLES.items():
        if name not in runs:
            continue
        run = runs[name]
        machine = ", ".join(f"{key} {value}" for key, value in run["machine"].items())
        lines = ["| what | measured | required | |", "|---|---:|---|---|"]
        lines += [
            f"| {one['what']} | {one['measured']} | {one['required']} | {_verdict(one)} |"
            for one in run["rows"]
        ]
        command = command.format(**run["options"])
        note = f"{run['note']}\n\n" if "note" in run else ""
        head = f"## {title}\n\n`{command}` ({run['took']:.0f} s): {machine}.\n\n{note}"
        parts.append(head + "\n".join(lines) + "\n")
    return "\n".join(parts)


def _verdict(one: dict) -> str:
    if not one["required"]:
        return ""
    return "kept" if one["kept"] else "**not kept**"
