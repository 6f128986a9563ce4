"""Fault switches of the stand-in rig; each may be turned while it runs."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from ldcs_ros.errors import BridgeError

_ARMS = ("", "left", "right")


@dataclass
class Faults:
    """What is broken at present.

    Attributes:
        mute: It says nothing more, but still obeys.
        delay: What it says comes this much later [s].
        stuck: Arm whose valve stays as it is; '' for none.
        leak: Arm that loses air; '' for none.
        duplicates: Every report is sent this many times more.
        clock_jump: Its clock is off by this much more [s].
        nan: Arm whose pressure sensor reports nonsense; '' for none.
        drop: The connection is gone.
    """

    mute: bool = False
    delay: float = 0.0
    stuck: str = ""
    leak: str = ""
    duplicates: int = 0
    clock_jump: float = 0.0
    nan: str = ""
    drop: bool = False

    def set(self, name: str, value: object) -> None:
        """Turn a switch; raises BridgeError when there is no such switch or the value does not fit."""
        fields = {field.name: field for field in dataclasses.fields(self)}
        if name not in fields:
            raise BridgeError(f"unknown fault {name!r}; expected one of {list(fields)}")
        present = fields[name].default
        if isinstance(present, str) and value not in _ARMS:
            raise BridgeError(f"fault {name} is {value!r}, expected one of {list(_ARMS)}")
        if isinstance(present, (bool, float, int)) and not isinstance(value, (bool, float, int)):
            raise BridgeError(f"fault {name} is {value!r}, expected {type(present).__name__}")
        kind: Any = type(present)
        setattr(self, name, kind(value))
