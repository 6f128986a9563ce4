"""Kernels of the arms: chain dynamics in absolute link angles, joints, and the coupling of ribs to the sheet.

A chain has n links of equal mass and of lengths l_i in a plane y = const. phi_i is the angle of link i against
x, positive towards z. With p_0 the base and e(phi) = (cos phi, sin phi) in (x, z):

    p_s = p_0 + sum_{k<=s} l_k e(phi_k)                                joint station s, the end of link s
    M_ij = m l_i l_j w_ij cos(phi_i - phi_j) + I d_ij                  w_ij = n - max(i, j) + (1/4 if i = j else 1/2)
    sum_j M_ij phi_j'' = Q_i - sum_j m l_i l_j w_ij sin(phi_i - phi_j) phi_j'^2

These are the Lagrangian equations of a serial chain with uniform links, adapted from Giri and Walker's arm. Input
torques at the joints replace its muscles (paper, section II and Figure 3).
"""

from __future__ import annotations

import numpy as np

from ldcs_ros.physics.compiled import compiled


@compiled
def fill_inertia(phi, mass, inertia, length, matrix):  # type: ignore[no-untyped-def]
    """Write the mass matrix of each arm, shape (n_arms, n, n) [kg m^2]; length holds each link's, shape (n,) [m]."""
    n_arms, n = phi.shape
    for arm in range(n_arms):
        for i in range(n):
            for j in range(n):
                # w_ij of the module's formulas: the links beyond both joints, and a part of the link itself.
                weight = n - 1 - max(i, j) + (0.25 if i == j else 0.5)
                matrix[arm, i, j] = mass * length[i] * length[j] * weight * np.cos(phi[arm, i] - phi[arm, j])
            matrix[arm, i, i] += inertia


@compiled
def add_chain_force(phi, rate, mass, length, gravity, stiffness, damping, torque, force):  # type: ignore[no-untyped-def]
    """Add Coriolis forces, weight, joint springs, joint dampers and drive torques, shape (n_arms, n) [N m].

    stiffness and damping are those of each joint, shape (n,); torque acts between links, shape (n_arms, n).
    """
    n_arms, n = phi.shape
    for arm in range(n_arms):
        for i in range(n):
            sine, cosine = np.sin(phi[arm, i]), np.cos(phi[arm, i])
            # Link i carries its own half weight and that of the n - 1 - i links beyond it.
            force[arm, i] += mass * length[i] * (n - i - 0.5) * (gravity[2] * cosine - gravity[0] * sine)
            for j in range(n):
                if j != i:
                    weight = n - 1 - max(i, j) + 0.5
                    difference = phi[arm, i] - phi[arm, j]
                    lever = mass * length[i] * length[j] * weight
                    force[arm, i] -= lever * np.sin(difference) * rate[arm, j] ** 2
            # Joint i acts on link i and back on link i - 1; the base holds the first joint.
            bend, bend_rate = phi[arm, i], rate[arm, i]
            if i > 0:
                bend -= phi[arm, i - 1]
                bend_rate -= rate[arm, i - 1]
            moment = torque[arm, i] - stiffness[i] * bend - damping[i] * bend_rate
            force[arm, i] += moment
            if i > 0:
                force[arm, i - 1] -= moment


@compiled
def fill_chain_jacobian(  # type: ignore[no-untyped-def]
    phi, rate, mass, length, gravity, stiffness, damping, positive_definite, by_angle, by_rate
):
    """Add d(chain force)/d(phi) and /d(rate), shape (n_arms, n, n)."""
    n_arms, n = phi.shape
    for arm in range(n_arms):
        for i in range(n):
            sine, cosine = np.sin(phi[arm, i]), np.cos(phi[arm, i])
            if not positive_definite:
                # Weight and the Coriolis forces of the other links.
                slope = -mass * length[i] * (n - i - 0.5) * (gravity[2] * sine + gravity[0] * cosine)
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
def rib_end(phi, rate, base, length, station, rib_weight, offset, place, speed, slope):  # type: ignore[no-untyped-def]
    """Write place (x, z) [m], speed (x, z) [m/s] of a rib's end and slope = d(place)/d(phi), shape (n, 2).

    rib_weight holds the weight of each link angle in the rib's own angle, shape (n,). offset is the end's
    signed distance from the backbone [m]. base is the start of the first link (x, z) [m]. Joint station 0 stays
    above x = 0, the edge of the sheet. Returns the rib's angle [rad].
    """
    n = phi.size
    angle = 0.0
    for k in range(n):
        angle += rib_weight[k] * phi[k]
    # The rib's direction is (-sin, cos) of its angle; the links before the station carry its foot.
    place[0], place[1] = -offset * np.sin(angle), base[1] + offset * np.cos(angle)
    if station > 0:
        place[0] += base[0]
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
def _stations(phi, rate, base, length, rib_weight, place, speed, normal, normal_speed, along):  # type: ignore[no-untyped-def]
    # Backbone points and rib directions of one arm, in (x, z), with their rates; along = l (-sin, cos) a link.
    n = phi.size
    for k in range(n):
        along[k, 0], along[k, 1] = -length[k] * np.sin(phi[k]), length[k] * np.cos(phi[k])
    reach_x, reach_z, speed_x, speed_z = base[0], base[1], 0.0, 0.0
    for s in range(n + 1):
        if s > 0:
            # A link's end lies (l cos, l sin) beyond its start, and along holds (-l sin, l cos).
            reach_x += along[s - 1, 1]
            reach_z -= along[s - 1, 0]
            speed_x += along[s - 1, 0] * rate[s - 1]
            speed_z += along[s - 1, 1] * rate[s - 1]
        # Joint station 0 stays above x = 0, the edge of the sheet.
        place[s, 0], place[s, 1] = reach_x if s > 0 else 0.0, reach_z
        speed[s, 0], speed[s, 1] = speed_x, speed_z
        angle = spin = 0.0
        for k in range(n):
            angle += rib_weight[s, k] * phi[k]
            spin += rib_weight[s, k] * rate[k]
        normal[s, 0], normal[s, 1] = -np.sin(angle), np.cos(angle)
        normal_speed[s, 0], normal_speed[s, 1] = -spin * normal[s, 1], spin * normal[s, 0]


@compiled
def add_coupling_force(  # type: ignore[no-untyped-def]
    q,
    u,
    phi,
    rate,
    base,
    length,
    arm,
    station,
    offset,
    row_y,
    nodes,
    weight,
    rib_weight,
    stiffness,
    damping,
    force,
    torque,
):
    """Add the coupling springs' force on the sheet's nodes (flat `force`) and on the links (`torque`).

    Coupling c joins the end of a rib (arm, station, offset) to the point sum_m weight[c, m] x[nodes[c, m]].
    """
    n_arms, n = phi.shape
    place, speed = np.empty((n_arms, n + 1, 2)), np.empty((n_arms, n + 1, 2))
    normal, normal_speed = np.empty((n_arms, n + 1, 2)), np.empty((n_arms, n + 1, 2))
    along = np.empty((n_arms, n, 2))
    for k in range(n_arms):
        _stations(
            phi[k],
            rate[k],
            base,
            length,
            rib_weight,
            place[k],
            speed[k],
            normal[k],
            normal_speed[k],
            along[k],
        )
    # Each joint station takes up a force on the backbone and a moment on its rib.
    pull, moment = np.zeros((n_arms, n + 1, 2)), np.zeros((n_arms, n + 1))
    for c in range(arm.size):
        side, s = arm[c], station[c]
        nx, nz = normal[side, s, 0], normal[side, s, 1]
        # f = k (sheet's point - rib's end) + c (their relative velocity); the rib's end stays in its plane y.
        fx = -stiffness * (place[side, s, 0] + offset[c] * nx)
        fx -= damping * (speed[side, s, 0] + offset[c] * normal_speed[side, s, 0])
        fz = -stiffness * (place[side, s, 1] + offset[c] * nz)
        fz -= damping * (speed[side, s, 1] + offset[c] * normal_speed[side, s, 1])
        fy = -stiffness * row_y[c]
        for m in range(2):
            i = 3 * nodes[c, m]
            fx += weight[c, m] * (stiffness * q[i] + damping * u[i])
            fy += weight[c, m] * (stiffness * q[i + 1] + damping * u[i + 1])
            fz += weight[c, m] * (stiffness * q[i + 2] + damping * u[i + 2])
        for m in range(2):
            i = 3 * nodes[c, m]
            force[i] -= weight[c, m] * fx
            force[i + 1] -= weight[c, m] * fy
            force[i + 2] -= weight[c, m] * fz
        pull[side, s, 0] += fx
        pull[side, s, 1] += fz
        # The moment about -y, which turns angles towards z.
        moment[side, s] += offset[c] * (nx * fz - nz * fx)
    for side in range(n_arms):
        # From the tip to the base: link s - 1 moves all joint stations from s on.
        carried_x = carried_z = 0.0
        for s in range(n, -1, -1):
            for k in range(n):
                torque[side, k] += rib_weight[s, k] * moment[side, s]
            if s > 0:
                carried_x += pull[side, s, 0]
                carried_z += pull[side, s, 1]
                torque[side, s - 1] += along[side, s - 1, 0] * carried_x + along[side, s - 1, 1] * carried_z


@compiled
def fill_coupling_jacobian(  # type: ignore[no-untyped-def]
    q,
    u,
    phi,
    rate,
    base,
    length,
    arm,
    station,
    offset,
    row_y,
    nodes,
    weight,
    rib_weight,
    stiffness,
    damping,
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

    Shapes: node_node (n_couplings, 2, 2, 3), node_angle and angle_node (n_couplings, 2, 2, n) with the third
    axis x, z, and angle_angle (n_couplings, n, n).
    """
    n = phi.shape[1]
    place, speed, slope = np.empty(2), np.empty(2), np.empty((n, 2))
    speed_slope = np.zeros((n, 2))  # d(speed)/d(phi)
    for c in range(arm.size):
        side, s = arm[c], station[c]
        rib = rib_weight[s]
        angle = rib_end(phi[side], rate[side], base, length, s, rib, offset[c], place, speed, slope)
        f = np.empty(2)
        for axis in range(2):
            f[axis] = -stiffness * place[axis] - damping * speed[axis]
            for m in range(2):
                i = 3 * nodes[c, m] + 2 * axis
                f[axis] += weight[c, m] * (stiffness * q[i] + damping * u[i])
        angle_speed = 0.0
        for k in range(n):
            angle_speed += rib[k] * rate[side, k]
        # Second derivative of the rib's end by its own angle.
        curl_x, curl_z = offset[c] * np.sin(angle), -offset[c] * np.cos(angle)
        for k in range(n):
            speed_slope[k, 0] = rib[k] * angle_speed * curl_x
            speed_slope[k, 1] = rib[k] * angle_speed * curl_z
            if k < s:
                speed_slope[k, 0] -= length[k] * np.cos(phi[side, k]) * rate[side, k]
                speed_slope[k, 1] -= length[k] * np.sin(phi[side, k]) * rate[side, k]
            if positive_definite:
                speed_slope[k, 0] = speed_slope[k, 1] = 0.0
        for m in range(2):
            for p in range(2):
                for axis in range(3):
                    node_node[c, m, p, axis] = -weight[c, m] * weight[c, p] * stiffness
                    node_node_rate[c, m, p, axis] = -weight[c, m] * weight[c, p] * damping
            for axis in range(2):
                for k in range(n):
                    node_angle[c, m, axis, k] = weight[c, m] * (
                        stiffness * slope[k, axis] + damping * speed_slope[k, axis]
                    )
                    node_angle_rate[c, m, axis, k] = weight[c, m] * damping * slope[k, axis]
                    angle_node[c, m, axis, k] = weight[c, m] * stiffness * slope[k, axis]
                    angle_node_rate[c, m, axis, k] = weight[c, m] * damping * slope[k, axis]
        for k in range(n):
            for j in range(n):
                stiff = damp = 0.0
                for axis in range(2):
                    stiff -= slope[k, axis] * (stiffness * slope[j, axis] + damping * speed_slope[j, axis])
                    damp -= damping * slope[k, axis] * slope[j, axis]
                if not positive_definite:
                    stiff += rib[k] * rib[j] * (curl_x * f[0] + curl_z * f[1])
                    if k == j and k < s:
                        stiff -= length[k] * (np.cos(phi[side, k]) * f[0] + np.sin(phi[side, k]) * f[1])
                angle_angle[c, k, j] = stiff
                angle_angle_rate[c, k, j] = damp
