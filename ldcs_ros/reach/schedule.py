"""Commands as entries of a scene's `inputs`."""

from __future__ import annotations

from collections.abc import Collection

from ldcs_ros.physics.inputs import HeldCommands

Entries = tuple[dict[str, object], ...]


def entries(time: float, held: HeldCommands, names: Collection[str] | None = None) -> Entries:
    """Return the entries of a time [s] that command what is held.

    Args:
        time: Time of the entries [s].
        held: The commands.
        names: Commands whose kinds and frames alone are needed, such as `pressure.left`; None for all.
    """
    kinds = None if names is None else {name.partition(".")[0] for name in names}
    frames = None if names is None else {name.split(".")[1] for name in names if name.startswith("wrench.")}
    entry: dict[str, object] = {"time": time}
    if held.chambers and (kinds is None or "pressure" in kinds):
        entry["pressure"] = [chamber.target for chamber in held.chambers]
    if held.torque is not None and (kinds is None or "torque" in kinds):
        entry["torque"] = held.torque.tolist()
    found = [entry] if len(entry) > 1 else []
    for frame, wrench in held.wrenches.items():
        if frames is None or frame in frames:
            part = {"frame": frame, "force": list(wrench.force), "torque": list(wrench.torque)}
            found.append({"time": time, "wrench": part})
    return tuple(found)
