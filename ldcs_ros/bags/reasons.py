"""The cause of a foreign error in one line, for messages that must be one line."""

from __future__ import annotations


def reason(error: BaseException) -> str:
    """What the system or a library says is wrong, without line breaks; never empty."""
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split()) or repr(error)
