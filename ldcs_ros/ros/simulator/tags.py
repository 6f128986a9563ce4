"""Choosing by tags, as entities and worlds are chosen."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from simulation_interfaces.msg import Result, TagsFilter

from ldcs_ros.ros.simulator.answers import Refused


class TagChoice:
    """Tells whether tags are wanted; without any that are, all of them pass.

    Args:
        wanted: Message TagsFilter.

    Raises:
        Refused: Its mode is none.
    """

    def __init__(self, wanted: Any) -> None:
        modes = (TagsFilter.FILTER_MODE_ANY, TagsFilter.FILTER_MODE_ALL)
        if wanted.filter_mode not in modes:
            reason = f"tag filter mode {wanted.filter_mode}, expected any ({modes[0]}) or all ({modes[1]})"
            raise Refused(Result.RESULT_OPERATION_FAILED, reason)
        self._tags = frozenset(wanted.tags)
        self._all = wanted.filter_mode == TagsFilter.FILTER_MODE_ALL

    def takes(self, tags: Iterable[str]) -> bool:
        """Return whether something with these tags is wanted."""
        common = self._tags & frozenset(tags)
        return not self._tags or (common == self._tags if self._all else bool(common))
