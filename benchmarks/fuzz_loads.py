"""Large work: processor time and memory, each in a process of its own."""

import os
import resource
import tempfile
import time
from pathlib import Path

import numpy as np
from filter_soak import soak
from fit_systems import data_of, random_passive
from gap_cases import tank_case

import radiation_ss as rss

ROWS_OF_A_PIECE = 100_000
STEPS = 10_000_000
LARGE = "large work: "      # what `only` may ask for, too


def measured(job):
    """Run a job in a forked child; return what it says, processor seconds and the memory beyond the start [MB]."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        begin = time.process_time()
        try:
            said = job() or "done"
        except rss.RadiationError as error:
            said = f"refused: {str(error)[:150]}"
        except BaseException as error:
            said = f"failed: {type(error).__name__}: {str(error)[:150]}"
        more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        os.write(write, f"{said}|{time.process_time() - begin:.1f}|{more / 1024:.0f}".encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        said = pipe.read().decode()
    os.waitpid(child, 0)
    return said.split("|") if said else ["failed: the process ended", "", ""]


def write_large(path: Path, size: int) -> None:
    """Write a record of some bytes: eight columns of 17 digits."""
    rest = "," + ",".join(f"{0.0123456789012345 * k:.17g}" for k in range(1, 8)) + "\n"
    names = ["Heave [m]", "Heave_velocity [m/s]", "Heave_acceleration [m/s^2]", "Heave_force [N]", "Roll [rad]",
             "Roll_velocity [rad/s]", "wave_elevation [m]"]
    with open(path, "w", encoding="utf-8") as file:
        file.write("# kind: forced\n" + ",".join(["time [s]", *names]) + "\n")
        first = 0
        while file.tell() < size:
            file.writelines(f"{k / 100}{rest}" for k in range(first, first + ROWS_OF_A_PIECE))
            first += ROWS_OF_A_PIECE


def long_records(count=50, duration=600.0):
    """Return the tank's records, 10 minutes at 100 Hz each: decays and waves in turn."""
    kinds = tuple(("decay", "waves")[k % 2] for k in range(count))
    return tank_case([("quadratic_drag", "Heave", {"coefficient": 300.0})], 1, kinds, duration=duration, dt=0.01)


def large_body(n=12, frequencies=1000):
    """Return data of two bodies of six degrees of freedom."""
    names = [f"{b}__{m}" for b in ("hull", "pool") for m in ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")][:n]
    a, b, c = random_passive(2 * n, n, 0)
    data = data_of(a, b, c, np.linspace(0.5, 40.0, frequencies), names, 3.0 * np.eye(n))
    return data.replace(M=2.0 * np.eye(n), C=100.0 * np.eye(n))


def loads(told, only="", csv_bytes=10**9, records=50):
    """Return rows (work, size, processor seconds, memory beyond the start [MB], what came of it), each told at once."""
    rows = []

    def add(what, size, job):
        if only in LARGE + what:
            said, seconds, memory = measured(job)
            rows.append([what, size, seconds, memory, said.replace(f"{name}/", "")])
            told(rows[-1])

    with tempfile.TemporaryDirectory() as name:
        if only in LARGE + "read_record of a CSV, `largest=1_000_000`":
            path = Path(name) / "large.csv"
            write_large(path, csv_bytes)
            size = f"{path.stat().st_size / 1e9:.2f} GB"
            add("read_record of a CSV", size, lambda: f"{rss.read_record(path).time.size:,} rows")
            add("read_record of a CSV, `largest=1_000_000`", size, lambda: rss.read_record(path, largest=10**6))
            path.unlink()
        data, size = large_body(), "12 dofs, 1000 frequencies"
        add("write_hydro, read_hydro", size, lambda: written(data, Path(name) / "large.nc"))
        add("HydroData.check", size, lambda: data.check() and None)
        add("fit_radiation, order 2", size, lambda: fitted(data))
        model, given = long_records(records) if any(only in LARGE + what for what in LONG) else (None, [])
        size = f"{records} records"
        add("steps of the live filter, one by one", f"{STEPS:,} samples of a damaged sensor", stepped)
        for what, job in LONG.items():
            add(what, size, lambda job=job: job(model, given))
    return rows


LONG = {
    "write_record, read_record": lambda model, given: all_read(given),
    "simulate": lambda model, given: [rss.simulate(model, record) for record in given] and None,
    "identify, spectral, of those in waves": lambda model, given: rss.identify(model, [rss.Record(
        r.time, {"Heave": r.channels["Heave"]}, kind="motion-only") for r in given[1::2]]) and None,
    "diagnose": lambda model, given: rss.diagnose(model, given).verdict.status,
    "DualEnKF.run of the second": lambda model, given: rss.DualEnKF(model, n_ensemble=40).run(given[1]) and None}


def stepped():
    """Return what the soak's last tenth says of ten million steps."""
    rows, cost = soak(STEPS)
    return (f"{cost:.0f} microseconds each, {rows[-1][3]} NaN, memory held {rows[0][1]} MB after a tenth and "
            f"{rows[-1][1]} MB at the end, force NRMSE {rows[0][2]} and {rows[-1][2]}")


def written(data, path):
    rss.write_hydro(data, path)
    return f"{rss.read_hydro(path).n} dofs"


def fitted(data):
    fit = rss.fit_radiation(data, 2)
    return f"relative error {fit.relative_error:.3f}, passive {fit.passive}"


def all_read(records):
    with tempfile.TemporaryDirectory() as folder:
        for k, record in enumerate(records):
            rss.write_record(record, Path(folder) / f"r{k}.csv")
            rss.read_record(Path(folder) / f"r{k}.csv")
