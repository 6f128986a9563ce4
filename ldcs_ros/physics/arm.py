"""Kernels of the arms: chain dynamics in absolute link angles, joints, and the coupling of ribs to the sheet.

A chain has n links of equal mass and of lengths l_i. It bends in the plane of its line on the flat sheet and the
sheet's normal, with the coordinates r = direction . (x, y) along the line and z. phi_i is the angle of link i against
the line, positive towards z. With p_0 the base and e(phi) = (cos phi, sin phi) in (r, z):

    p_s = p_0 + sum_{k<=s} l_k e(phi_k)                                joint station s, the end of link s
    M_ij = m l_i l_j w_ij cos(phi_i - phi_j) + I d_ij                  w_ij = n - max(i, j) + (1/4 if i = j else 1/2)
    sum_j M_ij phi_j'' = Q_i - sum_j m l_i l_j w_ij sin(phi_i - phi_j) phi_j'^2

These are the Lagrangian equations of a serial chain with uniform links, adapted from Giri and Walker's arm. Input
torques at the joints replace its muscles (paper, section II and Figure 3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ldcs_ros.physics.compiled import compiled


class ArmChains(NamedTuple):
    """The chains of all arms; where arms differ in links, the rows of a shorter one end in unused links.

    Attributes:
        links: Number of links of each arm, shape (n_arms,).
        mass: Mass of each link of an arm [kg], shape (n_arms,).
        inertia: Moment of inertia of each link of an arm about its centre [kg m^2], shape (n_arms,).
        length: Length of each link [m], shape (n_arms, n).
        stiffness: Stiffness of each joint [N m/rad], shape (n_arms, n).
        damping: Damping of each joint [N m s/rad], shape (n_arms, n).
        gravity: Acceleration of gravity along the arm's line and along z [m/s^2], shape (n_arms, 2).
        direction: Unit vector of the arm's line, base to tip, in x and y, shape (n_arms, 2).
        start: Coordinate r of joint station 0, where the arm begins on the sheet [m], shape (n_arms,).
        base: Coordinates r and z of the begin of the first link [m], shape (n_arms, 2).
        rib_weight: Weight of each link angle in the angle of each station's rib, shape (n_arms, n + 1, n).
    """

    links: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    length: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    gravity: np.ndarray
    direction: np.ndarray
    start: np.ndarray
    base: np.ndarray
    rib_weight: np.ndarray


class Couplings(NamedTuple):
    """Springs that join the ends of ribs to points sum_m weight[c, m] x[nodes[c, m]] of the sheet.

    Attributes:
        arm: Arm of each coupling, shape (n_couplings,).
        station: Its joint station, likewise.
        offset: Signed distance of the rib's end from the backbone [m], likewise.
        lateral: Coordinate across the arm's plane at which the end stays [m], likewise.
        stiffness: Stiffness [N/m], likewise.
        damping: Coefficient of the damper [N s/m], likewise.
        nodes: Nodes of the point of the sheet, shape (n_couplings, n_corners).
        weight: Their weights, same shape.
    """

    arm: np.ndarray
    station: np.ndarray
    offset: np.ndarray
    lateral: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    nodes: np.ndarray
    weight: np.ndarray


_NONE, _NO_NUMBERS = np.zeros(0, dtype=np.int64), np.zeros(0)
# Of the types of the others, so that a kernel takes a scene without arms, too.
NO_CHAINS = ArmChains(
    _NONE,
    _NO_NUMBERS,
    _NO_NUMBERS,
    np.zeros((0, 0)),
    np.zeros((0, 0)),
    np.zeros((0, 0)),
    np.zeros((0, 2)),
    np.zeros((0, 2)),
    _NO_NUMBERS,
    np.zeros((0, 2)),
    np.zeros((0, 1, 0)),
)
NO_COUPLINGS = Couplings(
    _NONE,
    _NONE,
    _NO_NUMBERS,
    _NO_NUMBERS,
    _NO_NUMBERS,
    _NO_NUMBERS,
    np.zeros((0, 2), dtype=np.int64),
    np.zeros((0, 2)),
)


@compiled
def fill_inertia(phi, chains, matrix):  # type: ignore[no-untyped-def]
    """Write the mass matrix of each arm, shape (n_arms, n, n) [kg m^2]; an unused link has the inertia 1."""
    n_arms, most = phi.shape
    for arm in range(n_arms):
        n, mass, length = chains.links[arm], chains.mass[arm], chains.length[arm]
        for i in range(most):
            for j in range(most):
                # w_ij of the module's formulas: the links beyond both joints, and a part of the link itself.
                if i < n and j < n:
                    weight = n - 1 - max(i, j) + (0.25 if i == j else 0.5)
                    lever = mass * length[i] * length[j] * weight
                    matrix[arm, i, j] = lever * np.cos(phi[arm, i] - phi[arm, j])
                else:
                    matrix[arm, i, j] = 1.0 if i == j else 0.0
            if i < n:
                matrix[arm, i, i] += chains.inertia[arm]


@compiled
def add_chain_force(phi, rate, chains, torque, force):  # type: ignore[no-untyped-def]
    """Add Coriolis forces, weight, joint springs, joint dampers and drive torques, shape (n_arms, n) [N m].

    torque acts between links, shape (n_arms, n).
    """
    for arm in range(phi.shape[0]):
        n, mass, length, gravity = chains.links[arm], chains.mass[arm], chains.length[arm], chains.gravity[arm]
        stiffness, damping = chains.stiffness[arm], chains.damping[arm]
        for i in range(n):
            # Link i carries its own half weight and that of the n - 1 - i links beyond it.
            sine, cosine = np.sin(phi[arm, i]), np.cos(phi[arm, i])
            force[arm, i] += mass * length[i] * (n - i - 0.5) * (gravity[1] * cosine - gravity[0] * sine)
            for j in range(n):
                if j != i:
                    weight = n - 1 - max(i, j) + 0.5
                    difference = phi[arm, i] - phi[arm, j]
                    lever = mass * length[i] * length[j] * weight
                    force[arm, i] -= lever * np.sin(difference) * rate[arm, j] ** 2
            bend, bend_rate = phi[arm, i], rate[arm, i]
            if i > 0:
                bend -= phi[arm, i - 1]
                bend_rate -= rate[arm, i - 1]
            # Joint i acts on link i and back on link i - 1; the base holds the first joint.
            moment = torque[arm, i] - stiffness[i] * bend - damping[i] * bend_rate
            force[arm, i] += moment
            if i > 0:
                force[arm, i - 1] -= moment


@compiled
def fill_chain_jacobian(phi, rate, chains, positive_definite, by_angle, by_rate):  # type: ignore[no-untyped-def]
    """Add d(chain force)/d(phi) and /d(rate), shape (n_arms, n, n)."""
    for arm in range(phi.shape[0]):
        n, mass, length, gravity = chains.links[arm], chains.mass[arm], chains.length[arm], chains.gravity[arm]
        stiffness, damping = chains.stiffness[arm], chains.damping[arm]
        for i in range(n):
            sine, cosine = np.sin(phi[arm, i]), np.cos(phi[arm, i])
            if not positive_definite:
                # Weight and the Coriolis forces of the other links.
                slope = -mass * length[i] * (n - i - 0.5) * (gravity[1] * sine + gravity[0] * cosine)
                by_angle[arm, i, i] += slope
                for j in range(n):
                    if j != i:
                        weight = mass * length[i] * length[j] * (n - 1 - max(i, j) + 0.5)
                        difference = phi[arm, i] - phi[arm, j]
                        by_angle[arm, i, i] -= weight * np.cos(difference) * rate[arm, j] ** 2
                        by_angle[arm, i, j] += weight * np.cos(difference) * rate[arm, j] ** 2
                        by_rate[arm, i, j] -= 2.0 * weight * np.sin(difference) * rate[arm, j]
            # A joint couples neighbouring links: the second difference of the angles.
            for matrix, value in ((by_angle, stiffness[i]), (by_rate, damping[i])):
                matrix[arm, i, i] -= value
                if i > 0:
                    matrix[arm, i - 1, i - 1] -= value
                    matrix[arm, i, i - 1] += value
                    matrix[arm, i - 1, i] += value


@compiled
def rib_end(phi, rate, chains, arm, station, offset, place, speed, slope):  # type: ignore[no-untyped-def]
    """Write place (r, z) [m], speed (r, z) [m/s] of a rib's end and slope = d(place)/d(phi), shape (n, 2).

    phi and rate are those of one arm, shape (n,); offset is the end's signed distance from the backbone [m].
    Returns the rib's angle [rad].
    """
    n, length, rib_weight = phi.size, chains.length[arm], chains.rib_weight[arm, station]
    # The rib's direction is (-sin, cos) of its angle; the links before the station carry its foot.
    angle = 0.0
    for k in range(n):
        angle += rib_weight[k] * phi[k]
    place[0] = (chains.base[arm, 0] if station > 0 else chains.start[arm]) - offset * np.sin(angle)
    place[1] = chains.base[arm, 1] + offset * np.cos(angle)
    speed[0], speed[1] = 0.0, 0.0
    for k in range(n):
        slope[k, 0] = -offset * rib_weight[k] * np.cos(angle)
        slope[k, 1] = -offset * rib_weight[k] * np.sin(angle)
        if k < station:
            place[0] += length[k] * np.cos(phi[k])
            place[1] += length[k] * np.sin(phi[k])
            slope[k, 0] -= length[k] * np.sin(phi[k])
            slope[k, 1] += length[k] * np.cos(phi[k])
        speed[0] += slope[k, 0] * rate[k]
        speed[1] += slope[k, 1] * rate[k]
    return angle


@compiled
def _stations(phi, rate, chains, arm, place, speed, normal, normal_speed, along):  # type: ignore[no-untyped-def]
    # Backbone points and rib directions of one arm, in (r, z), with their rates; along = l (-sin, cos) a link.
    n, length, rib_weight = phi.size, chains.length[arm], chains.rib_weight[arm]
    for k in range(n):
        along[k, 0], along[k, 1] = -length[k] * np.sin(phi[k]), length[k] * np.cos(phi[k])
    reach_r, reach_z, speed_r, speed_z = chains.base[arm, 0], chains.base[arm, 1], 0.0, 0.0
    for s in range(n + 1):
        if s > 0:
            # A link's end lies (l cos, l sin) beyond its start, and along holds (-l sin, l cos).
            reach_r += along[s - 1, 1]
            reach_z -= along[s - 1, 0]
            speed_r += along[s - 1, 0] * rate[s - 1]
            speed_z += along[s - 1, 1] * rate[s - 1]
        # Joint station 0 stays above the arm's begin on the sheet.
        place[s, 0], place[s, 1] = reach_r if s > 0 else chains.start[arm], reach_z
        speed[s, 0], speed[s, 1] = speed_r, speed_z
        angle = spin = 0.0
        for k in range(n):
            angle += rib_weight[s, k] * phi[k]
            spin += rib_weight[s, k] * rate[k]
        normal[s, 0], normal[s, 1] = -np.sin(angle), np.cos(angle)
        normal_speed[s, 0], normal_speed[s, 1] = -spin * normal[s, 1], spin * normal[s, 0]


@compiled
def add_coupling_force(q, u, phi, rate, chains, couplings, force, torque):  # type: ignore[no-untyped-def]
    """Add the coupling springs' force on the sheet's nodes (flat `force`) and on the links (`torque`)."""
    n_arms, n = phi.shape
    place, speed = np.empty((n_arms, n + 1, 2)), np.empty((n_arms, n + 1, 2))
    normal, normal_speed = np.empty((n_arms, n + 1, 2)), np.empty((n_arms, n + 1, 2))
    along = np.empty((n_arms, n, 2))
    for k in range(n_arms):
        _stations(phi[k], rate[k], chains, k, place[k], speed[k], normal[k], normal_speed[k], along[k])
    # Each joint station takes up a force on the backbone and a moment on its rib.
    pull, moment = np.zeros((n_arms, n + 1, 2)), np.zeros((n_arms, n + 1))
    nodes, weight = couplings.nodes, couplings.weight
    for c in range(couplings.arm.size):
        arm, s, offset = couplings.arm[c], couplings.station[c], couplings.offset[c]
        stiffness, damping = couplings.stiffness[c], couplings.damping[c]
        dx, dy = chains.direction[arm, 0], chains.direction[arm, 1]
        nr, nz = normal[arm, s, 0], normal[arm, s, 1]
        # f = k (sheet's point - rib's end) + c (their relative velocity), along the arm's line (r), across its plane
        # (t) and along z; the rib's end stays in its plane.
        fr = -stiffness * (place[arm, s, 0] + offset * nr)
        fr -= damping * (speed[arm, s, 0] + offset * normal_speed[arm, s, 0])
        fz = -stiffness * (place[arm, s, 1] + offset * nz)
        fz -= damping * (speed[arm, s, 1] + offset * normal_speed[arm, s, 1])
        ft = -stiffness * couplings.lateral[c]
        for m in range(nodes.shape[1]):
            i = 3 * nodes[c, m]
            r, r_rate = dx * q[i] + dy * q[i + 1], dx * u[i] + dy * u[i + 1]
            t, t_rate = dx * q[i + 1] - dy * q[i], dx * u[i + 1] - dy * u[i]
            fr += weight[c, m] * (stiffness * r + damping * r_rate)
            ft += weight[c, m] * (stiffness * t + damping * t_rate)
            fz += weight[c, m] * (stiffness * q[i + 2] + damping * u[i + 2])
        fx, fy = dx * fr - dy * ft, dy * fr + dx * ft
        for m in range(nodes.shape[1]):
            i = 3 * nodes[c, m]
            force[i] -= weight[c, m] * fx
            force[i + 1] -= weight[c, m] * fy
            force[i + 2] -= weight[c, m] * fz
        pull[arm, s, 0] += fr
        pull[arm, s, 1] += fz
        # The moment that turns angles towards z.
        moment[arm, s] += offset * (nr * fz - nz * fr)
    for arm in range(n_arms):
        # From the tip to the base: link s - 1 moves all joint stations from s on.
        carried_r = carried_z = 0.0
        for s in range(n, -1, -1):
            for k in range(n):
                torque[arm, k] += chains.rib_weight[arm, s, k] * moment[arm, s]
            if s > 0:
                carried_r += pull[arm, s, 0]
                carried_z += pull[arm, s, 1]
                torque[arm, s - 1] += along[arm, s - 1, 0] * carried_r + along[arm, s - 1, 1] * carried_z


@compiled
def fill_coupling_jacobian(  # type: ignore[no-untyped-def]
    q,
    u,
    phi,
    rate,
    chains,
    couplings,
    axes,
    positive_definite,
    node_node,
    node_angle,
    angle_node,
    angle_angle,
    node_node_rate,
    node_angle_rate,
    angle_node_rate,
    angle_angle_rate,
):
    """Write the couplings' Jacobian blocks by position (first four) and by rate (last four).

    axes are those of ldcs_base in which some arm bends. Shapes with m corners: node_node (n_couplings, m, m, 3),
    node_angle and angle_node (n_couplings, m, n_axes, n), angle_angle (n_couplings, n, n).
    """
    n = phi.shape[1]
    place, speed, slope = np.empty(2), np.empty(2), np.empty((n, 2))
    speed_slope = np.zeros((n, 2))  # d(speed)/d(phi)
    nodes, weight = couplings.nodes, couplings.weight
    corners = nodes.shape[1]
    f, component = np.empty(2), np.empty(3)
    for c in range(couplings.arm.size):
        arm, s, offset = couplings.arm[c], couplings.station[c], couplings.offset[c]
        stiffness, damping = couplings.stiffness[c], couplings.damping[c]
        length, rib = chains.length[arm], chains.rib_weight[arm, s]
        dx, dy = chains.direction[arm, 0], chains.direction[arm, 1]
        angle = rib_end(phi[arm], rate[arm], chains, arm, s, offset, place, speed, slope)
        for axis in range(2):
            f[axis] = -stiffness * place[axis] - damping * speed[axis]
        for m in range(corners):
            i = 3 * nodes[c, m]
            r, r_rate = dx * q[i] + dy * q[i + 1], dx * u[i] + dy * u[i + 1]
            f[0] += weight[c, m] * (stiffness * r + damping * r_rate)
            f[1] += weight[c, m] * (stiffness * q[i + 2] + damping * u[i + 2])
        angle_speed = 0.0
        for k in range(n):
            angle_speed += rib[k] * rate[arm, k]
        curl_r, curl_z = offset * np.sin(angle), -offset * np.cos(angle)
        for k in range(n):
            speed_slope[k, 0] = rib[k] * angle_speed * curl_r
            speed_slope[k, 1] = rib[k] * angle_speed * curl_z
            if k < s:
                speed_slope[k, 0] -= length[k] * np.cos(phi[arm, k]) * rate[arm, k]
                speed_slope[k, 1] -= length[k] * np.sin(phi[arm, k]) * rate[arm, k]
            if positive_definite:
                speed_slope[k, 0] = speed_slope[k, 1] = 0.0
        # The springs are alike in all directions, so that the nodes' own block is a diagonal in any axes.
        component[0], component[1], component[2] = dx, dy, 1.0
        for m in range(corners):
            for p in range(corners):
                for axis in range(3):
                    node_node[c, m, p, axis] = -weight[c, m] * weight[c, p] * stiffness
                    node_node_rate[c, m, p, axis] = -weight[c, m] * weight[c, p] * damping
            for place_of, axis in enumerate(axes):
                plane, part = (1 if axis == 2 else 0), weight[c, m] * component[axis]
                for k in range(n):
                    node_angle[c, m, place_of, k] = part * (
                        stiffness * slope[k, plane] + damping * speed_slope[k, plane]
                    )
                    node_angle_rate[c, m, place_of, k] = part * damping * slope[k, plane]
                    angle_node[c, m, place_of, k] = part * stiffness * slope[k, plane]
                    angle_node_rate[c, m, place_of, k] = part * damping * slope[k, plane]
        for k in range(n):
            for j in range(n):
                stiff = damp = 0.0
                for axis in range(2):
                    stiff -= slope[k, axis] * (stiffness * slope[j, axis] + damping * speed_slope[j, axis])
                    damp -= damping * slope[k, axis] * slope[j, axis]
                if not positive_definite:
                    # Second derivative of the rib's end by its own angle.
                    stiff += rib[k] * rib[j] * (curl_r * f[0] + curl_z * f[1])
                    if k == j and k < s:
                        stiff -= length[k] * (np.cos(phi[arm, k]) * f[0] + np.sin(phi[arm, k]) * f[1])
                angle_angle[c, k, j] = stiff
                angle_angle_rate[c, k, j] = damp
