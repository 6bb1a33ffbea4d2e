"""Other estimators on the records of `identify.py` whose force is known: the same truths, the same wrong model.

OMP_NUM_THREADS=1 python benchmarks/identify_others.py [--seeds 8] [--write]

Least squares: SciPy's least_squares over the subsystem's coefficients, simulated by lsim. N4SID: the basic projection
algorithm of Van Overschee & De Moor (1996), order 5, K out of the transfer function. EKF, UKF: state and coefficients
as one state, coefficients with the prior of `identify`.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from scipy.linalg import expm, hankel
from scipy.optimize import least_squares
from scipy.signal import lsim

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import identify as own
import identify_truth as truth
from validation import publish, table

import radiation_ss as rss
from radiation_ss.inference.prior import parametrise

LABELS = [label for label in own.OWN if label.startswith("force known") and "elevation" not in label]


def composite(model, form, theta):
    """Return (F, G) of the body with the subsystem of theta."""
    return model.replace(fit=form.realise(theta)).matrices()


def by_least_squares(model, form, record, omega):
    """Return K and the standard deviations of its real and imaginary part."""
    y, f = record.channels["Heave"], record.channels["Heave_force"]

    def motion(u):
        F, G = composite(model, form, form.theta(u))
        free = np.stack([lsim((F, G, np.eye(5)[3:4], [[0.0]]), 0.0 * f, record.time, X0=x)[1] for x in np.eye(5)], 1)
        forced = lsim((F, G, np.eye(5)[3:4], [[0.0]]), f, record.time)[1]
        return forced + free @ np.linalg.lstsq(free, y - forced, rcond=None)[0]         # the start is free

    found = least_squares(lambda u: (motion(u) - y) / y.std(), np.zeros(form.size), bounds=(-5.0, 5.0))
    noise = np.sum(found.fun**2) / (y.size - 11)
    return spread(form, found.x, noise * np.linalg.pinv(found.jac.T @ found.jac), omega)


def spread(form, u, covariance, omega):
    """Return K at u and the standard deviations of its parts, to first order."""
    K = form.K(form.theta(u), omega)[:, 0, 0]
    J = np.array([(form.K(form.theta(u + 1e-5 * e), omega)[:, 0, 0] - K) / 1e-5 for e in np.eye(u.size)])
    return K, *(np.sqrt(np.maximum(np.einsum("iw,ij,jw->w", part, covariance, part), 0.0)) for part in (J.real, J.imag))


def by_subspace(model, form, record, omega, rows=20, order=5):
    """Return K of the basic N4SID; no bands."""
    y, f = record.channels["Heave"], record.channels["Heave_force"]
    u, v = f / f.std(), y / y.std()
    U, Y = (hankel(x[:2 * rows], x[2 * rows - 1:]) for x in (u, v))
    past = np.vstack([U[:rows], Y[:rows]])
    data = np.vstack([past, U[rows:]])
    part = np.linalg.lstsq(data.T, Y[rows:].T, rcond=None)[0].T[:, :2 * rows] @ past         # oblique projection
    left, size, _ = np.linalg.svd(part, full_matrices=False)
    observed = left[:, :order] * np.sqrt(size[:order])
    states = np.linalg.lstsq(observed, part, rcond=None)[0]
    now = np.vstack([states[:, :-1], U[rows:rows + 1, :-1]])
    after = np.vstack([states[:, 1:], Y[rows:rows + 1, :-1]])
    S = np.linalg.lstsq(now.T, after.T, rcond=None)[0].T
    A, B, C, D = S[:order, :order], S[:order, order:], S[order:, :order], S[order:, order:]
    z = np.exp(1j * omega * (record.time[1] - record.time[0]))
    H = np.array([(C @ np.linalg.solve(x * np.eye(order) - A, B) + D)[0, 0] for x in z]) * y.std() / f.std()
    K = (1.0 / H + omega**2 * (model.M + model.A_inf)[0, 0] - model.C[0, 0]) / (1j * omega)
    return K, None, None


def by_kalman(model, form, record, omega, unscented):
    """Return K and its standard deviations by a Kalman filter over state and coefficients."""
    y, f = record.channels["Heave"], record.channels["Heave_force"]
    dt, n, m = record.time[1] - record.time[0], 5, form.size
    scale = np.r_[np.full(3, np.abs(f).max() * 0.05), y.std(), y.std() * 7.0]
    x, P = np.zeros(n + m), np.diag(np.r_[4.0 * scale**2, np.ones(m)])
    Q, R = np.diag(np.r_[(1e-3 * scale) ** 2, np.full(m, 1e-8)]), (0.01 * y.std()) ** 2

    def ahead(rows, force):
        systems = [composite(model, form, form.theta(row)) for row in rows[:, n:]]
        blocks = np.zeros((len(rows), n + 1, n + 1))
        for block, (F, G) in zip(blocks, systems):
            block[:n, :n], block[:n, n:] = F, G
        step = expm(blocks * dt)
        new = np.einsum("kij,kj->ki", step[:, :n, :n], rows[:, :n]) + step[:, :n, n] * force
        return np.hstack([new, rows[:, n:]])

    for k in range(y.size):
        gain = P[:, 3] / (P[3, 3] + R)
        x, P = x + gain * (y[k] - x[3]), P - np.outer(gain, P[3])
        force = 0.5 * (f[k] + f[min(k + 1, y.size - 1)])
        if unscented:
            root = np.linalg.cholesky((n + m) * (0.5 * (P + P.T) + 1e-14 * np.diag(np.diag(P)))).T
            points = ahead(np.vstack([x + root, x - root]), force)
            x = points.mean(axis=0)
            P = (points - x).T @ (points - x) / (2 * (n + m)) + Q
        else:
            steps = np.r_[1e-4 * scale, np.full(m, 1e-4)]
            points = ahead(np.vstack([x, x + np.diag(steps)]), force)
            J = ((points[1:] - points[0]) / steps[:, None]).T
            x, P = points[0], J @ P @ J.T + Q
    return spread(form, x[n:], P[n:, n:], omega)


METHODS = {"least squares": by_least_squares, "N4SID": by_subspace,
           "EKF": lambda *given: by_kalman(*given, unscented=False),
           "UKF": lambda *given: by_kalman(*given, unscented=True), "identify": None}


def judged(label, method, seed, base):
    """Return errors of K after and before, coverage of the bands and CPU time on one record; None if it failed."""
    body, (sea, length, options) = truth.lewis_heave(), own.OWN[label]
    K, omega = body.K(body.band)[:, 0, 0], body.band
    rng = np.random.default_rng([base, seed, list(own.OWN).index(label)])
    model = truth.perturbed(body, rng)
    record, _ = truth.sail(body, truth.SEAS[sea](rng), length, rng, **options)
    form, began = parametrise(model.fit, model.A_inf, 0.15), time.process_time()
    try:
        if method is None:
            found = rss.identify(model, record, "prediction-error", omega=omega).K
            mean, low, high = (v[:, 0, 0] for v in (found.mean, found.lower, found.upper))
        else:
            mean, re, im = method(model, form, record, omega)
            half = np.full(K.size, np.nan) if re is None else 1.96 * (re + 1j * im)
            low, high = mean - half, mean + half
    except np.linalg.LinAlgError:
        return None
    covered = np.mean([(low.real <= K.real) & (K.real <= high.real), (low.imag <= K.imag) & (K.imag <= high.imag)])
    before = np.linalg.norm(model.fit.frequency_response(omega)[:, 0, 0] - K)
    return (np.linalg.norm(mean - K), before, np.nan if np.isnan(low).any() else covered, time.process_time() - began)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=101)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--write", action="store_true", help="put the table into docs/validation/identify.md")
    args = parser.parse_args()
    rows = {name: [name] for name in METHODS}
    for name, method in METHODS.items():
        for label in LABELS:
            found = [judged(label, method, seed, args.seed) for seed in range(args.seeds)]
            error, before, covered, cpu = np.array([row for row in found if row is not None]).T
            said = "-" if np.isnan(covered).all() else f"{covered.mean():.0%}"
            rows[name].append(f"{np.linalg.norm(error) / np.linalg.norm(before):.2f} ({said})")
            print(name, label, f"{error.size} of {args.seeds}", rows[name][-1], f"{cpu.mean():.1f} s", flush=True)
    labels = [label.removeprefix("force known, ") for label in LABELS]
    publish("identify", args.write, others=table(["pooled (bands cover)", *labels], rows.values()))


if __name__ == "__main__":
    main()
