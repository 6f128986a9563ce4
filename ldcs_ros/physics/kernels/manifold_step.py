"""One step of the three-step formula on a quadratic manifold, and its projection, compiled."""

from __future__ import annotations

import math

import numpy as np

from ldcs_ros.physics import arm
from ldcs_ros.physics.compiled import compiled, compiled_fast
from ldcs_ros.physics.kernels.total_force import add_total_force

# A correction of the displacement of all nodes together that is taken at most [m].
LARGEST = 0.03
# BDF3: h q' = LEAD q - 3 q1 + 3/2 q2 - LAST q3, with the values before numbered backwards.
LEAD, LAST = 11.0 / 6.0, 1.0 / 3.0


@compiled_fast
def fill_projection(z, leading, fractions, metric, places, differences, components, out):  # type: ignore[no-untyped-def]
    """Fill `out`, shape (n,), with the sum of components that belongs to the coordinates z of a manifold.

    Their fractions are a quadratic function of the leading z, less distances to places times differences.

    Args:
        z: Coordinates, shape (r,).
        leading: How many of them the quadratic function depends on.
        fractions: Its coefficients: of 1, of z_i, of z_i z_j for i <= j, shape (n_features, k).
        metric: Factors on z that make its distances, shape (r,).
        places: Places in these units, shape (n_places, r).
        differences: Large numbers that cancel, shape (n_places, k).
        components: In single precision, the mean last, shape (k + 1, n).
        out: Result in single precision.
    """
    k = fractions.shape[1]
    row = fractions[0].copy()
    for i in range(leading):
        for c in range(k):
            row[c] += z[i] * fractions[1 + i, c]
    feature = 1 + leading
    for i in range(leading):
        for j in range(i, leading):
            product = z[i] * z[j]
            for c in range(k):
                row[c] += product * fractions[feature, c]
            feature += 1
    at = z * metric
    for p in range(places.shape[0]):
        square = 0.0
        for i in range(z.size):
            square += (places[p, i] - at[i]) ** 2
        distance = math.sqrt(square)
        for c in range(k):
            row[c] -= distance * differences[p, c]
    out[:] = components[k]
    for c in range(k):
        fraction, component = np.float32(row[c]), components[c]
        for i in range(out.size):
            out[i] += fraction * component[i]


@compiled
def manifold_step(  # type: ignore[no-untyped-def]
    tables,
    drive,
    constant,
    scratch,
    weights,
    mean,
    decoder,
    projection,
    scale,
    zs,
    qs,
    us,
    h,
    tolerance,
    most,
):
    """Advance by one step of BDF3 in the coordinates q of the sheet, solved for z of the manifold.

    The residual R = f(q, u) - M a of the full model vanishes in `projection`, P = V S^-1 with S the Jacobian of -R, so
    that stiff directions weigh no more than soft ones. Its Jacobian by z is near -1. Each step begins with -1 and
    learns by secants (Broyden); those of another step can be so wrong that an iteration seems to have converged.

    Args:
        tables, drive, constant, scratch: As of `add_total_force`.
        weights: Mass of each coordinate of a node [kg], shape (n_q,); 0 for angles and fixed ones.
        mean, decoder: Of the manifold.
        projection: P, shape (r, n_q); 0 for fixed coordinates.
        scale: Of the manifold, shape (r,).
        zs: The last three z, the newest first, shape (3, r); changed in place.
        qs, us: The last three coordinates and rates, the newest first, shape (3, n_q); changed in place.
        h: Step [s].
        tolerance: What the iteration may leave, in displacement of all nodes together [m].
        most: Iterations at most.

    Returns:
        Iterations, negative where they do not converge and nothing is changed; and the distance of the prediction, the
        parabola through the last three z, from the solution [m].
    """
    r, n = scale.size, mean.size
    nodes = scratch.shape[1]
    z = 3.0 * zs[0] - 3.0 * zs[1] + zs[2]
    guess = z.copy()
    features = np.empty(decoder.shape[0])
    q, u, residual, force = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    links = tables.arms.links.shape[1]
    inertia = np.empty((max((n - 3 * nodes) // max(links, 1), 0), links, links))
    step, before, value = np.zeros(r), np.zeros(r), np.zeros(r)
    secant = np.eye(r)
    iterations = 0
    converged = False
    while True:
        features[:r] = z
        k = r
        for i in range(r):
            for j in range(i, r):
                features[k] = z[i] * z[j]
                k += 1
        q[:] = np.dot(features, decoder)
        for i in range(n):
            q[i] += mean[i]
            u[i] = (LEAD * q[i] - 3.0 * qs[0, i] + 1.5 * qs[1, i] - LAST * qs[2, i]) / h
            residual[i] = (LEAD * u[i] - 3.0 * us[0, i] + 1.5 * us[1, i] - LAST * us[2, i]) / h
        if converged:
            break
        force[:] = constant
        add_total_force(tables, drive, q, u, scratch, force)
        if links > 0:
            phi = q[3 * nodes :].reshape(-1, links)
            arm.fill_inertia(phi, tables.arms.arms, tables.arms.links, inertia)
            for side in range(inertia.shape[0]):
                first = 3 * nodes + side * links
                for i in range(links):
                    for j in range(links):
                        force[first + i] -= inertia[side, i, j] * residual[first + j]
        for i in range(n):
            residual[i] = force[i] - weights[i] * residual[i]
        value[:] = np.dot(projection, residual) * scale
        iterations += 1
        size = 0.0
        for i in range(r):
            size = max(size, abs(value[i]))
        if not size < 1e3 or iterations > most:
            return -iterations, math.inf
        if iterations > 1:
            change = before - value
            correction = np.dot(secant, change)
            along = np.dot(step, correction)
            if abs(along) > 1e-3 * np.dot(step, step):
                left = np.dot(step, secant) / along
                for i in range(r):
                    for j in range(r):
                        secant[i, j] += (step[i] - correction[i]) * left[j]
        before[:] = value
        step[:] = np.dot(secant, value)
        size = 0.0
        for i in range(r):
            size = max(size, abs(step[i]))
        if size > LARGEST:
            step *= LARGEST / size
        z += step / scale
        converged = size < tolerance
    for i in range(r):
        zs[2, i], zs[1, i], zs[0, i] = zs[1, i], zs[0, i], z[i]
    for i in range(n):
        qs[2, i], qs[1, i], qs[0, i] = qs[1, i], qs[0, i], q[i]
        us[2, i], us[1, i], us[0, i] = us[1, i], us[0, i], u[i]
    unforeseen = 0.0
    for i in range(r):
        unforeseen += (scale[i] * (z[i] - guess[i])) ** 2
    return iterations, math.sqrt(unforeseen)
