"""Where the nodes' coordinates stand in the sheet, and where the entries of their matrix go in an order of them."""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.model import Model


def sheet_places(model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return layer, i, j and axis of each free node coordinate, shape (n,) each."""
    node, axis = np.divmod(model.free[: model.n_free_nodes], 3)
    layer, i, j = np.unravel_index(node, (2, *model.lattice.nodes))
    return layer, i, j, axis


def inverse_permutation(order: np.ndarray) -> np.ndarray:
    """Return the place of each coordinate in an order of all of them, shape (n,)."""
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    return place


def lower_triangle(place: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the row and the column of each entry, or of its mirror, in the lower triangle, shape (n_entries,)."""
    rows, columns = place[rows], place[columns]
    return np.maximum(rows, columns), np.minimum(rows, columns)
