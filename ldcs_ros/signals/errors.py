"""The error of a mapping file that cannot be understood, or that does not fit its bag."""

from __future__ import annotations

from ldcs_ros.errors import LdcsError


class MappingError(LdcsError, ValueError):
    """A mapping file is not sound, or a message is not what it says."""
