"""Corrects the CMake exports of the ROS wheels in the running venv: they name folders of their build machine.

Run by `make setup` with the venv's own Python; running it again changes nothing.
"""

from __future__ import annotations

import re
import sys
import sysconfig
from pathlib import Path

import numpy

FOREIGN = re.compile(r'/opt/python/cp\d+-cp\d+t?/[^;"\s>]+')


def local_folder(match: re.Match[str]) -> str:
    """Return the folder of this Python that stands for a folder of the build machine."""
    if "numpy" in match.group():
        return numpy.get_include()
    return sysconfig.get_path("include")


def main() -> None:
    """Correct the CMake exports of all installed packages of ROS."""
    corrected = 0
    for export in sorted(Path(sys.prefix, "share").rglob("*.cmake")):
        text = export.read_text(encoding="utf-8")
        new_text = FOREIGN.sub(local_folder, text)
        if new_text != text:
            export.write_text(new_text, encoding="utf-8")
            corrected += 1
    print(f"setup: corrected {corrected} CMake exports of the ROS wheels")


if __name__ == "__main__":
    main()
