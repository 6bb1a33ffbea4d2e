"""Monte Carlo of a corrected model: a million motions of 60 s, each in its own sea with its own drag and stiffness.

    python benchmarks/ensemble.py [--members 1000000] [--few 2000] [--write]

Asked: a million in 10 s on one GPU; the same numbers on a CPU and by Dask's workers. Seas are made before the clock
runs.
"""

import os
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from heave_tank import tank
from validation import arguments, publish, table

from radiation_ss.simulation import simulate_ensemble
from radiation_ss.waves.spectrum import jonswap

TIME = np.arange(0.0, 60.0, 0.1)
EFFECTS = [("quadratic_drag", {"coefficient": 1.0}), ("cubic_stiffness", {"stiffness": 1.0})]


def numbers(members):
    """Return drag and cubic stiffness of each member (members, 2), as a diagnosis might give them."""
    return np.array([60.0, 4e5]) * (1.0 + 0.1 * np.random.default_rng(0).standard_normal((members, 2)))


def forces(members):
    """Return the forces of as many random seas (members, 1, nt) [N]: twice as steep as the paper's."""
    omega = 2 * np.pi * np.fft.rfftfreq(2 * TIME.size, TIME[1])
    band = (omega > 2.0) & (omega < 25.0)
    size = np.zeros(omega.size)
    size[band] = 500.0 * np.exp(-0.05 * omega[band]) * np.sqrt(jonswap(0.02, t01=1.0)(omega[band]) * omega[1])
    found, rng = np.empty((members, 1, TIME.size)), np.random.default_rng(1)
    for at in range(0, members, 20_000):
        some = found[at:at + 20_000, 0]
        real, imaginary = rng.standard_normal((2, len(some), omega.size))
        some[:] = np.fft.irfft(size * (real + 1j * imaginary), axis=1)[:, :TIME.size] * TIME.size
    return found


def run(force, p, backend="numpy"):
    """Return the motions of a batch."""
    return simulate_ensemble(tank(), TIME, force, EFFECTS, parameters=p, substeps=2, backend=backend)


def timed(function, *given):
    """Return what a function gives, and the seconds on the wall."""
    start = time.perf_counter()
    found = function(*given)
    return found, time.perf_counter() - start


def by_dask(force, p, workers=2):
    """Return peaks (members, n) by Dask's workers, a quarter of the members at a time."""
    from filter_cluster import cluster

    with tempfile.TemporaryDirectory() as folder, cluster(workers, Path(folder)) as client:
        client.gather(client.map(run, [force[:8]] * 8, [p[:8]] * 8, pure=False))
        parts, took = timed(lambda: client.gather(client.map(run, np.array_split(force, 4), np.array_split(p, 4))))
    return np.concatenate([part.peak for part in parts]), took


def main():
    write, members, few = arguments(__doc__, "ensemble", members=1_000_000, few=2000)
    force, p = forces(members), numbers(members)
    run(force[:8], p[:8])
    base, took = timed(run, force[:few], p[:few])
    tables = {"processor": [("NumPy, one process", few, f"{took:.1f}", "-")]}
    if find_spec("distributed"):
        peak, took = by_dask(force[:few], p[:few])
        tables["processor"].append(("NumPy, two Dask workers", few, f"{took:.1f}", apart(peak, base.peak)))
    if find_spec("jax"):
        import jax

        device = jax.devices()[0].device_kind
        tables["accelerator"] = []
        for word in ("first call, compiles", "again"):
            found, took = timed(run, force, p, "jax")
            tables["accelerator"].append((f"JAX, {device}, {word}", members, f"{took:.1f}",
                                          apart(found.peak[:few], base.peak)))
    publish("ensemble", write, **{name: table(("engine", "members", "s", "largest difference of a peak"), rows)
                                  for name, rows in tables.items()})


def apart(peak, base):
    """Return the largest relative difference of peaks, as text."""
    return f"{np.abs(peak / base - 1.0).max():.0e}"


if __name__ == "__main__":
    os.environ.setdefault("XLA_PYTHON_CLIENT_MEM_FRACTION", "0.9")
    main()
