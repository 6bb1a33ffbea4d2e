"""The live filter's step as a CasADi function: the Kalman filter at the parameters reached so far.

While every sample comes, its gain is the one that it settles to. After one that is missing the covariance moves along
until it has settled again: the settled gain would make a leap of what the motion has gone by unseen.
"""

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import system_matrices
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.bank import bank_of
from radiation_ss.filter.default import DefaultEngine
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.filter.plan import rows_of

NEAR = 0.1  # between the parameters and those of the filters beside, in standard deviations
SETTLED = 1e-6  # of the settled covariance


def filter_source(filter_: DualEnKF) -> tuple[list[ca.Function], dict[str, list[str]]]:
    """Return the filter's step, and the names of its channels.

    States are those of the filter, then those of the filters beside it, then how far the covariance is off the settled
    one: all zero they are a settled filter at rest.
    """
    engine = filter_.engine
    if not isinstance(engine, DefaultEngine):
        raise InputError("write_c: a default DualEnKF (preset=None) after prepare(record) or run(record) is needed")
    there = np.isfinite(filter_.sensor_noise.ravel())
    centre = engine.state.theta[:, -2]
    thetas = centre + NEAR * np.vstack([np.zeros(centre.size), deviations(filter_, engine.state.theta[:, :-2].T)])
    plants = [system_matrices(filter_.model.replace(fit=filter_.parts.fit(theta))) for theta in thetas]
    bank = bank_of(plants, filter_.force_model, filter_.sensor_noise, engine.state.P)
    (F, Q), H, r = bank.steps(filter_.interval), bank.H[:, there], bank.r[there]
    settled, (count, channels, size) = settled_covariance(F[0], Q, H[0], r), H.shape
    x, y = ca.MX.sym("x", size * (count + size)), ca.MX.sym("y", channels)
    z, off = ca.reshape(x[:size * count], size, count), ca.reshape(x[size * count:], size, size)
    ahead = ca.horzcat(*(ca.mtimes(ca.sparsify(ca.DM(own)), z[:, k]) for k, own in enumerate(F)))
    gate = engine.rules.gate
    usual, carried = settled_update(H, r, settled), carried_update(F[0], Q, H, r, settled, gate)
    S = H[0] @ (F[0] @ settled @ F[0].T + Q) @ H[0].T
    every = ca.mmin(taken(innovations(H, ahead, y), np.diag(S) + r, gate))
    still = ca.logic_and(every, ca.norm_inf(ca.vec(off)) == 0.0)
    after, off = ca.Function.if_else("update", usual, carried)(still, ahead, off, y)
    rows = slice(size - 2 * filter_.model.n, size, 2)
    force = after[rows, :]
    std = ca.sqrt(ca.fmax(np.diag(settled)[rows] + ca.diag(off)[rows], 0.0) + spread(force))
    step = ca.Function("filter_step", [x, y], [ca.vertcat(ca.vec(after), ca.vec(off)), force[:, 0], std], ["x", "y"],
                       ["after", "force", "std"])
    return [step], {"y": [name for name, have in zip(rows_of(filter_.model.dofs), there) if have],
                    "force": list(filter_.model.dofs), "a missing sample": ["NaN"]}


def settled_update(H: FloatArray, r: FloatArray, P: FloatArray) -> ca.Function:
    """Return (states ahead, covariance off the settled one, samples) -> the two after all samples, at the settled P."""
    z, off, y = ca.MX.sym("z", *H.shape[::-2]), ca.MX.sym("off", *P.shape), ca.MX.sym("y", r.size)
    gain = P @ H[0].T / r
    return ca.Function("settled", [z, off, y], [z + ca.mtimes(ca.DM(gain), innovations(H, z, y)), off])


def carried_update(F: FloatArray, Q: FloatArray, H: FloatArray, r: FloatArray, settled: FloatArray, gate: float,
                   ) -> ca.Function:
    """Return the same with a covariance of its own; of the samples, which are taken one by one, some may be missing."""
    z, off, y = ca.MX.sym("z", *H.shape[::-2]), ca.MX.sym("off", *settled.shape), ca.MX.sym("y", r.size)
    step, rows = ca.sparsify(ca.DM(F)), [ca.sparsify(ca.DM(row)) for row in H[0]]
    P = F @ settled @ F.T + Q + ca.mtimes(ca.mtimes(step, off), step.T)
    use = taken(innovations(H, z, y), ca.vertcat(*(ca.bilin(P, row, row) for row in rows)) + r, gate)
    after = z
    for c, (row, variance) in enumerate(zip(rows, r)):
        seen = ca.mtimes(P, row)
        gain = use[c] * seen / (ca.dot(row, seen) + variance)
        e = innovations(H[:, c:c + 1], after, y[c])
        after, P = after + ca.mtimes(gain, ca.if_else(use[c], e, 0.0)), P - ca.mtimes(gain, seen.T)
    left, size = 0.5 * (P + P.T) - settled, np.sqrt(np.maximum(np.diag(settled), 1e-300))
    far = ca.norm_inf(ca.vec(left / np.outer(size, size))) > SETTLED
    return ca.Function("carried", [z, off, y], [after, ca.if_else(far, left, 0.0)])


def innovations(H: FloatArray, z: ca.MX, y: ca.MX) -> ca.MX:
    """Return what samples differ from those of each filter, (channels, filters)."""
    return ca.vertcat(*(y[c] - ca.sum1(ca.sparsify(ca.DM(H[:, c].T)) * z) for c in range(H.shape[1])))


def spread(values: ca.MX) -> ca.MX:
    """Return the variance that the parameters' uncertainty gives a row of values, of the filter and those beside it."""
    return ca.sum2(((values[:, 1:] - ca.repmat(values[:, 0], 1, values.shape[1] - 1)) / NEAR) ** 2)


def taken(e: ca.MX, variance: ca.MX | ca.DM | FloatArray, gate: float) -> ca.MX:
    """Return which samples are within the gate; one that is NaN is not."""
    return ca.fabs(e[:, 0]) < gate * ca.sqrt(variance + spread(e))


def deviations(filter_: DualEnKF, members: FloatArray, least: float = 0.1) -> FloatArray:
    """Return the directions (k, n_theta) of the members (N, n_theta) along which K varies most, one deviation long.

    Each entry of K in units of the largest of its two motions; those below a share `least` of the first are left out.
    """
    fits = [filter_.parts.fit(theta) for theta in members]
    poles = np.abs(np.linalg.eigvals(fits[0].a))
    K = np.stack([fit.frequency_response(np.geomspace(0.3 * poles.min(), 3.0 * poles.max(), 24)) for fit in fits])
    size = np.sqrt(np.abs(np.einsum("mwii->mwi", K)).max(axis=(0, 1)))
    rows = ((K - K.mean(axis=0)) / np.outer(size, size)).reshape(len(fits), -1)
    u, share, _ = np.linalg.svd(np.hstack([rows.real, rows.imag]), full_matrices=False)
    return np.asarray(u[:, share > least * share[0]].T @ (members - members.mean(axis=0)) / np.sqrt(len(fits) - 1))


def settled_covariance(F: FloatArray, Q: FloatArray, H: FloatArray, r: FloatArray) -> FloatArray:
    """Return the covariance that a Kalman filter has after each sample in the end."""
    try:
        P = solve_discrete_are(F.T, H.T, Q, np.diag(r))
    except np.linalg.LinAlgError as error:
        raise SolverError(f"write_c: the filter's gain does not settle ({error})") from None
    S = H @ P @ H.T + np.diag(r)
    gain = np.linalg.solve(S, H @ P).T
    return np.asarray(P - gain @ S @ gain.T)
