"""How the default filter's cost grows, and whether six degrees of freedom keep up with 100 Hz.

    OMP_NUM_THREADS=1 python benchmarks/filter_growth.py [--only thousand] [--write]
"""

import argparse
import resource
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from coupled_body import COUPLED, body, noise_record
from heave_tank import sea_record, tank
from validation import publish, table

import radiation_ss as rss
from radiation_ss.filter import FilterStudy


def cost(model, members, samples=400, **options):
    """Return processor time of one sample [s]."""
    record = noise_record(model, samples)
    filter_ = rss.DualEnKF(model, n_ensemble=members, prior=0.02, **options).prepare(record)
    y = np.stack([record.channels[d + s] for s in ("", "_velocity", "_acceleration") for d in model.dofs]
                 + [np.full(samples, np.nan)] * model.n)
    half = samples // 2
    filter_.advance(record.time[:half], y[:, :half])
    begin = time.process_time()
    filter_.advance(record.time[half:], y[:, half:])
    return (time.process_time() - begin) / (samples - half)


def slope(sizes, times):
    """Return the slope of log time over log size in the upper half of the sizes."""
    half = len(sizes) // 2
    return np.polyfit(np.log(sizes[half:]), np.log(times[half:]), 1)[0]


def growth():
    studies = {
        "degrees of freedom (n = 3, 100 members)": ([1, 2, 3, 6, 12], lambda n: cost(body(n, 3), 100)),
        "order (one degree of freedom, 100 members)": ([2, 3, 4, 6, 8, 10], lambda n: cost(body(1, n), 100)),
        "members (one degree of freedom, n = 3)": ([10, 30, 100, 300, 1000, 10_000], lambda n: cost(body(1, 3), n)),
    }
    rows = []
    for name, (sizes, measure) in studies.items():
        times = [measure(size) for size in sizes]
        rows.append([name, ", ".join(str(s) for s in sizes), ", ".join(f"{1e6 * t:.3g}" for t in times),
                     f"{slope(sizes, times):.2f}"])
    return rows


def length():
    """Return time a sample and peak memory over record length, taken in pieces of 10 000 samples."""
    rows, record = [], sea_record(1, duration=100.0)[0]
    y = np.stack([record.channels[k] for k in ("Heave", "Heave_velocity", "Heave_acceleration")]
                 + [np.full(record.time.size, np.nan)])
    for samples in (1_000, 10_000, 100_000, 1_000_000, 10_000_000):
        filter_ = rss.DualEnKF(tank()).prepare(record)
        begin, piece = time.process_time(), min(samples, 10_000)
        for first in range(0, samples, piece):
            filter_.advance(0.01 * np.arange(first, first + piece), y[:, :piece])
        rows.append([f"{samples:.0e}", f"{1e6 * (time.process_time() - begin) / samples:.2f}",
                     f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}"])
    return rows


def thousand():
    """Return the seconds and memory of 1000 runs of Fig. 9 on two threads, and whether results equal one thread's."""
    record, _ = sea_record(1)
    rows = []
    for draws in ("gaussian", "three-point"):
        study = FilterStudy(tank(), record, preset="paper", draws=draws)
        study(0)
        with ThreadPoolExecutor(2) as pool:
            wall, cpu = time.perf_counter(), time.process_time()
            results = rss.repeat(study, 1000, executor=pool)
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        first = rss.repeat(study, 20)
        same = all(np.array_equal(results[name][:20], first[name], equal_nan=True) for name in first)
        rows.append([draws, f"{wall:.1f}", f"{cpu:.1f}", f"{0.5 * cpu:.1f}",
                     f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}", "yes" if same else "no"])
    return rows


def six():
    body_ = body(6, 5, COUPLED)
    states, parameters = body_.fit.states + 12, rss.DualEnKF(body_, prior=0.0).parts.theta.size
    return [[f"{label}: {states} states, {parameters} parameters, 500 members", "10",
             f"{1e3 * cost(body_, 500, samples=60, learn=learn):.2f}"]
            for label, learn in (("force unknown", "known-force"), ("all parameters learning", "always"))]


TABLES = {"growth": (growth, ["cost over", "sizes", "microseconds a sample", "slope, upper half"]),
          "length": (length, ["samples", "microseconds a sample", "peak memory [MB]"]),
          "thousand": (thousand, ["draws", "wall clock, 2 threads [s]", "processor [s]", "processor / 2 [s]",
                                  "peak memory [MB]", "as on one thread, to the last bit"]),
          "six": (six, ["six degrees of freedom", "asked, ms a sample", "measured"])}


def main(write, only):
    publish("filter_speed", write, **{name: table(header, rows()) for name, (rows, header) in TABLES.items()
                                      if only in (None, name)})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write its tables in docs/validation/filter_speed.md")
    parser.add_argument("--only", choices=TABLES, help="one table")
    args = parser.parse_args()
    main(args.write, args.only)
