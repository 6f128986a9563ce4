"""The order that each method has on the stiff sheet, from its rows with fixed steps."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ldcs_ros.study.tasks import Row

# Errors below are those of iterations (to 1e-8 m with fixed steps), above no order shows [m].
LEAST, MOST = 3e-8, 1e-3
SCENE, NODES = "arc", 9
# A measured order below this share of the printed one is a drop.
WHOLE = 0.85


def orders(rows: Sequence[Row]) -> dict[str, list[tuple[float, float, float]]]:
    """Return, by method, (longer step [s], shorter step [s], order between them)."""
    found: dict[str, list[tuple[float, float, float]]] = {}
    made: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if (row.kind, row.scene, row.nodes, row.setting) == ("curve", SCENE, NODES, "dt") and not row.failure:
            if LEAST <= row.error <= MOST and row.steps:
                made.setdefault(row.method, []).append((row.value, row.error))
    for method, points in made.items():
        points.sort(reverse=True)
        for (long, large), (short, small) in zip(points, points[1:], strict=False):
            order = math.log(large / small) / math.log(long / short)
            found.setdefault(method, []).append((long, short, order))
    return found


def mean_order(pairs: Sequence[tuple[float, float, float]]) -> float:
    """Return the order over all of a method's steps: from its longest to its shortest."""
    whole = sum(order * math.log(long / short) for long, short, order in pairs)
    return whole / sum(math.log(long / short) for long, short, _ in pairs)
