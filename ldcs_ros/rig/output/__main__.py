"""`python -m ldcs_ros.rig.output`: the output process of a Modbus or serial link; the bridge starts it."""

from __future__ import annotations

import sys

from ldcs_ros.rig.output.process import serve, wire_device

if __name__ == "__main__":
    sys.exit(serve(wire_device))
