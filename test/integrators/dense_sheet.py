"""Small sheets near their reference, their mass and stage matrices as dense ones."""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag
from small_sheet import small_sheet

from ldcs_ros.scene import load_scene

ARMS = {"drive": "torque", "links": 2, "width": 0}
FLOOR = {"type": "floor", "height": -0.02}
DRAG = {"type": "drag"}


def sheet(*effects, nodes=(4, 3), arms=ARMS, **solver):
    return load_scene(small_sheet(*effects, nodes=nodes, arms=arms, solver=solver)).build()


def loose(**solver):
    content = small_sheet(nodes=(3, 3), solver=solver)
    content["effects"] = [effect for effect in content["effects"] if effect["type"] == "springs"]
    return load_scene(content).build()


def moved(simulation, seed=3):
    """Return a motion near the reference with random displacements, rates and accelerations."""
    model, random = simulation.model, np.random.default_rng(seed)
    q, u = model.reference_state()
    q[model.free] += 1e-3 * random.normal(size=len(model.free))
    u[model.free] += 0.1 * random.normal(size=len(model.free))
    return q, u, random


def dense_mass(model, q):
    blocks = model.inertia(q)
    return block_diag(np.diag(model.mass), *([] if blocks is None else blocks))


def dense_stage(model, q, u, held, h):
    """Return W = M - h C - h^2 K, made symmetric."""
    by_position, by_rate = model.jacobian(0.0, q, u, held, positive_definite=False)
    rows, columns = model.jacobian_pattern
    used = (rows >= 0) & (columns >= 0)
    matrix = np.zeros((len(model.free), len(model.free)))
    np.add.at(matrix, (rows[used], columns[used]), -h * (by_rate + h * by_position)[used])
    return 0.5 * (matrix + matrix.T) + dense_mass(model, q)
