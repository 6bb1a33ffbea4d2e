"""The Kalman filter of the default filter with its tangents by the parameters, compiled; nothing learns on the way."""

from __future__ import annotations

import numpy as np

from radiation_ss.filter.kernels import project, rk4
from radiation_ss.filter.marginal_loop import correct, noise_covariance, predict_covariance, transition
from radiation_ss.jit import jit


@jit
def tangent_loop(plant, force, q, H, r, learn, theta, z, P, Y, dts, steps, near,  # type: ignore[no-untyped-def]
                 information, gradient):
    """Run over samples Y (nt, 4 n) and add up Fisher information (d, d) and gradient (d,) of the log likelihood.

    Columns of theta and z are d neighbours, each at the distance `near` along one parameter, then the control twice.
    The innovations' variance is taken as independent of the parameters: its share of the gradient has mean zero.
    """
    pairs, inverse, stiffness, damping = plant
    n, size, columns = inverse.shape[0], z.shape[0], z.shape[1]
    d = columns - 2
    buffers, work = np.empty((2, size, columns)), np.empty((n, columns))
    F, FP, Q = np.empty((size, size)), np.empty((size, size)), np.empty((size, size))
    predicted, gain, slope = np.empty((1, columns)), np.empty(size), np.empty(d)
    dt_of_F = -1.0
    for t in range(Y.shape[0]):
        y = Y[t]
        dt = dts[t] / steps[t] if steps[t] else 0.0
        if steps[t] and dt != dt_of_F:
            transition(plant, force, theta, dt, F)
            noise_covariance(plant, force, theta, q, dt, Q)
            dt_of_F = dt
        for _ in range(steps[t]):
            rk4(pairs, inverse, stiffness, damping, size - 4 * n, force, theta, z, z, dt, buffers, work)
            predict_covariance(F, P, FP, Q)
        known = True
        for c in range(3 * n, 4 * n):
            known = known and np.isfinite(y[c])
        learning = learn == 2 or (learn == 1 and known)
        for c in range(4 * n):
            if not np.isfinite(y[c]):
                continue
            project(H, c, z, predicted, 0)
            s = correct(H, c, r[c], y[c], z, P, predicted, gain)
            if learning:
                innovation = y[c] - predicted[0, d]
                for k in range(d):
                    slope[k] = (predicted[0, k] - predicted[0, d]) / near
                for k in range(d):
                    gradient[k] += slope[k] * innovation / s
                    for m in range(d):
                        information[k, m] += slope[k] * slope[m] / s
        for i in range(size):
            for j in range(i):
                P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
