"""Accuracy of the default filter beside filterpy's and DAPPER's ensemble Kalman filters: same data, one run.

    OMP_NUM_THREADS=1 python benchmarks/filter_accuracy.py [--write] [--seeds 20] [--force known unknown]

All have 100 members of [parameters, motion, force] with the same start, prior spread, sensor noise, force model and
Runge-Kutta step. The paper's tank, 10 s at 100 Hz, parameters 15 % off.
"""

import argparse
import contextlib
import io

import numpy as np
from filter_by_numpy import noise_covariance, rate, rk4
from heave_tank import BAND, TRUTH, error, sea_record, start, tank
from validation import publish, table

import radiation_ss as rss
from radiation_ss.inference.scales import channels
from radiation_ss.inference.subsystems import subsystems_of

MEMBERS, DT, DURATION, LATE = 100, 0.01, 10.0, 200
FORCE = 11      # place of the force in [6 parameters, 3 memory, displacement, velocity, force, its rate]


class Job:
    """One seed's data and what every filter is given."""

    def __init__(self, seed, force_known):
        self.seed, self.model = seed, start(seed)
        self.record, self.force = sea_record(seed, DURATION)
        if force_known:
            noise = 0.01 * self.force.std() * np.random.default_rng(seed + 77).standard_normal(self.force.size)
            self.record = self.record.with_channels(Heave_force=self.force + noise)
        self.filter = rss.DualEnKF(self.model, seed=seed, n_ensemble=MEMBERS, omega=BAND).prepare(self.record)
        engine = self.filter.engine
        self.system = engine.system
        self.rows = 4 if force_known else 3
        self.H, self.R = engine.system.H[:self.rows], engine.system.r[:self.rows]
        self.y = channels(self.record, ("Heave",)).T[:, :self.rows]
        theta = subsystems_of(self.model.fit).theta
        self.mean = np.concatenate([theta, np.zeros(7)])
        self.spread = np.concatenate([(0.15 * theta) ** 2, np.diag(engine.state.P)])
        Q = noise_covariance(self.system, theta, DT)
        self.Q = np.zeros((13, 13))
        # A covariance that is factored must not be singular; parameters move by 0.016 % in 10 s.
        self.Q[6:, 6:] = Q + 1e-10 * np.diag(np.diag(engine.state.P))
        self.Q[:6, :6] = np.diag((5e-6 * theta) ** 2)

    def move(self, E):
        """Return members (columns, 13 rows) one step on."""
        theta = E[:6]
        return np.vstack([theta, rk4(lambda z: rate(self.system, theta, z), E[6:], DT)])

    def score(self, theta, low, high, f, f_std):
        """Return K error after / before, cover of parameters, force NRMSE, cover of the force's band."""
        before = error(self.model.fit.frequency_response(BAND))
        off = f - self.force[-f.size:]
        return (error(tank(theta).fit.frequency_response(BAND)) / before, np.mean((low <= TRUTH) & (high >= TRUTH)),
                np.std(off[LATE:]) / self.force.std(), np.mean(np.abs(off[LATE:]) <= 1.96 * f_std[LATE:]))

    def of_path(self, mean, std):
        """Return the score of means and standard deviations (nt, 13)."""
        theta, reach = mean[-1, :6], 1.96 * std[-1, :6]
        return self.score(theta, theta - reach, theta + reach, mean[:, FORCE], std[:, FORCE])


def ours(job):
    estimate = job.filter.run(job.record)
    p = estimate.parameters.values()
    std = (estimate.force.upper - estimate.force.mean)[0] / 1.96
    return job.score(np.array([q.mean for q in p]), np.array([q.lower for q in p]), np.array([q.upper for q in p]),
                     estimate.force.mean[0], std)


def idle(job):
    filter_ = rss.DualEnKF(job.model, prior=0.0, n_ensemble=4, learn="never", omega=BAND)
    estimate = filter_.run(job.record)
    theta = job.mean[:6]
    std = (estimate.force.upper - estimate.force.mean)[0] / 1.96
    return job.score(theta, theta, theta, estimate.force.mean[0], std)


def scalar_move(job):
    """Return the step of one member in plain floats: what a user of filterpy would write."""
    A, (inverse,), (stiffness,) = job.A[0], job.plan.inverse[0:1, 0], job.plan.stiffness[0:1, 0]
    a10, a11 = float(A[1, 0]), float(A[1, 1])
    persistent = float(A[0, 1])

    def slope(s):
        a1, a2, a3, b1, b2, b3, x1, x2, x3, d, v, f, g = s
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, b1 * v - a1 * x3, x1 + b2 * v - a2 * x3, x2 + b3 * v - a3 * x3, v,
                inverse * (f - x3 - stiffness * d), persistent * g, a10 * f + a11 * g)

    def move(s, dt):
        k1 = slope(s)
        k2 = slope([x + 0.5 * dt * k for x, k in zip(s, k1)])
        k3 = slope([x + 0.5 * dt * k for x, k in zip(s, k2)])
        k4 = slope([x + dt * k for x, k in zip(s, k3)])
        return np.array([x + dt / 6.0 * (p + 2.0 * q + 2.0 * r + w) for x, p, q, r, w in zip(s, k1, k2, k3, k4)])

    return lambda s, dt: move(s.tolist(), dt)


def by_filterpy(job):
    from filterpy.kalman import EnsembleKalmanFilter

    np.random.seed(job.seed)    # noqa: NPY002 - filterpy draws from the global generator
    filter_ = EnsembleKalmanFilter(x=job.mean, P=np.diag(job.spread), dim_z=job.rows, dt=DT, N=MEMBERS,
                                   hx=lambda s: job.H @ s[6:], fx=scalar_move(job))
    filter_.Q, filter_.R = job.Q, np.diag(job.R)
    mean, std = np.empty((len(job.y), 13)), np.empty((len(job.y), 13))
    for k, y in enumerate(job.y):
        if k:
            filter_.predict()
        filter_.update(y)
        mean[k], std[k] = filter_.x, filter_.sigmas.std(axis=0, ddof=1)
    return job.of_path(mean, std)


def by_dapper(job, kind, inflation):
    with contextlib.redirect_stdout(io.StringIO()):
        import dapper as dpr
        import dapper.da_methods as da
        import dapper.mods as modelling
    dpr.set_seed(job.seed + 1)
    unit = np.sqrt(job.spread)      # every row of order one, so that no factor loses digits
    shape = modelling.GaussRV(C=modelling.CovMat(job.Q / DT / np.outer(unit, unit), kind="full"))
    time = modelling.Chronology(dt=DT, dko=1, Ko=len(job.y) - 2)
    first = modelling.GaussRV(C=np.ones(13), mu=job.mean / unit)
    hmm = modelling.HiddenMarkovModel(
        {"M": 13, "model": lambda E, t, dt: job.move(np.atleast_2d(E * unit).T).T / unit, "noise": shape},
        {"M": job.rows, "model": lambda E: (E * unit)[..., 6:] @ job.H.T, "noise": job.R}, time, first)
    method = da.EnKF(kind, N=MEMBERS, infl=inflation)
    truth = np.zeros((len(job.y), 13))
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        method.assimilate(hmm, truth, job.y[1:], liveplots=False)
    return job.of_path(np.asarray(method.stats.mu.a) * unit, np.asarray(method.stats.spread.a) * unit)


FILTERS = {"doing nothing (parameters left at their start)": idle,
           "here, default filter": ours,
           "filterpy, EnsembleKalmanFilter": by_filterpy,
           "DAPPER, EnKF perturbed observations": lambda job: by_dapper(job, "PertObs", 1.0),
           "DAPPER, EnKF square root": lambda job: by_dapper(job, "Sqrt", 1.0),
           "DAPPER, EnKF square root, inflation 1.01": lambda job: by_dapper(job, "Sqrt", 1.01)}


def attempt(run, job):
    try:
        with np.errstate(all="ignore"):
            return run(job)
    except (rss.SolverError, np.linalg.LinAlgError, ValueError, FloatingPointError):
        return (np.nan,) * 4


def main(write, seeds, forces):
    rows = {title: [title] for title in FILTERS}
    for name in forces:
        for title, run in FILTERS.items():
            results = np.array([attempt(run, Job(seed, name == "known")) for seed in range(seeds)])
            lost = int((~np.isfinite(results).all(axis=1)).sum())
            K, _, nrmse, cover = np.nanmedian(results, axis=0)
            inside = 100.0 * np.nanmean(results[:, 1])
            rows[title] += [f"{K:.3g} ({'-' if run is idle else f'{inside:.0f}%'})",
                            f"{nrmse:.4f} ({cover:.0%})" + f", {lost} failed" * (lost > 0)]
            print(name, title, *rows[title][-2:], flush=True)
    head = [f"medians over {seeds} tanks (bands cover)"]
    for name in forces:
        head += [f"force {name}: K error after / before", "force NRMSE"]
    publish("dual_filter", write, accuracy=table(head, rows.values()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write its tables in docs/validation/dual_filter.md")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--force", nargs="+", choices=("known", "unknown"), default=("known", "unknown"))
    arguments = parser.parse_args()
    main(arguments.write, arguments.seeds, arguments.force)
