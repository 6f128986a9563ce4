"""Run the notebooks of the docs and keep their outputs: `make notebooks`."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import nbformat
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[1] / "docs/notebooks"
LONGEST = 120  # s for one cell


def main() -> int:
    """Run each notebook in its own kernel and write it back with its outputs; return 0."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="notebooks to run; all if none is named")
    names = parser.parse_args().names or sorted(path.stem for path in FOLDER.glob("*.ipynb"))
    # The kernel of this environment, whatever kernels the machine knows.
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for name in names:
        path = FOLDER / f"{name}.ipynb"
        notebook = nbformat.read(path, as_version=4)
        began = time.perf_counter()
        # Kernels of this machine alone: their sockets are files.
        manager = AsyncKernelManager(kernel_name="python3", transport="ipc")
        NotebookClient(notebook, km=manager, timeout=LONGEST, record_timing=False).execute()
        for cell in notebook.cells:
            cell.metadata.clear()
        nbformat.write(notebook, path)
        print(f"{name}: {time.perf_counter() - began:.0f} s, {path.stat().st_size // 1024} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
