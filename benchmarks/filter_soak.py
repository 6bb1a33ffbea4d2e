"""Ten million live steps of the default filter, with a damaged sensor now and then: memory, NaN, drift.

    OMP_NUM_THREADS=1 python benchmarks/filter_soak.py [--write] [--steps 10000000]

A sea of 100 s is taken lap after lap. In every lap 1 % of the samples are missing and 0.1 % are spikes of 20 standard
deviations; in every tenth lap all sensors are silent for 3 s.
"""

import resource
import time
from itertools import pairwise
from math import isfinite

import numpy as np
from heave_tank import POINTS, known, sea_record, start
from validation import arguments, publish, table

import radiation_ss as rss

LAP = 100.0
SETTLED = 200       # samples after the start


def resident():
    """Return the memory that the process holds now [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20


def damaged_lap(clean, lap, rng):
    """Return the samples of one lap, shape (nt, 3)."""
    y = clean.copy()
    y[rng.random(y.shape) < 0.01] = np.nan
    spikes = rng.random(y.shape) < 0.001
    y[spikes] += (20.0 * clean.std(axis=0) * np.ones_like(y))[spikes]
    if lap % 10 == 9:
        y[5000:5300] = np.nan
    return y


def soak(steps, blocks=10):
    """Return rows of (steps done, memory, force NRMSE, NaN, asymmetry of P, its least eigenvalue) and microseconds."""
    record, force = sea_record(3, duration=LAP)
    clean = np.stack(list(record.channels.values()), axis=1)
    filter_ = rss.DualEnKF(start(3), seed=3, points=known(POINTS)).prepare(record)
    rng, rows, bad, squares, counted = np.random.default_rng(3), [], 0, 0.0, 0
    size, names, known_force = force.size, tuple(record.channels), force.tolist()
    marks = np.linspace(0, steps, blocks + 1).astype(int)
    begin = time.process_time()
    for first, last in pairwise(marks.tolist()):
        for i in range(first, last):
            if i % size == 0 or i == first:
                samples = damaged_lap(clean, i // size, rng).tolist()
            out = filter_.step(dict(zip(names, samples[i % size]), time=0.01 * i))
            value = float(out.force[0])
            bad += not (isfinite(value) and isfinite(out.force_std[0]) and isfinite(out.theta.sum()))
            if i >= SETTLED:
                squares += (value - known_force[i % size]) ** 2
                counted += 1
        P = filter_.engine.arrays()["P"]
        scale = np.sqrt(np.diag(P))
        rows.append([f"{last:,}", f"{resident():.1f}", f"{np.sqrt(squares / counted) / force.std():.4f}", bad,
                     f"{np.abs(P - P.T).max():.1g}", f"{np.linalg.eigvalsh(P / np.outer(scale, scale))[0]:.2g}"])
        print(rows[-1], flush=True)
        squares, counted = 0.0, 0
    return rows, 1e6 * (time.process_time() - begin) / steps


def main(write, steps):
    rows, cost = soak(steps)
    head = ["steps", "memory held [MB]", "force NRMSE of this tenth", "NaN so far", "asymmetry of P",
            "least eigenvalue of P, scaled to a unit diagonal"]
    publish("dual_filter", write, soak=table(head, rows),
            soak_cost=f"{steps:,} calls of `step`, {cost:.0f} microseconds of processor time each, with the damage "
                      "and the checks.")


if __name__ == "__main__":
    main(*arguments(__doc__, "dual_filter", steps=10_000_000))
