"""`python -m ldcs_ros <verb>`: the command line without an installed script."""

from __future__ import annotations

import sys

from ldcs_ros.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
