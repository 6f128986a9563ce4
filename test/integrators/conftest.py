"""For `dense_sheet`, which the files of executed kernels share."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
