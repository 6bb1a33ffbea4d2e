"""One Gaussian state, one predict, one smoothing step: the linear filter that the package shares.

`innovations` is the same filter compiled, one channel after the other; `filter` runs its steps in loops of its own.
"""

from typing import NamedTuple

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.jit import jit


class Gaussian(NamedTuple):
    """A normal state; several columns of means may share one covariance."""

    mean: FloatArray  # (size,) or (size, columns)
    cov: FloatArray   # (size, size)


def predict(state: Gaussian, F: FloatArray, Q: FloatArray) -> Gaussian:
    """Return the state after x = F x + noise of covariance Q."""
    return Gaussian(F @ state.mean, F @ state.cov @ F.T + Q)


def smooth(filtered: Gaussian, predicted: Gaussian, ahead: Gaussian, F: FloatArray) -> Gaussian:
    """Return the state given all samples, from that of the next sample (Rauch, Tung and Striebel 1965).

    `filtered`: given the samples up to this one. `predicted`, `ahead`: the next one's, given the samples up to this one
    and given all. `F` (size, size): transition from this one to the next.
    """
    # Scaled to a correlation; it can be singular to rounding where states have no noise of their own.
    d = np.sqrt(np.diag(predicted.cov))
    right = (F @ filtered.cov) / d[:, None]
    gain = (np.linalg.lstsq(predicted.cov / np.outer(d, d), right, rcond=1e-14)[0] / d[:, None]).T
    return Gaussian(filtered.mean + gain @ (ahead.mean - predicted.mean),
                    filtered.cov + gain @ (ahead.cov - predicted.cov) @ gain.T)


@jit(inner=True)
def correct(h, r, y, z, P, predicted, gain):  # type: ignore[no-untyped-def]
    """Move every column of z, and P, by one channel; return the innovation's variance.

    y is the sample, `predicted` (1, columns) what z has for it; gain (N,) becomes P h.
    """
    size, s = z.shape[0], r
    for i in range(size):
        gain[i] = 0.0
        for j in range(size):
            gain[i] += P[i, j] * h[j]
        s += h[i] * gain[i]
    for i in range(size):
        k = gain[i] / s
        for e in range(z.shape[1]):
            z[i, e] += k * (y - predicted[0, e])
        for j in range(size):
            P[i, j] -= k * gain[j]
    return s


@jit
def innovations(F: FloatArray, Q: FloatArray, H: FloatArray, R: FloatArray, P0: FloatArray,
                drive: FloatArray, y: FloatArray, settled_at: float) -> tuple[FloatArray, FloatArray]:
    """Return innovations e and their variances s, both (nt, p); a missing sample (NaN) has e = 0, s = 1.

    One channel after the other, so that any of them may be missing. After ten samples with all channels over which the
    variances change by less than `settled_at` (relative), the gains are frozen until a sample is missing. `F`, `Q`,
    `P0` (N, N): transition, noise covariance, covariance at the start about a mean of zero. `H` (p, N). `R` (p,):
    measurement variances. `drive` (nt, N): known input's share of the next state, x_{k+1} = F x_k + drive_k + noise.
    `y` (nt, p): less what the known input adds to the outputs directly.
    """
    (nt, p), N = y.shape, F.shape[0]
    e, s = np.zeros((nt, p)), np.ones((nt, p))
    x, ahead, P, FP, transposed = np.zeros((N, 1)), np.empty(N), P0.copy(), np.empty((N, N)), F.T.copy()
    gains, sizes, last, predicted = np.zeros((p, N)), np.zeros(p), np.zeros(p), np.empty((1, 1))
    settled = 0
    for k in range(nt):
        complete = True
        for i in range(p):
            complete = complete and not np.isnan(y[k, i])
        settled = settled if complete else 0
        frozen = settled >= 10
        for i in range(p):
            if np.isnan(y[k, i]):
                continue
            total = 0.0
            for j in range(N):
                total += H[i, j] * x[j, 0]
            predicted[0, 0], e[k, i] = total, y[k, i] - total
            if frozen:
                for j in range(N):
                    x[j, 0] += gains[i, j] / sizes[i] * e[k, i]
            else:
                sizes[i] = correct(H[i], R[i], y[k, i], x, P, predicted, gains[i])
            s[k, i] = sizes[i]
        for i in range(N):
            ahead[i] = drive[k, i]
            for j in range(N):
                ahead[i] += F[i, j] * x[j, 0]
        for i in range(N):
            x[i, 0] = ahead[i]
        if not frozen:
            np.dot(F, P, FP)
            np.dot(FP, transposed, P)
            for i in range(N):
                for j in range(i + 1):
                    P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i] + Q[i, j] + Q[j, i])
            if complete:
                change = 0.0
                for i in range(p):
                    change, last[i] = max(change, abs(sizes[i] - last[i]) / sizes[i]), sizes[i]
                settled = settled + 1 if change < settled_at else 0
    return e, s


def log_likelihood(e: FloatArray, s: FloatArray) -> float:
    """Return the log likelihood of innovations with variances s, up to the constant."""
    return -0.5 * float(np.sum(np.log(s) + e * e / s))
