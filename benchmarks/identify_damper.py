"""A damper that the model lacks, in waves of known elevation: how far it goes into B, and whether bands hold.

    python benchmarks/identify_damper.py [--seeds 10] [--dampers 0 15000 30000 60000]

Capytaine's sphere of RADIATION_SS_DATA; the truth by Fourier series from its coefficients, X off smoothly by 3 %.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss

DATA = Path(os.environ.get("RADIATION_SS_DATA", ROOT.parent / "shared" / "data"))


def recorded(model: rss.Model, damper: float, seed: int, duration: float = 600.0, dt: float = 0.1) -> rss.Record:
    """Return heave, with noise of half a percent, and elevation of a sea a tenth below resonance."""
    table, rng, count = model.hydro, np.random.default_rng(seed), round(duration / dt)
    omega, known = 2.0 * np.pi * np.fft.rfftfreq(count, dt), table.omega
    A, B, real, imag = (np.interp(omega, known, row) for row in (
        table.A[:, 0, 0], table.B[:, 0, 0], table.X[:, 0, 0].real, table.X[:, 0, 0].imag))
    knots = np.linspace(*np.log(known[[0, -1]]), 12)
    error = CubicSpline(knots, 0.03 * rng.standard_normal((2, 12)), axis=1)(np.log(np.clip(omega, known[0], known[-1])))
    M, C = model.M[0, 0], model.C[0, 0]
    spectrum = rss.jonswap(1.0, 2.0 * np.pi / (0.9 * np.sqrt(C / (M + model.A_inf[0, 0]))))(omega)
    inside = (omega > known[0]) & (omega < known[-1])
    eta = np.sqrt(0.5 * spectrum * omega[1]) * (rng.standard_normal((2, omega.size)).T @ [1.0, 1j]) * inside
    X = (real + 1j * imag) * np.exp(error[0] + 1j * error[1])
    heave = X * eta / (C - omega**2 * (M + A) + 1j * omega * (B + damper))
    x, elevation = (count * np.fft.irfft(part, count)[: 4 * count // 5] for part in (heave, eta))
    x = x + 0.005 * x.std() * rng.standard_normal(x.size)
    return rss.Record(dt * np.arange(x.size), {"Heave": x, "wave_elevation": elevation}, kind="waves")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--dampers", type=float, nargs="+", default=[0.0, 15e3, 30e3, 60e3])
    given = parser.parse_args()
    model = rss.read_model(DATA / "bem" / "formats" / "sphere_capytaine.nc", dofs=["Heave"])
    natural = np.sqrt(model.C[0, 0] / (model.M + model.A_inf)[0, 0])
    omega = natural * np.linspace(0.6, 1.5, 9)
    B = np.interp(omega, model.hydro.omega, model.hydro.B[:, 0, 0])
    print("|damper, N s/m|B off|bands hold|")
    for damper in given.dampers:
        rows = []
        for seed in range(given.seeds):
            found = rss.identify(model, recorded(model, damper, seed), "prediction-error", omega=omega).B
            low, mean, high = (part[:, 0, 0] for part in (found.lower, found.mean, found.upper))
            rows.append((np.linalg.norm(mean - B) / np.linalg.norm(B), np.mean((low <= B) & (high >= B))))
        print(f"|{damper:g}|" + "|".join(f"{value:.3f}" for value in np.mean(rows, axis=0)) + "|", flush=True)


if __name__ == "__main__":
    main()
