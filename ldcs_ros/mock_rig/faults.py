"""Faults of the mock rig; each may be set while it runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ldcs_ros.errors import BridgeError


@dataclass
class Faults:
    """The present faults.

    Attributes:
        mute: It reports nothing more, but still obeys.
        delay: Its reports come this much later [s].
        stuck: Arm whose valve stays as it is; '' for none.
        leak: Arm that loses air; '' for none.
        duplicates: Every report is sent this many times more.
        clock_jump: Its clock is off by this much more [s].
        nan: Arm whose pressure sensor reports invalid values; '' for none.
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

    def set(self, name: str, value: object, arms: Sequence[str]) -> None:
        """Set a fault of a rig with these arms.

        Raises:
            BridgeError: The fault is unknown, or the value does not fit.
        """
        fields = {field.name: field for field in dataclasses.fields(self)}
        if name not in fields:
            raise BridgeError(f"unknown fault {name!r}; expected one of {list(fields)}")
        present = fields[name].default
        if isinstance(present, str) and value not in ("", *arms):
            raise BridgeError(f"fault {name} is {value!r}, expected one of {['', *arms]}")
        if isinstance(present, (bool, float, int)) and not isinstance(value, (bool, float, int)):
            raise BridgeError(f"fault {name} is {value!r}, expected {type(present).__name__}")
        kind: Callable[[object], object] = type(present)
        setattr(self, name, kind(value))
