"""What a simulation consists of, as the standard simulator services see it: points, arm links, nodes."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ldcs_ros.physics.effects.arms import ArmsTerm
from ldcs_ros.physics.lattice import LAYERS, Lattice
from ldcs_ros.physics.model import Model
from ldcs_ros.physics.points import Point, point_at
from ldcs_ros.ros.simulator.entity_motion import Means, Motions, link_motions
from ldcs_ros.simulation.simulation import Simulation

_INSTANT = 1e-6  # s, between two looks at the rates of what is prescribed


class Kind(enum.Enum):
    """What an entity is; the value is also its first tag."""

    POINT = "point"
    NODE = "node"
    LINK = "link"


@dataclass(frozen=True)
class Entity:
    """One entity.

    Attributes:
        name: Unique name: of a point, `node_<layer>_<i>_<j>`, or `<arm>_link_<k>`.
        row: Its row in `Motions`.
        kind: What it is.
        description: The same for a person.
        tags: Words by which it can be chosen.
        still: It is clamped and never moves.
    """

    name: str
    row: int
    kind: Kind
    description: str
    tags: tuple[str, ...]
    still: bool = False


@dataclass(frozen=True)
class Instant:
    """A simulation at an instant, in flat coordinates: nodes [m], then link angles [rad].

    Attributes:
        time: Simulation time [s].
        q: Coordinates.
        u: Their rates.
        a: Their accelerations.
    """

    time: float
    q: np.ndarray
    u: np.ndarray
    a: np.ndarray


class Entities:
    """The entities of one simulation.

    Args:
        simulation: What they belong to.

    Attributes:
        all: The entities by name: points, then nodes, then links.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        lattice = simulation.lattice
        arms = simulation.model.arms if isinstance(simulation.model.arms, ArmsTerm) else None
        named = [*((Kind.POINT, name, point) for name, point in simulation.points.items()), *_nodes(lattice)]
        links = (
            []
            if arms is None
            else [(arm, k + 1) for arm in simulation.arm_names for k in range(arms.n_links)]
        )
        self._means = Means([point for *_, point in named], lattice.n_nodes)
        self._arms = arms
        self._across = [] if arms is None else _across(arms, lattice)
        clamped = _clamped(simulation.model)
        found: list[Entity] = []
        for kind, name, point in named:
            still = clamped.issuperset(point.nodes.tolist())
            found.append(_of_sheet(name, len(found), kind, point, still))
        for arm, number in links:
            tags = (Kind.LINK.value, "arm", arm)
            words = f"link {number} of the {arm} arm, counted from its base"
            found.append(Entity(f"{arm}_link_{number}", len(found), Kind.LINK, words, tags))
        self.all = {entity.name: entity for entity in found}

    def instant(self) -> Instant:
        """Return what the simulation is doing; on the thread that owns it. What is returned may go elsewhere."""
        time, model = self._simulation.time, self._simulation.model
        # Not from the forces: in stiff directions these answer to errors of a position far below the accuracy.
        motion = self._simulation.last_step.at(time, model)
        before, after, place = motion.u.copy(), motion.u.copy(), motion.q.copy()
        model.prescribe(time - _INSTANT, place, before)
        model.prescribe(time + _INSTANT, place, after)
        a = (after - before) / (2.0 * _INSTANT)
        a[model.free] = motion.a
        return Instant(time, motion.q, motion.u, a)

    def motions(self, instant: Instant) -> Motions:
        """Return how all entities move at an instant."""
        simulation, flat = self._simulation, (instant.q, instant.u, instant.a)
        n = 3 * simulation.lattice.n_nodes
        q, u, a = (one[:n].reshape(-1, 3) for one in flat)
        sheet = self._means.motions((q, u, a))
        if self._arms is None:
            return sheet
        phi, rate, bend = (one[n:].reshape(2, -1) for one in flat)
        return link_motions(self._arms, self._across, (phi, rate, bend)).behind(sheet)


def _nodes(lattice: Lattice) -> Iterable[tuple[Kind, str, Point]]:
    for layer in LAYERS:
        for i in range(lattice.nodes[0]):
            for j in range(lattice.nodes[1]):
                yield Kind.NODE, f"node_{layer}_{i}_{j}", point_at(lattice, [layer, i, j])


def _of_sheet(name: str, row: int, kind: Kind, point: Point, still: bool) -> Entity:
    layers = [LAYERS[layer] for layer in point.layers] if len(point.layers) == 1 else ["mid"]
    tags = (kind.value, "sheet", *layers, *(["clamped"] if still else []))
    columns, rows = (" and ".join(map(str, numbers)) for numbers in (point.columns, point.rows))
    where = f"column {columns}, row {rows}"
    if kind is Kind.NODE:
        return Entity(name, row, kind, f"point mass of the {layers[0]} layer, {where}", tags, still)
    return Entity(name, row, kind, f"point of the sheet, {layers[0]}, {where}", tags, still)


def _clamped(model: Model) -> set[int]:
    held = [term.fixed() // 3 for term in model.terms if term.name == "clamp"]
    return set(np.concatenate(held).tolist()) if held else set()


def _across(arms: ArmsTerm, lattice: Lattice) -> list[float]:
    # An arm that covers several rows stands in their middle.
    arm_of, rows = arms.couplings[0], arms.couplings[3]
    return [float(np.mean(np.unique(rows[arm_of == arm]))) for arm in (0, 1)]
