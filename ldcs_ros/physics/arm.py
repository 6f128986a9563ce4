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

# Tables with named columns: a call of a kernel takes one array of records in a tenth of the time of one array a column.
ARM = np.dtype(
    [
        ("links", np.int64),  # number of links
        ("mass", float),  # of each link [kg]
        ("inertia", float),  # of each link about its centre [kg m^2]
        ("direction_x", float),  # unit vector of the arm's line, base to tip
        ("direction_y", float),
        ("gravity_r", float),  # acceleration of gravity along the line and along z [m/s^2]
        ("gravity_z", float),
        ("start", float),  # r of joint station 0, the arm's begin on the sheet [m]
        ("base_r", float),  # r and z of the begin of the first link [m]
        ("base_z", float),
    ]
)
"""An arm; where arms differ in links, the rows of a shorter one end in unused links."""
LINK = np.dtype([("length", float), ("stiffness", float), ("damping", float)])
"""A link: length [m], stiffness [N m/rad] and damping [N m s/rad] of the joint at its begin."""
COUPLING = np.dtype(
    [
        ("arm", np.int64),
        ("station", np.int64),  # joint station
        ("offset", float),  # signed distance of the rib's end from the backbone [m]
        ("lateral", float),  # coordinate across the arm's plane at which the end stays [m]
        ("stiffness", float),  # [N/m]
        ("damping", float),  # [N s/m]
    ]
)
"""A spring that joins the end of a rib to the point sum_m weight[c, m] x[nodes[c, m]] of the sheet."""


class ArmTables(NamedTuple):
    """The tables of all arms.

    Attributes:
        arms: Rows of `ARM`, shape (n_arms,).
        links: Rows of `LINK`, shape (n_arms, n).
        ribs: Weight of each link angle in the angle of each station's rib, shape (n_arms, n + 1, n).
        couplings: Rows of `COUPLING`, shape (n_couplings,).
        nodes: Nodes of each coupling's point, shape (n_couplings, n_corners).
        weight: Their weights, same shape.
    """

    arms: np.ndarray
    links: np.ndarray
    ribs: np.ndarray
    couplings: np.ndarray
    nodes: np.ndarray
    weight: np.ndarray


# Of the types of the others, so that a kernel takes a scene without arms, too.
NO_ARMS = ArmTables(
    np.zeros(0, dtype=ARM),
    np.zeros((0, 0), dtype=LINK),
    np.zeros((0, 1, 0)),
    np.zeros(0, dtype=COUPLING),
    np.zeros((0, 2), dtype=np.int64),
    np.zeros((0, 2)),
)


def rib_weights(links: int, *, bisector: bool) -> np.ndarray:
    """Return the fraction of each link's angle in the direction of each station's rib, shape (links + 1, links).

    Args:
        links: Number of links.
        bisector: Ribs are perpendicular to the bisector of the links that meet there, not to the link that ends there.
    """
    weight = np.zeros((links + 1, links))
    for s in range(1, links + 1):
        weight[s, s - 1] = 1.0
        if bisector and links > 1:
            before, after = (s - 1, s) if s < links else (s - 2, s - 1)
            weight[s] = 0.0
            weight[s, [before, after]] = (0.5, 0.5) if s < links else (-0.5, 1.5)
    return weight


@compiled
def fill_inertia(phi, arms, links, matrix):  # type: ignore[no-untyped-def]
    """Write the mass matrix of each arm, shape (n_arms, n, n) [kg m^2]; an unused link has the inertia 1."""
    n_arms, most = phi.shape
    for arm in range(n_arms):
        n, mass, link = arms[arm].links, arms[arm].mass, links[arm]
        for i in range(most):
            for j in range(most):
                # w_ij of the module's formulas: the links beyond both joints, and a part of the link itself.
                if i < n and j < n:
                    weight = n - 1 - max(i, j) + (0.25 if i == j else 0.5)
                    lever = mass * link[i].length * link[j].length * weight
                    matrix[arm, i, j] = lever * np.cos(phi[arm, i] - phi[arm, j])
                else:
                    matrix[arm, i, j] = 1.0 if i == j else 0.0
            if i < n:
                matrix[arm, i, i] += arms[arm].inertia


@compiled
def add_chain_force(phi, rate, arms, links, torque, force):  # type: ignore[no-untyped-def]
    """Add Coriolis forces, weight, joint springs, joint dampers and drive torques, shape (n_arms, n) [N m].

    torque acts between links, shape (n_arms, n).
    """
    for arm in range(phi.shape[0]):
        n, mass, link = arms[arm].links, arms[arm].mass, links[arm]
        gravity_r, gravity_z = arms[arm].gravity_r, arms[arm].gravity_z
        for i in range(n):
            # Link i carries its own half weight and that of the n - 1 - i links beyond it.
            sine, cosine = np.sin(phi[arm, i]), np.cos(phi[arm, i])
            force[arm, i] += mass * link[i].length * (n - i - 0.5) * (gravity_z * cosine - gravity_r * sine)
            for j in range(n):
                if j != i:
                    weight = n - 1 - max(i, j) + 0.5
                    difference = phi[arm, i] - phi[arm, j]
                    lever = mass * link[i].length * link[j].length * weight
                    force[arm, i] -= lever * np.sin(difference) * rate[arm, j] ** 2
            bend, bend_rate = phi[arm, i], rate[arm, i]
            if i > 0:
                bend -= phi[arm, i - 1]
                bend_rate -= rate[arm, i - 1]
            # Joint i acts on link i and back on link i - 1; the base holds the first joint.
            moment = torque[arm, i] - link[i].stiffness * bend - link[i].damping * bend_rate
            force[arm, i] += moment
            if i > 0:
                force[arm, i - 1] -= moment


@compiled
def fill_chain_jacobian(phi, rate, arms, links, positive_definite, by_angle, by_rate):  # type: ignore[no-untyped-def]
    """Add d(chain force)/d(phi) and /d(rate), shape (n_arms, n, n)."""
    for arm in range(phi.shape[0]):
        n, mass, link = arms[arm].links, arms[arm].mass, links[arm]
        gravity_r, gravity_z = arms[arm].gravity_r, arms[arm].gravity_z
        for i in range(n):
            sine, cosine = np.sin(phi[arm, i]), np.cos(phi[arm, i])
            if not positive_definite:
                # Weight and the Coriolis forces of the other links.
                slope = -mass * link[i].length * (n - i - 0.5) * (gravity_z * sine + gravity_r * cosine)
                by_angle[arm, i, i] += slope
                for j in range(n):
                    if j != i:
                        weight = mass * link[i].length * link[j].length * (n - 1 - max(i, j) + 0.5)
                        difference = phi[arm, i] - phi[arm, j]
                        by_angle[arm, i, i] -= weight * np.cos(difference) * rate[arm, j] ** 2
                        by_angle[arm, i, j] += weight * np.cos(difference) * rate[arm, j] ** 2
                        by_rate[arm, i, j] -= 2.0 * weight * np.sin(difference) * rate[arm, j]
            # A joint couples neighbouring links: the second difference of the angles.
            for matrix, value in ((by_angle, link[i].stiffness), (by_rate, link[i].damping)):
                matrix[arm, i, i] -= value
                if i > 0:
                    matrix[arm, i - 1, i - 1] -= value
                    matrix[arm, i, i - 1] += value
                    matrix[arm, i - 1, i] += value


@compiled
def rib_end(phi, rate, arm, links, ribs, station, offset, place, speed, slope):  # type: ignore[no-untyped-def]
    """Write place (r, z) [m], speed (r, z) [m/s] of a rib's end and slope = d(place)/d(phi), shape (n, 2).

    phi, rate, arm, links and ribs are those of one arm; offset is the end's signed distance from the backbone [m].
    Returns the rib's angle [rad].
    """
    n, rib_weight = phi.size, ribs[station]
    # The rib's direction is (-sin, cos) of its angle; the links before the station carry its foot.
    angle = 0.0
    for k in range(n):
        angle += rib_weight[k] * phi[k]
    place[0] = (arm.base_r if station > 0 else arm.start) - offset * np.sin(angle)
    place[1] = arm.base_z + offset * np.cos(angle)
    speed[0], speed[1] = 0.0, 0.0
    for k in range(n):
        slope[k, 0] = -offset * rib_weight[k] * np.cos(angle)
        slope[k, 1] = -offset * rib_weight[k] * np.sin(angle)
        if k < station:
            place[0] += links[k].length * np.cos(phi[k])
            place[1] += links[k].length * np.sin(phi[k])
            slope[k, 0] -= links[k].length * np.sin(phi[k])
            slope[k, 1] += links[k].length * np.cos(phi[k])
        speed[0] += slope[k, 0] * rate[k]
        speed[1] += slope[k, 1] * rate[k]
    return angle


@compiled
def _stations(phi, rate, arm, links, ribs, place, speed, normal, normal_speed, along):  # type: ignore[no-untyped-def]
    # Backbone points and rib directions of one arm, in (r, z), with their rates; along = l (-sin, cos) a link.
    n = phi.size
    for k in range(n):
        along[k, 0], along[k, 1] = -links[k].length * np.sin(phi[k]), links[k].length * np.cos(phi[k])
    reach_r, reach_z, speed_r, speed_z = arm.base_r, arm.base_z, 0.0, 0.0
    for s in range(n + 1):
        if s > 0:
            # A link's end lies (l cos, l sin) beyond its start, and along holds (-l sin, l cos).
            reach_r += along[s - 1, 1]
            reach_z -= along[s - 1, 0]
            speed_r += along[s - 1, 0] * rate[s - 1]
            speed_z += along[s - 1, 1] * rate[s - 1]
        # Joint station 0 stays above the arm's begin on the sheet.
        place[s, 0], place[s, 1] = reach_r if s > 0 else arm.start, reach_z
        speed[s, 0], speed[s, 1] = speed_r, speed_z
        angle = spin = 0.0
        for k in range(n):
            angle += ribs[s, k] * phi[k]
            spin += ribs[s, k] * rate[k]
        normal[s, 0], normal[s, 1] = -np.sin(angle), np.cos(angle)
        normal_speed[s, 0], normal_speed[s, 1] = -spin * normal[s, 1], spin * normal[s, 0]


@compiled
def add_coupling_force(q, u, phi, rate, arms, links, ribs, couplings, nodes, weight, force, torque):  # type: ignore[no-untyped-def]
    """Add the coupling springs' force on the sheet's nodes (flat `force`) and on the links (`torque`)."""
    n_arms, n = phi.shape
    place, speed = np.empty((n_arms, n + 1, 2)), np.empty((n_arms, n + 1, 2))
    normal, normal_speed = np.empty((n_arms, n + 1, 2)), np.empty((n_arms, n + 1, 2))
    along = np.empty((n_arms, n, 2))
    for k in range(n_arms):
        _stations(
            phi[k],
            rate[k],
            arms[k],
            links[k],
            ribs[k],
            place[k],
            speed[k],
            normal[k],
            normal_speed[k],
            along[k],
        )
    # Each joint station takes up a force on the backbone and a moment on its rib.
    pull, moment = np.zeros((n_arms, n + 1, 2)), np.zeros((n_arms, n + 1))
    for c in range(couplings.size):
        arm, s, offset = couplings[c].arm, couplings[c].station, couplings[c].offset
        stiffness, damping = couplings[c].stiffness, couplings[c].damping
        dx, dy = arms[arm].direction_x, arms[arm].direction_y
        nr, nz = normal[arm, s, 0], normal[arm, s, 1]
        # f = k (sheet's point - rib's end) + c (their relative velocity); the rib's end stays in its plane.
        r, t = place[arm, s, 0] + offset * nr, couplings[c].lateral
        r_rate = speed[arm, s, 0] + offset * normal_speed[arm, s, 0]
        fx = -stiffness * (dx * r - dy * t)
        fx -= damping * (dx * r_rate)
        fy = -stiffness * (dy * r + dx * t)
        fy -= damping * (dy * r_rate)
        fz = -stiffness * (place[arm, s, 1] + offset * nz)
        fz -= damping * (speed[arm, s, 1] + offset * normal_speed[arm, s, 1])
        for m in range(nodes.shape[1]):
            i = 3 * nodes[c, m]
            fx += weight[c, m] * (stiffness * q[i] + damping * u[i])
            fy += weight[c, m] * (stiffness * q[i + 1] + damping * u[i + 1])
            fz += weight[c, m] * (stiffness * q[i + 2] + damping * u[i + 2])
        fr = dx * fx + dy * fy
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
                torque[arm, k] += ribs[arm, s, k] * moment[arm, s]
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
    arms,
    links,
    ribs,
    couplings,
    nodes,
    weight,
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
    corners = nodes.shape[1]
    f, component = np.empty(2), np.empty(3)
    for c in range(couplings.size):
        arm, s, offset = couplings[c].arm, couplings[c].station, couplings[c].offset
        stiffness, damping = couplings[c].stiffness, couplings[c].damping
        link, rib = links[arm], ribs[arm, s]
        dx, dy = arms[arm].direction_x, arms[arm].direction_y
        angle = rib_end(phi[arm], rate[arm], arms[arm], link, ribs[arm], s, offset, place, speed, slope)
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
                speed_slope[k, 0] -= link[k].length * np.cos(phi[arm, k]) * rate[arm, k]
                speed_slope[k, 1] -= link[k].length * np.sin(phi[arm, k]) * rate[arm, k]
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
                        stiff -= link[k].length * (np.cos(phi[arm, k]) * f[0] + np.sin(phi[arm, k]) * f[1])
                angle_angle[c, k, j] = stiff
                angle_angle_rate[c, k, j] = damp
