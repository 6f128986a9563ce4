"""Two continuum arms of torque-driven links that lift the sheet's side edges, and are bent by its weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ldcs_ros.physics import arm
from ldcs_ros.physics.curves import smoothstep
from ldcs_ros.physics.effects.base import Assembly, Effect, Term
from ldcs_ros.physics.inputs import HeldCommands
from ldcs_ros.schema.fields import choice, quantity

ARM_NAMES = ("left", "right")
DRIVES = ("torque", "pressure", "curvature")


@dataclass(frozen=True, kw_only=True)
class Arms(Effect):
    """Two arms along the edges y_max (left) and y_min (right), moving in the XZ plane (paper, section II, Figure 3).

    Each is a chain of equal links with torsional springs and dampers at its joints. Joint stations are the base and
    the end of each link. Each station has a massless rib (key `crosspiece`) as long as the sheet is thick. Coupling
    springs join it to the sheet's bottom and top nodes, or to the point between two columns of nodes. Numbers
    without a source are not printed in the paper: identify them, do not trust them.

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
        width: Cells that an arm covers across the sheet: rows 0 ... width from its edge are coupled.
        torque_limit: Largest magnitude of a commanded joint torque [N m].
        pressure_gain: Joint torque for a gauge pressure [N m/Pa].
        pressure_limit: Largest commanded gauge pressure [Pa]; the smallest is 0.
        fill_time: Time constant of rising pressure [s].
        vent_time: Time constant of falling pressure [s].
        dead_time: Delay between a pressure command and the valve's answer [s].
        curvature: Final curvature of the drive 'curvature' [1/m].
        rise_time: Duration of its smooth rise [s].
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

    def bind(self, assembly: Assembly) -> Term:
        """Return the arms' term.

        Raises:
            ValueError: The arms are wider than the sheet, their stiff base is as long as a link, or their
                backbone is outside the sheet.
        """
        length, thickness = assembly.lattice.size[0] / self.links, assembly.lattice.size[2]
        if self.rigid_base >= length:
            raise ValueError(
                f"rigid_base: got {self.rigid_base:g} m, expected less than a link, {length:g} m"
            )
        if abs(self.backbone_height) > 0.5 * thickness:
            raise ValueError(
                f"backbone_height: got {self.backbone_height:g} m, expected a height inside the sheet, "
                f"{-0.5 * thickness:g} ... {0.5 * thickness:g} m"
            )
        rows = assembly.lattice.nodes[1]
        if self.width >= rows:
            raise ValueError(f"width: got {self.width}, expected 0 ... {rows - 1}, the sheet has {rows} rows")
        return ArmsTerm(assembly, self)


class ArmsTerm(Term):
    """The two chains and their couplings; coordinates are the absolute link angles, left arm first."""

    name = Arms.name
    commanded = True
    corotational = True

    def __init__(self, assembly: Assembly, arms: Arms) -> None:
        lattice = assembly.lattice
        self.arms = arms
        self.n_links = arms.links
        self.first = 3 * lattice.n_nodes
        self.link_length = np.full(arms.links, lattice.size[0] / arms.links)
        self.link_length[0] -= arms.rigid_base
        self.base = np.array([arms.rigid_base, arms.backbone_height])
        self.gravity = assembly.gravity
        fraction = np.ones(arms.links)
        fraction[0] = arms.base_joint_share
        self.stiffness, self.damping = arms.joint_stiffness / fraction, arms.joint_damping / fraction
        self.prescribed = arms.drive == "curvature"
        self.breakpoints = (0.0, arms.rise_time) if self.prescribed else ()
        self._build_couplings(assembly)
        self._still = np.zeros((2, arms.links))

    def _build_couplings(self, assembly: Assembly) -> None:
        # One coupling for each arm, station, row under the arm, and layer.
        lattice, links = assembly.lattice, self.n_links
        nx, ny = lattice.nodes
        arm_of, station, offset, row_y, nodes, weight = [], [], [], [], [], []
        for side, rows in enumerate(
            (range(ny - 1, ny - 2 - self.arms.width, -1), range(self.arms.width + 1))
        ):
            for s in range(links + 1):
                column, remainder = divmod(s * (nx - 1), links)
                fraction = remainder / links
                for j in rows:
                    for level, sign in ((0, -0.5), (1, 0.5)):
                        near, far = (
                            lattice.node(level, column, j),
                            lattice.node(level, min(column + 1, nx - 1), j),
                        )
                        arm_of.append(side)
                        station.append(s)
                        offset.append(sign * lattice.size[2] - self.arms.backbone_height)
                        row_y.append(lattice.reference_position[near, 1])
                        nodes.append((near, far))
                        weight.append((1.0 - fraction, fraction))
        rib_weight = np.zeros((links + 1, links))
        for s in range(1, links + 1):
            rib_weight[s, s - 1] = 1.0
            if self.arms.crosspiece == "bisector" and links > 1:
                before, after = (s - 1, s) if s < links else (s - 2, s - 1)
                rib_weight[s] = 0.0
                rib_weight[s, [before, after]] = (0.5, 0.5) if s < links else (-0.5, 1.5)
        self.couplings = (
            np.array(arm_of),
            np.array(station),
            np.array(offset),
            np.array(row_y),
            np.array(nodes),
            np.array(weight),
            rib_weight,
            self.arms.coupling_stiffness,
            self.arms.coupling_damping,
        )

    def angles(self, flat: np.ndarray) -> np.ndarray:
        """Return the arms' part of a flat vector, shape (2, n_links), as a view."""
        return flat[self.first :].reshape(2, self.n_links)

    def constrained_dofs(self) -> np.ndarray:
        return self.first + np.arange(2 * self.n_links) if self.prescribed else super().constrained_dofs()

    def prescribe(self, time: float, q: np.ndarray, u: np.ndarray) -> None:
        if self.prescribed:
            fraction, fraction_rate = smoothstep(time / self.arms.rise_time)
            bend = self.arms.curvature * (np.cumsum(self.link_length) - 0.5 * self.link_length)
            self.angles(q)[:] = fraction * bend
            self.angles(u)[:] = fraction_rate / self.arms.rise_time * bend

    def drive_torque(self, time: float, inputs: HeldCommands) -> np.ndarray:
        """Return the drive torque of each joint [N m], shape (2, n_links)."""
        if self.arms.drive == "torque" and inputs.torque is not None:
            return inputs.torque
        if self.arms.drive == "pressure" and inputs.chambers:
            pressure = np.array([[chamber.at(time)] for chamber in inputs.chambers])
            return np.repeat(self.arms.pressure_gain * pressure, self.n_links, axis=1)
        return self._still

    def inertia(self, q: np.ndarray) -> np.ndarray:
        """Return the mass matrix of each arm's link angles [kg m^2], shape (2, n_links, n_links)."""
        matrix = np.empty((2, self.n_links, self.n_links))
        arm.fill_inertia(
            self.angles(q), self.arms.link_mass, self.arms.link_inertia, self.link_length, matrix
        )
        return matrix

    def add_force(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, force: np.ndarray
    ) -> None:
        phi, rate, torque = self.angles(q), self.angles(u), self.angles(force)
        arm.add_chain_force(
            phi,
            rate,
            self.arms.link_mass,
            self.link_length,
            self.gravity,
            self.stiffness,
            self.damping,
            self.drive_torque(time, inputs),
            torque,
        )
        arm.add_coupling_force(q, u, phi, rate, self.base, self.link_length, *self.couplings, force, torque)

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
        phi = self.angles(q)
        n, length = self.n_links, self.link_length
        bend = np.diff(phi, axis=1, prepend=0.0)
        total = 0.5 * float(np.sum(self.stiffness * bend**2))
        reach = self.arms.link_mass * length * (n - np.arange(n) - 0.5)
        total -= float(np.sum(reach * (self.gravity[0] * np.cos(phi) + self.gravity[2] * np.sin(phi))))
        arm_of, station, offset, row_y, nodes, weight, rib_weight, stiffness, _ = self.couplings
        x = q[: self.first].reshape(-1, 3)
        place, speed, slope = np.empty(2), np.empty(2), np.empty((n, 2))
        for c in range(len(arm_of)):
            arm.rib_end(
                phi[arm_of[c]],
                np.zeros(n),
                self.base,
                length,
                station[c],
                rib_weight[station[c]],
                offset[c],
                place,
                speed,
                slope,
            )
            gap = weight[c] @ x[nodes[c]] - np.array([place[0], row_y[c], place[1]])
            total += 0.5 * stiffness * float(gap @ gap)
        return total

    def station_positions(self, q: np.ndarray) -> np.ndarray:
        """Return where the base and the end of each link are [m], shape (2, n_links + 1, 2), in x and z."""
        phi = self.angles(q)
        steps = self.link_length[:, None] * np.stack([np.cos(phi), np.sin(phi)], axis=-1)
        first = np.tile([0.0, self.base[1]], (2, 1, 1))
        return np.concatenate([first, self.base + np.cumsum(steps, axis=1)], axis=1)

    def jacobian_pattern(self) -> tuple[np.ndarray, np.ndarray]:
        n = self.n_links
        arm_of, _, _, _, nodes, *_ = self.couplings
        angle = self.first + np.arange(2 * n).reshape(2, n)
        chain = np.broadcast_arrays(angle[:, :, None], angle[:, None, :])
        node = 3 * nodes  # (n_couplings, 2)
        both = np.broadcast_arrays(
            node[:, :, None, None] + np.arange(3), node[:, None, :, None] + np.arange(3)
        )
        mixed = np.broadcast_arrays(
            node[:, :, None, None] + np.array([0, 2])[:, None], angle[arm_of][:, None, None, :]
        )
        coupled = np.broadcast_arrays(angle[arm_of][:, :, None], angle[arm_of][:, None, :])
        pairs = [chain, both, mixed, mixed[::-1], coupled]
        rows = np.concatenate([np.ravel(pair[0]) for pair in pairs])
        columns = np.concatenate([np.ravel(pair[1]) for pair in pairs])
        return rows, columns

    def jacobian(
        self, time: float, q: np.ndarray, u: np.ndarray, inputs: HeldCommands, positive_definite: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        n, count = self.n_links, len(self.couplings[0])
        phi, rate = self.angles(q), self.angles(u)
        chain, chain_rate = np.zeros((2, n, n)), np.zeros((2, n, n))
        arm.fill_chain_jacobian(
            phi,
            rate,
            self.arms.link_mass,
            self.link_length,
            self.gravity,
            self.stiffness,
            self.damping,
            positive_definite,
            chain,
            chain_rate,
        )
        shapes = [(count, 2, 2, 3), (count, 2, 2, n), (count, 2, 2, n), (count, n, n)]
        blocks, rates = [np.empty(shape) for shape in shapes], [np.empty(shape) for shape in shapes]
        arm.fill_coupling_jacobian(
            q, u, phi, rate, self.base, self.link_length, *self.couplings, positive_definite, *blocks, *rates
        )
        by_position = np.concatenate([chain.ravel()] + [block.ravel() for block in blocks])
        by_rate = np.concatenate([chain_rate.ravel()] + [block.ravel() for block in rates])
        return by_position, by_rate
