"""SROS2 by its environment variables: whoever asks for security is told when this process would have none."""

from __future__ import annotations

from collections.abc import Mapping

from ldcs_ros.errors import LdcsError


def check_security(environment: Mapping[str, str]) -> str:
    """Return a warning, or ''.

    With ROS_SECURITY_STRATEGY=Enforce ROS itself refuses to run unprotected; without it, it does so in silence.

    Raises:
        LdcsError: Security is enforced and cannot be had, for which ROS has no words.
    """
    if environment.get("ROS_SECURITY_ENABLE") != "true":
        return ""
    enforced = environment.get("ROS_SECURITY_STRATEGY") == "Enforce"
    if not environment.get("ROS_SECURITY_KEYSTORE"):
        trouble = "ROS_SECURITY_ENABLE is true, but ROS_SECURITY_KEYSTORE names no keystore"
        if enforced:
            raise LdcsError(f"{trouble}; make one, see docs/security.md, or unset ROS_SECURITY_ENABLE")
        return f"{trouble}: this node runs unprotected; ROS_SECURITY_STRATEGY=Enforce refuses that"
    if not enforced:
        return (
            "ROS_SECURITY_STRATEGY is not Enforce: a node that finds no keys of its enclave runs unprotected; "
            "set ROS_SECURITY_STRATEGY=Enforce"
        )
    return ""
