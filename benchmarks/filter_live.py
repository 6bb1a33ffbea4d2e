"""Live steps: a hundred bodies on one core, and the longest step while the parameters learn.

    OMP_NUM_THREADS=1 python benchmarks/filter_live.py [--write] [--seconds 60]

Processor time; the worst step by the wall clock is given beside it, with the load of the machine.
"""

import gc
import time

import numpy as np
from heave_tank import POINTS, known, sea_record, start, with_force
from validation import arguments, publish, table

import radiation_ss as rss

LIMIT = 10e-3  # s


def samples_of(record, seconds, rate):
    """Return live samples at a rate [Hz], the record taken lap after lap."""
    every, size = round(100.0 / rate), record.time.size
    names, values = list(record.channels), np.stack(list(record.channels.values()), axis=1)
    for k in range(round(seconds * rate)):
        yield {"time": k / rate, **dict(zip(names, values[k * every % size].tolist()))}


def frozen():
    """Take what is there out of Python's cyclic garbage collection, whose full pass over the imports takes 70 ms."""
    gc.collect()
    gc.freeze()


def timed(filter_, sample):
    """Return processor and wall-clock time of one step [s]."""
    wall, cpu = time.perf_counter(), time.process_time()
    filter_.step(sample)
    return time.process_time() - cpu, time.perf_counter() - wall


def hundred(case, seconds, rate=20, bodies=100):
    """Return a row: share of one core, worst step, of many bodies at one rate."""
    records = [sea_record(seed, 60.0) for seed in range(8)]
    filters, feeds = [], []
    for body in range(bodies):
        record, force = records[body % 8]
        options = {"points": known(POINTS)} if case == "points known" else {}
        if case == "force known, learning":
            record, options = with_force(record, force, body), {"pace": 1}
        filters.append(rss.DualEnKF(start(body), seed=body, **options).prepare(record))
        feeds.append(samples_of(record, seconds, rate))
    times = []
    frozen()
    for tick in zip(*feeds):
        times.append([timed(filter_, sample) for filter_, sample in zip(filters, tick)])
    cpu, wall = np.array(times)[1:].transpose(2, 0, 1)
    tick = cpu.sum(axis=1)
    return [f"{bodies} bodies, {case}", rate, f"{seconds:g}", f"{100.0 * cpu.sum() / (len(cpu) / rate):.0f} %",
            f"{1e3 * tick.max():.0f} of {1000 / rate:.0f}", f"{1e3 * np.quantile(cpu, 0.999):.2f}",
            f"{1e3 * cpu.max():.1f}", f"{1e3 * wall.max():.1f}", int((cpu > LIMIT).sum())]


def learning(seconds, rate=100):
    """Return a row: one body that learns from a known force."""
    record, force = sea_record(0, seconds)
    record = with_force(record, force, 0)
    filter_ = rss.DualEnKF(start(0), seed=0).prepare(record)
    frozen()
    cpu, wall = np.array([timed(filter_, sample) for sample in samples_of(record, seconds, rate)])[1:].T
    return ["one body, force known, learning", rate, f"{seconds:g}", f"{100.0 * cpu.sum() / seconds:.1f} %",
            f"{1e3 * cpu.max():.0f} of {1000 / rate:.0f}", f"{1e3 * np.quantile(cpu, 0.999):.2f}",
            f"{1e3 * cpu.max():.1f}", f"{1e3 * wall.max():.1f}", int((cpu > LIMIT).sum())]


def main(write, seconds):
    record, force = sea_record(0, 2.0)
    warm = rss.DualEnKF(start(0)).prepare(with_force(record, force, 0))
    warm.run(with_force(record, force, 0))  # compiled code is loaded
    rows = []
    for row in (lambda: learning(700.0), *(lambda case=case: hundred(case, seconds) for case in (
            "force unknown", "points known", "force known, learning"))):
        rows.append(row())
        print(rows[-1], flush=True)
    head = ["", "rate [Hz]", "seconds of data", "of one core", "busiest tick [ms]", "step, 99.9 % [ms]",
            "worst step, processor [ms]", "worst step, wall clock [ms]", "steps over 10 ms of processor time"]
    publish("filter_speed", write, live=table(head, rows))


if __name__ == "__main__":
    main(*arguments(__doc__, "filter_speed", seconds=60.0))
