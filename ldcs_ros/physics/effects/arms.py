"""Continuum arms of torque-driven links that lift and curve the sheet, and are bent by its weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from ldcs_ros.physics import arm
from ldcs_ros.physics.arm import ARM, COUPLING, LINK, ArmTables
from ldcs_ros.physics.compiled import records
from ldcs_ros.physics.curves import smoothstep
from ldcs_ros.physics.effects.base import Assembly, Effect, Term
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.physics.lattice import Lattice
from ldcs_ros.physics.placed_arms import PlacedArm, corners_in_use
from ldcs_ros.schema.fields import choice, quantity
from ldcs_ros.schema.units import ARM_NAMES

DRIVES = ("torque", "pressure", "curvature")
SHARED = ("drive", "arms")
"""Keys of the entry that hold for all of its arms and that no arm has of its own."""


@dataclass(frozen=True, kw_only=True)
class Arms(Effect):
    """Arms that bend in the plane of their line on the sheet and its normal (paper, section II, Figure 3).

    Without a list there are two: `left` along the edge y_max and `right` along y_min. Each is a chain of equal
    links with torsional springs and dampers at its joints. Joint stations are the base and the end of each link.
    Each station has a massless rib (key `crosspiece`) as long as the sheet is thick. Coupling springs join it to
    the sheet's bottom and top nodes, or to the bilinear point between them. Numbers without a source are not
    printed in the paper: identify them, do not trust them.

    Attributes:
        drive: Drive of the joints: torque, pressure (through a valve) or prescribed curvature.
        links: Links of each arm.
        link_mass: Mass of each link [kg].
        link_inertia: Moment of inertia of each link about its centre [kg m^2].
        joint_stiffness: Torsional stiffness of a joint of a whole link length [N m/rad].
        joint_damping: Damping of such a joint [N m s/rad].
        base_joint_share: Fraction of a link length that the base joint represents; it divides the joint's stiffness
            and damping. With 0.5 the joint stations of a uniformly bent arm lie on its arc.
        rigid_base: Length at an arm's base that does not bend, less than a link [m].
        backbone_height: Height of the chain of links above the sheet's mid-plane, inside the sheet [m].
        crosspiece: Direction of the ribs: perpendicular to the link that ends there, or to the
            bisector of the links that meet there.
        coupling_stiffness: Stiffness of each coupling spring [N/m].
        coupling_damping: Coefficient of each coupling damper [N s/m].
        width: Cells that an arm covers on each side of its line; those outside of the sheet do not count.
        torque_limit: Largest magnitude of a commanded joint torque [N m].
        pressure_gain: Joint torque for a gauge pressure [N m/Pa].
        pressure_limit: Largest commanded gauge pressure [Pa]; the smallest is 0.
        fill_time: Time constant of rising pressure [s].
        vent_time: Time constant of falling pressure [s].
        dead_time: Delay between a pressure command and the valve's answer [s].
        curvature: Final curvature of the drive 'curvature' [1/m].
        rise_time: Duration of its smooth rise [s].
        arms: The arms; each may have its own value of every parameter but the drive. Empty for left and right.
    """

    name: ClassVar[str] = "arms"
    drive: str = choice("torque", DRIVES, "drive of the joints", source="paper, section II: torques")
    links: int = quantity(4, "", "links of each arm", low=1, high=64, source="paper, section II")
    link_mass: float = quantity(
        0.005, "kg", "mass of each link", low=1e-9, high=1e3, source="not printed; light against the sheet"
    )
    link_inertia: float = quantity(
        5e-7,
        "kg m^2",
        "inertia of each link about its centre",
        low=0.0,
        high=1e3,
        source="not printed; uniform rod of 5 g and 35 mm, m l^2 / 12",
    )
    joint_stiffness: float = quantity(
        0.34,
        "N m/rad",
        "torsional stiffness a link length",
        low=0.0,
        high=1e6,
        source="not printed; lifts the loaded sheet by 0.05 m",
    )
    joint_damping: float = quantity(
        0.02,
        "N m s/rad",
        "torsional damping a link length",
        low=0.0,
        high=1e6,
        source="not printed; the surface's own c/k = 1/16 s",
    )
    base_joint_share: float = quantity(
        0.5,
        "",
        "fraction of a link length that the base joint represents",
        low=1e-3,
        high=1e3,
        source="geometry: joint angles (1/2, 1, 1, 1) theta lie on the arc",
    )
    crosspiece: str = choice(
        "link",
        ("link", "bisector"),
        "direction of the ribs: perpendicular to the link, or to the bisector of two",
        source="paper, section II: each main link",
    )
    coupling_stiffness: float = quantity(
        8000.0,
        "N/m",
        "stiffness of each coupling spring",
        low=0.0,
        high=1e10,
        source="not printed; 'stiffer than the surface's', here 100 times",
    )
    coupling_damping: float = quantity(
        500.0,
        "N s/m",
        "coefficient of each coupling damper",
        low=0.0,
        high=1e10,
        source="not printed; the surface's own c/k = 1/16 s",
    )
    rigid_base: float = quantity(
        0.0,
        "m",
        "length of the stiff fitting at an arm's base",
        low=0.0,
        high=10.0,
        source="not printed; as if an arm bent from the clamp on",
    )
    backbone_height: float = quantity(
        0.0,
        "m",
        "height above the mid-plane of the line that keeps its length",
        low=-1.0,
        high=1.0,
        source="paper, section II: central backbone; its rig has an inextensible layer, at a height not printed",
    )
    width: int = quantity(
        0, "", "cells an arm covers across the sheet", low=0, high=64, source="paper: border lines only"
    )
    torque_limit: float = quantity(2.0, "N m", "largest commanded joint torque", low=0.0, high=1e6)
    pressure_gain: float = quantity(
        1.0e-6,
        "N m/Pa",
        "joint torque for a gauge pressure",
        low=0.0,
        high=1.0,
        source="not printed; 0.14 N m at 1.4 bar",
    )
    pressure_limit: float = quantity(
        200e3,
        "Pa",
        "largest commanded gauge pressure",
        low=0.0,
        high=1e7,
        source="paper uses 140 kPa; margin of 1.4",
    )
    fill_time: float = quantity(0.15, "s", "time constant of rising pressure", low=0.0, high=1e3)
    vent_time: float = quantity(0.10, "s", "time constant of falling pressure", low=0.0, high=1e3)
    dead_time: float = quantity(0.0, "s", "delay of the valve's answer", low=0.0, high=10.0)
    curvature: float = quantity(
        8.695652173913043,
        "1/m",
        "final curvature of drive 'curvature'",
        low=-1e3,
        high=1e3,
        source="paper: r = 0.115 m",
    )
    rise_time: float = quantity(1.0, "s", "duration of its smooth rise", low=1e-6, high=1e6)

    arms: tuple[PlacedArm, ...] = field(
        default=(),
        metadata={
            "placed_arms": True,
            "help": "list of arms: name, from, to [m], and own parameters; left and right without it",
            "source": "paper, section II: two arms",
        },
    )

    def placed(self, lattice: Lattice) -> tuple[PlacedArm, ...]:
        """Return the arms of the list; without one, left and right along the edges of a lattice."""
        if self.arms:
            return self.arms
        length, side = lattice.size[0], 0.5 * lattice.size[1]
        return tuple(
            PlacedArm(name, (0.0, y), (length, y)) for name, y in zip(ARM_NAMES, (side, -side), strict=True)
        )

    def of(self, placed: PlacedArm) -> Arms:
        """Return the parameters of one arm."""
        return replace(self, arms=(), **placed.own)  # type: ignore[arg-type]  # checked by their declarations

    def bind(self, assembly: Assembly) -> Term:
        """Return the arms' term.

        Raises:
            ValueError: An arm leaves the sheet or crosses a hole, is wider than the sheet, its stiff base is as
                long as a link, or its backbone is outside the sheet.
        """
        return ArmsTerm(assembly, self)


class ArmsTerm(Term):
    """The chains and their couplings; coordinates are the absolute link angles, arm by arm.

    Attributes:
        arms: The effect.
        names: Name of each arm.
        each: Parameters of each arm.
        n_arms: Number of arms.
        n_links: Links of the longest chain; a shorter one ends in unused coordinates that stay 0.
        links: Number of links of each arm, shape (n_arms,).
        used: Whether a coordinate is one of a link, shape (n_arms, n_links).
    """

    name = Arms.name
    commanded = True
    corotational = True

    def __init__(self, assembly: Assembly, arms: Arms) -> None:
        lattice = assembly.lattice
        self.arms = arms
        placed = arms.placed(lattice)
        self.names = tuple(one.name for one in placed)
        self.each = tuple(arms.of(one) for one in placed)
        self.n_arms = len(placed)
        self.links = np.array([one.links for one in self.each])
        self.n_links = int(self.links.max())
        self.first = 3 * lattice.n_nodes
        for one, own in zip(placed, self.each, strict=True):
            _check_shape(one, own, lattice, listed=bool(arms.arms))
        self.tables = _tables(placed, self.each, assembly.gravity, lattice)
        self.link_length = self.tables.links["length"]
        self.prescribed = arms.drive == "curvature"
        self.breakpoints = (0.0, *(own.rise_time for own in self.each)) if self.prescribed else ()
        turned = [bool(np.any(self.tables.arms[name])) for name in ("direction_x", "direction_y")]
        self._axes = np.array([axis for axis in range(3) if axis == 2 or turned[axis]])
        self._gain = np.array([[own.pressure_gain] for own in self.each])
        self.used = np.arange(self.n_links) < self.links[:, None]
        self._has_unused = not self.used.all()

    def angles(self, flat: np.ndarray) -> np.ndarray:
        """Return the arms' part of a flat vector, shape (n_arms, n_links), as a view."""
        return flat[self.first :].reshape(self.n_arms, self.n_links)

    def constrained_dofs(self) -> np.ndarray:
        if self.prescribed:
            return self.first + np.arange(self.n_arms * self.n_links)
        return super().constrained_dofs()

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        if self.prescribed:
            for arm_index, own in enumerate(self.each):
                fraction, fraction_rate = smoothstep(time / own.rise_time)
                length = self.link_length[arm_index]
                bend = own.curvature * (np.cumsum(length) - 0.5 * length)
                self.angles(q)[arm_index] = fraction * bend
                self.angles(u)[arm_index] = fraction_rate / own.rise_time * bend

    def drive_torque(self, time: float, inputs: HeldCommands) -> np.ndarray:
        """Return the drive torque of each joint [N m], shape (n_arms, n_links); 0 for unused links."""
        return self.drive_torques([time], inputs)[0]

    def drive_torques(self, times: Sequence[float] | np.ndarray, inputs: HeldCommands) -> np.ndarray:
        """Return the drive torque of each joint at several times [N m], shape (n_times, n_arms, n_links)."""
        torque = np.zeros((len(times), *self.used.shape))
        if inputs.curve is not None:
            torque[:] = inputs.curve.at(np.asarray(times))
        elif self.arms.drive == "torque" and inputs.torque is not None:
            torque[:] = inputs.torque
        elif self.arms.drive == "pressure" and inputs.chambers:
            pressure = np.array([[chamber.at(time) for chamber in inputs.chambers] for time in times])
            torque[:] = self._gain * pressure[:, :, None]
        if self._has_unused:
            torque[:, ~self.used] = 0.0
        return torque

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """Return the mass matrix of each arm's link angles [kg m^2], shape (n_arms, n_links, n_links)."""
        matrix = np.empty((self.n_arms, self.n_links, self.n_links))
        arm.fill_inertia(self.angles(q), self.tables.arms, self.tables.links, matrix)
        return matrix

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        phi, rate, torque = self.angles(q), self.angles(u), self.angles(force)
        drive, tables = self.drive_torque(time, inputs), self.tables
        arm.add_chain_force(phi, rate, tables.arms, tables.links, drive, torque)
        arm.add_coupling_force(q, u, phi, rate, *tables, force, torque)

    def add_command_jump(
        self,
        time: float,
        q: np.ndarray,
        u: np.ndarray,
        before: HeldCommands,
        after: HeldCommands,
        force: np.ndarray,
    ) -> None:
        jump = self.drive_torque(time, after) - self.drive_torque(time, before)
        torque = self.angles(force)
        torque += jump
        torque[:, :-1] -= jump[:, 1:]

    def energy(self, time: float, q: np.ndarray) -> float:
        phi, (arms, links, ribs, couplings, nodes, weight) = self.angles(q), self.tables
        bend = np.diff(phi, axis=1, prepend=0.0)
        total = 0.5 * float(np.sum(np.where(self.used, links["stiffness"] * bend**2, 0.0)))
        outer = np.maximum(self.links[:, None] - np.arange(self.n_links) - 0.5, 0.0)
        lever = arms["mass"][:, None] * links["length"] * outer
        gravity_r, gravity_z = arms["gravity_r"][:, None], arms["gravity_z"][:, None]
        total -= float(np.sum(lever * (gravity_r * np.cos(phi) + gravity_z * np.sin(phi))))
        x, still = q[: self.first].reshape(-1, 3), np.zeros(self.n_links)
        place, speed, slope = np.empty(2), np.empty(2), np.empty((self.n_links, 2))
        for c, one in enumerate(couplings):
            k = one["arm"]
            chain = phi[k], still, arms[k], links[k], ribs[k]
            arm.rib_end(*chain, one["station"], one["offset"], place, speed, slope)
            held = self._in_base(k, place[0], one["lateral"], place[1])
            gap = weight[c] @ x[nodes[c]] - held
            total += 0.5 * float(one["stiffness"]) * float(gap @ gap)
        return total

    def _in_base(self, arm_index: int, along: float, across: float, height: float) -> np.ndarray:
        dx, dy = (self.tables.arms[arm_index][name] for name in ("direction_x", "direction_y"))
        return np.array([dx * along - dy * across, dy * along + dx * across, height])

    def station_positions(self, q: np.ndarray) -> np.ndarray:
        """Return the base and the end of each link in ldcs_base [m], shape (n_arms, n_links + 1, 3).

        They lie in the middle of the rows that an arm covers. The stations of unused links are those of the tip.
        """
        phi, couplings = self.angles(q), self.tables.couplings
        result = np.empty((self.n_arms, self.n_links + 1, 3))
        for k, one in enumerate(self.tables.arms):
            across = float(np.mean(np.unique(couplings["lateral"][couplings["arm"] == k])))
            steps = self.link_length[k, :, None] * np.stack([np.cos(phi[k]), np.sin(phi[k])], axis=-1)
            places = np.array([one["base_r"], one["base_z"]]) + np.cumsum(steps, axis=0)
            for station, (along, height) in enumerate([(one["start"], one["base_z"]), *places]):
                result[k, station] = self._in_base(k, along, across, height)
        return result

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        arm_of, node = self.tables.couplings["arm"], 3 * self.tables.nodes  # (n_couplings, n_corners)
        angle = self.first + np.arange(self.n_arms * self.n_links).reshape(self.n_arms, self.n_links)
        chain = np.broadcast_arrays(angle[:, :, None], angle[:, None, :])
        both = np.broadcast_arrays(
            node[:, :, None, None] + np.arange(3), node[:, None, :, None] + np.arange(3)
        )
        mixed = np.broadcast_arrays(
            node[:, :, None, None] + self._axes[:, None], angle[arm_of][:, None, None, :]
        )
        coupled = np.broadcast_arrays(angle[arm_of][:, :, None], angle[arm_of][:, None, :])
        pairs = [chain, both, mixed, mixed[::-1], coupled]
        rows = np.concatenate([np.ravel(pair[0]) for pair in pairs])
        columns = np.concatenate([np.ravel(pair[1]) for pair in pairs])
        return rows, columns

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        n, (count, corners) = self.n_links, self.tables.nodes.shape
        phi, rate = self.angles(q), self.angles(u)
        chain, chain_rate = np.zeros((self.n_arms, n, n)), np.zeros((self.n_arms, n, n))
        arms, links, *_ = self.tables
        arm.fill_chain_jacobian(phi, rate, arms, links, positive_definite, chain, chain_rate)
        mixed = (count, corners, len(self._axes), n)
        shapes = [(count, corners, corners, 3), mixed, mixed, (count, n, n)]
        blocks, rates = [np.empty(shape) for shape in shapes], [np.empty(shape) for shape in shapes]
        arm.fill_coupling_jacobian(
            q, u, phi, rate, *self.tables, self._axes, positive_definite, *blocks, *rates
        )
        by_position = np.concatenate([chain.ravel()] + [block.ravel() for block in blocks])
        by_rate = np.concatenate([chain_rate.ravel()] + [block.ravel() for block in rates])
        return by_position, by_rate


def _check_shape(placed: PlacedArm, own: Arms, lattice: Lattice, *, listed: bool) -> None:
    # Which arm it is matters only where there is a list.
    which = f"arm {placed.name!r}: " if listed else ""
    placed.check_ends(lattice, which)
    link, thickness = placed.length / own.links, lattice.size[2]
    if own.rigid_base >= link:
        raise ValueError(
            f"{which}rigid_base: got {own.rigid_base:g} m, expected less than a link, {link:g} m"
        )
    if abs(own.backbone_height) > 0.5 * thickness:
        raise ValueError(
            f"{which}backbone_height: got {own.backbone_height:g} m, expected a height inside the sheet, "
            f"{-0.5 * thickness:g} ... {0.5 * thickness:g} m"
        )
    if lattice.missing.size:
        placed.check_holes(lattice)
    cells, rows = max(lattice.nodes) - 1, lattice.nodes[1]
    most = cells if listed else rows - 1
    if own.width > most:
        raise ValueError(f"{which}width: got {own.width}, expected 0 ... {most}, the sheet has {rows} rows")


def _tables(
    placed: tuple[PlacedArm, ...], each: tuple[Arms, ...], gravity: np.ndarray, lattice: Lattice
) -> ArmTables:
    most = max(own.links for own in each)
    arms, links = np.zeros(len(each), dtype=ARM), np.zeros((len(each), most), dtype=LINK)
    ribs = np.zeros((len(each), most + 1, most))
    for k, (one, own) in enumerate(zip(placed, each, strict=True)):
        n, direction = own.links, one.direction
        links["length"][k, :n] = one.length / n
        links["length"][k, 0] -= own.rigid_base
        fraction = np.ones(n)
        fraction[0] = own.base_joint_share
        links["stiffness"][k, :n] = own.joint_stiffness / fraction
        links["damping"][k, :n] = own.joint_damping / fraction
        start = float(direction @ np.array(one.start))
        arms[k] = (
            n,
            own.link_mass,
            own.link_inertia,
            *direction,
            float(direction @ gravity[:2]),
            gravity[2],
            start,
            start + own.rigid_base,
            own.backbone_height,
        )
        ribs[k, : n + 1, :n] = arm.rib_weights(n, bisector=own.crosspiece == "bisector")
    couplings, nodes, weight = _couplings(placed, each, lattice)
    return ArmTables(records(arms), records(links), ribs, records(couplings), nodes, weight)


def _couplings(
    placed: tuple[PlacedArm, ...], each: tuple[Arms, ...], lattice: Lattice
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return one coupling for each arm, joint station, row under the arm and layer: `COUPLING`, nodes and weights."""
    rows, nodes, weight = [], [], []
    for k, (one, own) in enumerate(zip(placed, each, strict=True)):
        for station, corners, weights in one.covered(own.links, own.width, lattice):
            place = weights @ lattice.reference_position[corners]
            lateral = one.direction[0] * place[1] - one.direction[1] * place[0]
            offset = place[2] - own.backbone_height
            rows.append((k, station, offset, lateral, own.coupling_stiffness, own.coupling_damping))
            nodes.append(corners)
            weight.append(weights)
    kept = corners_in_use(np.array(weight))
    # Of one layout with the tables of no arms: another one would be compiled for.
    used_nodes = np.ascontiguousarray(np.array(nodes)[:, kept])
    return np.array(rows, dtype=COUPLING), used_nodes, np.ascontiguousarray(np.array(weight)[:, kept])
