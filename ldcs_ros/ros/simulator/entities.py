"""The entities of a simulation (points, arm links, nodes) and their kinematics."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from scipy import sparse

from ldcs_ros.physics.effects.arms import ArmsTerm
from ldcs_ros.physics.lattice import LAYERS, Lattice
from ldcs_ros.physics.model import Model
from ldcs_ros.physics.points import Point, Stencil, point_at, quaternion
from ldcs_ros.simulation.simulation import Simulation

Derivatives = tuple[np.ndarray, np.ndarray, np.ndarray]
"""A quantity with its first and second time derivative."""


@dataclass(frozen=True)
class Kinematics:
    """The motion of entities at an instant, in ldcs_base; row k belongs to the k-th.

    Attributes:
        position: Positions [m], shape (n, 3).
        axes: Their frames, axes as columns, shape (n, 3, 3).
        velocity: [m/s], shape (n, 3).
        angular_velocity: Angular velocity [rad/s], shape (n, 3).
        acceleration: [m/s^2], shape (n, 3).
        angular_acceleration: Angular acceleration [rad/s^2], shape (n, 3).
        ends: Begin and end [m], shape (n, 2, 3): the same point for entities without length.
    """

    position: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray
    ends: np.ndarray

    def orientation(self, row: int) -> list[float]:
        """Return an orientation as a unit quaternion x, y, z, w."""
        turned: list[float] = quaternion(self.axes[row]).tolist()
        return turned

    def concatenate(self, other: Kinematics) -> Kinematics:
        """Return these rows, followed by those of another."""
        names = [field.name for field in fields(self)]
        return Kinematics(
            **{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names}
        )


class PointAverages:
    """Motions of points: position and tangents of each are fixed means of the lattice's nodes.

    Args:
        points: The points; all of one lattice.
        n_nodes: Its number of nodes.
    """

    def __init__(self, points: Sequence[Point], n_nodes: int) -> None:
        around = ((point.behind, point.ahead, point.right, point.left) for point in points)
        behind, ahead, right, left = zip(*around, strict=True)
        self._place = _mean([point.stencil for point in points], n_nodes)
        self._along_x = _mean(ahead, n_nodes) - _mean(behind, n_nodes)
        self._along_y = _mean(left, n_nodes) - _mean(right, n_nodes)

    def kinematics(self, nodes: Derivatives) -> Kinematics:
        """Return how they move, from the positions of the nodes [m], shape (n_nodes, 3), and their derivatives."""
        place, velocity, acceleration = (self._place @ flat for flat in nodes)
        along_x, along_y = (tuple(mean @ flat for flat in nodes) for mean in (self._along_x, self._along_y))
        x, z = _unit(along_x), _unit(_cross(along_x, along_y))
        axes = (x, _cross(z, x), z)
        return Kinematics(
            position=place,
            axes=np.stack([axis[0] for axis in axes], axis=-1),
            velocity=velocity,
            # e' = w x e for each axis e, so that sum e x e' = 2 w, and once more derived sum e x e'' = 2 w'.
            angular_velocity=0.5 * np.sum([np.cross(axis[0], axis[1]) for axis in axes], axis=0),
            acceleration=acceleration,
            angular_acceleration=0.5 * np.sum([np.cross(axis[0], axis[2]) for axis in axes], axis=0),
            ends=np.stack([place, place], axis=1),
        )


def link_kinematics(arms: ArmsTerm, q: np.ndarray, angles: Derivatives) -> Kinematics:
    """Return how the links of all arms move, in the order of the scene, base to tip; their places are their middles.

    Args:
        arms: The arms' term of the model.
        q: Coordinates of the model [m, rad].
        angles: Angles to the arms' lines on the flat sheet [rad], shape (n_arms, n_links), and their derivatives.
    """
    phi, rate, bend = angles
    dx, dy = (arms.tables.arms[name][:, None] for name in ("direction_x", "direction_y"))
    along, up, zero = np.cos(phi), np.sin(phi), np.zeros_like(phi)
    axis = np.stack([dx * along, dy * along, up], axis=-1)
    normal = np.stack([-dx * up, -dy * up, along], axis=-1)
    side = np.stack([zero - dy, zero + dx, zero], axis=-1)
    length = arms.link_length[..., None]
    step = length * axis
    step1 = length * rate[..., None] * normal
    step2 = length * (bend[..., None] * normal - (rate**2)[..., None] * axis)
    stations = arms.station_positions(q)
    # A stiff base lies before the first link, so that a link begins where it ends less its length.
    end = stations[:, 1:]
    velocity, acceleration = np.cumsum(step1, axis=1), np.cumsum(step2, axis=1)
    used = arms.used
    return Kinematics(
        position=(end - 0.5 * step)[used],
        axes=np.stack([axis, side, normal], axis=-1)[used],
        velocity=(velocity - 0.5 * step1)[used],
        # An angle that grows lifts the link: it turns about minus the arm's side.
        angular_velocity=(-rate[..., None] * side)[used],
        acceleration=(acceleration - 0.5 * step2)[used],
        angular_acceleration=(-bend[..., None] * side)[used],
        ends=np.stack([end - step, end], axis=2)[used],
    )


def _mean(stencils: Sequence[Stencil], n_nodes: int) -> sparse.csr_array:
    lengths = np.array([len(one.nodes) for one in stencils])
    weights = np.concatenate([one.weight / one.total for one in stencils])
    starts = np.concatenate([[0], np.cumsum(lengths)])
    nodes = np.concatenate([one.nodes for one in stencils])
    return sparse.csr_array((weights, nodes, starts), shape=(len(stencils), n_nodes))


def _cross(a: Derivatives, b: Derivatives) -> Derivatives:
    return (
        np.cross(a[0], b[0]),
        np.cross(a[1], b[0]) + np.cross(a[0], b[1]),
        np.cross(a[2], b[0]) + 2.0 * np.cross(a[1], b[1]) + np.cross(a[0], b[2]),
    )


def _unit(a: Derivatives) -> Derivatives:
    # From a = s u: a' = s' u + s u' and a'' = s'' u + 2 s' u' + s u'', where u . u' = 0.
    s = np.linalg.norm(a[0], axis=-1, keepdims=True)
    u = a[0] / s
    s1 = np.sum(u * a[1], axis=-1, keepdims=True)
    u1 = (a[1] - s1 * u) / s
    s2 = np.sum(u1 * a[1] + u * a[2], axis=-1, keepdims=True)
    return u, u1, (a[2] - s2 * u - 2.0 * s1 * u1) / s


_INSTANT = 1e-6  # s, between two looks at the rates of what is prescribed


class Kind(enum.Enum):
    """The kind of an entity; the value is also its first tag."""

    POINT = "point"
    NODE = "node"
    LINK = "link"


@dataclass(frozen=True)
class Entity:
    """One entity.

    Attributes:
        name: Unique name: of a point, `node_<layer>_<i>_<j>`, or `<arm>_link_<k>`.
        row: Its row in `Kinematics`.
        kind: Its kind.
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
        simulation: Their simulation.

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
            else [
                (arm, k + 1)
                for arm, count in zip(simulation.arm_names, arms.links, strict=True)
                for k in range(count)
            ]
        )
        self._means = PointAverages([point for *_, point in named], lattice.n_nodes)
        self._arms = arms
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
        """Return the motion of the simulation; on the thread that owns it. The result may go to other threads."""
        time, model = self._simulation.time, self._simulation.model
        # Not from the forces: in stiff directions these answer to errors of a position far below the accuracy.
        motion = self._simulation.last_step.at(time, model)
        before, after, place = motion.u.copy(), motion.u.copy(), motion.q.copy()
        model.prescribe(time - _INSTANT, place, before)
        model.prescribe(time + _INSTANT, place, after)
        a = (after - before) / (2.0 * _INSTANT)
        a[model.free] = motion.a
        return Instant(time, motion.q, motion.u, a)

    def kinematics(self, instant: Instant) -> Kinematics:
        """Return how all entities move at an instant."""
        simulation, flat = self._simulation, (instant.q, instant.u, instant.a)
        n = 3 * simulation.lattice.n_nodes
        q, u, a = (one[:n].reshape(-1, 3) for one in flat)
        sheet = self._means.kinematics((q, u, a))
        if self._arms is None:
            return sheet
        phi, rate, bend = (one[n:].reshape(self._arms.n_arms, -1) for one in flat)
        return sheet.concatenate(link_kinematics(self._arms, instant.q, (phi, rate, bend)))


def _nodes(lattice: Lattice) -> Iterable[tuple[Kind, str, Point]]:
    missing = set(lattice.missing.tolist())
    for layer in LAYERS:
        for i in range(lattice.nodes[0]):
            for j in range(lattice.nodes[1]):
                if lattice.node(layer, i, j) not in missing:
                    yield Kind.NODE, f"node_{layer}_{i}_{j}", point_at(lattice, [layer, i, j])


def _of_sheet(name: str, row: int, kind: Kind, point: Point, still: bool) -> Entity:
    layers = [LAYERS[layer] for layer in point.layers] if len(point.layers) == 1 else ["mid"]
    tags = (kind.value, "sheet", *layers, *(["clamped"] if still else []))
    if kind is Kind.NODE:
        return Entity(name, row, kind, f"point mass of the {layers[0]} layer, {point.where}", tags, still)
    return Entity(name, row, kind, f"point of the sheet, {layers[0]}, {point.where}", tags, still)


def _clamped(model: Model) -> set[int]:
    held = [term.constrained_dofs() // 3 for term in model.terms if term.name == "clamp"]
    return set(np.concatenate(held).tolist()) if held else set()
