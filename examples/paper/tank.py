"""The paper's body and tank, from nothing: section solver -> fit -> waves -> motion. Shared by the figures' scripts.

Where the paper has a tank test, motion and force here are sums of harmonics with the coefficients of the section
solver themselves (the paper's "spectrum method", section 5.2), so that the fitted model is as wrong as any fit is.
Sensors have 1 % noise.
"""

import argparse
from functools import lru_cache
from pathlib import Path

import numpy as np

import radiation_ss as rss
from radiation_ss.body.model import Model
from radiation_ss.hydro.data import HydroData
from radiation_ss.records.record import Record
from radiation_ss.waves.force import force_harmonics
from radiation_ss.waves.realise import harmonic_sum, realise
from radiation_ss.waves.spectrum import jonswap

RHO, G, LENGTH, HALF_BREADTH, DRAFT, DEPTH, WEIGHT = 1000.0, 9.81, 0.297, 0.10, 0.10, 0.45, 52.4
CASES = {"Case-1": 0.8, "Case-2": 0.9, "Case-3": 1.0}  # mean wave period T01 [s] (Table 2); H1/3 = 10 mm
UNIT = RHO * LENGTH  # Table 3 holds the kernel over density and length
# Table 3: what the paper prints. These numbers are only ever printed beside ours.
TABLE_3 = {"2D-BEM": (1130.3213, 230.9063, 22.0178, 105.7441, 12.9617, 0.5849),
           "Case-1": (1118.7779, 229.6268, 22.1839, 107.0172, 12.9494, 0.5830),
           "Case-2": (1093.3195, 236.4745, 22.6247, 107.4617, 12.6381, 0.5801),
           "Case-3": (1092.9484, 239.7216, 22.5530, 106.6844, 12.5331, 0.5830)}
# Not in the paper: l_G [m] below the water, roll radius [m], C22 [N/m].
CENTRE, GYRADIUS, SWAY_SPRING = 0.05, 0.06, 10.0


@lru_cache
def section(depth=DEPTH) -> HydroData:
    """Coefficients of the Lewis section, times the model's length."""
    shape = rss.lewis_section(HALF_BREADTH, DRAFT, 0.90)
    return rss.section_2d(shape, np.linspace(0.5, 34.0, 90), depth, rho=RHO, g=G, centre_of_gravity=-CENTRE,
                          gyradius=GYRADIUS).times(LENGTH)


@lru_cache
def heave_model() -> Model:
    """Heave with the paper's fit of the kernel (8), n = 3."""
    data = section().select("Heave").replace(M=[[WEIGHT / G]])
    return Model.from_hydro(data, rss.fit_radiation(data, 3, method="quasi-newton"))


@lru_cache
def sway_roll_model() -> Model:
    """Sway and roll about the centre of gravity in deep water, n = 5, with the soft spring of section 5.2."""
    data = section(np.inf).select(("Sway", "Roll")).at((0.0, 0.0, -CENTRE))
    data = data.replace(C=data.C + np.diag([SWAY_SPRING, 0.0]))
    return Model.from_hydro(data, rss.fit_radiation(data, 5, method="quasi-newton"))


def sail(model: Model, t01, duration=30.0, dt=0.01, seed=0, noise=0.01):
    """Return a record of displacements, velocities and accelerations, and the true force (n, nt).

    As in the tank, the body is at rest when the waves arrive, within 3 s. The motion is computed by its harmonics,
    the force being let go after the record so that the body comes to rest again before the series repeats.
    """
    data = model.hydro
    total = duration + 20.0
    sea = realise(jonswap(0.010, t01=t01), total, dt, seed=seed, directions=data.directions[:1])
    t = dt * np.arange(sea.period)
    arrival = np.sin(0.5 * np.pi * np.clip(t / 3.0, 0.0, 1.0)) ** 2
    end = np.cos(0.5 * np.pi * np.clip((t - duration) / 3.0, 0.0, 1.0)) ** 2
    force = arrival * end * harmonic_sum(force_harmonics(data, sea), sea.period)
    F, w = np.fft.rfft(force), sea.omega
    K = np.stack([np.interp(w, data.omega, column) for column in data.K.reshape(data.omega.size, -1).T], 1)
    impedance = (-w[:, None, None] ** 2 * (model.M + model.A_inf) + model.C
                 + 1j * w[:, None, None] * K.reshape(-1, data.n, data.n))
    Z = np.linalg.solve(impedance, F.T[..., None])[..., 0].T
    rng, channels, kept = np.random.default_rng([seed, 1]), {}, round(duration / dt)
    for power, suffix in enumerate(("", "_velocity", "_acceleration")):
        for dof, row in zip(model.dofs, np.fft.irfft(Z * (1j * w) ** power, sea.period)[:, :kept]):
            channels[dof + suffix] = row + noise * row.std() * rng.standard_normal(kept)
    return Record(t[:kept], channels, kind="motion-only", name=f"T01 = {t01} s"), force[:, :kept]


def perturbed(model: Model, seed, spread=0.15) -> Model:
    """Return the model with its subsystems' parameters off by `spread`, stable."""
    from radiation_ss.inference.subsystems import subsystems_of

    parts, rng = subsystems_of(model.fit), np.random.default_rng([seed, 2])
    while True:
        theta = parts.theta * (1.0 + spread * rng.standard_normal(parts.theta.size))
        if parts.stable(theta):
            return model.replace(fit=parts.fit(theta, model.A_inf))


def wavenumber(omega):
    """Return K b = w^2 b / g, the paper's frequency axis."""
    return np.asarray(omega) ** 2 * HALF_BREADTH / G


def frequency(Kb):
    """Return w [rad/s] of K b."""
    return np.sqrt(np.asarray(Kb) * G / HALF_BREADTH)


def force_error(estimate, force, skip=2.0):
    """Return the NRMSE of the force and the share of its 95 % band that covers it, after `skip` seconds."""
    late = estimate.time >= skip
    mean, low, high = (part[:, late] for part in estimate.force)
    truth = force[:, late]
    error = np.sqrt(np.mean((mean - truth) ** 2, axis=1)) / truth.std(axis=1)
    return error, np.mean((truth > low) & (truth < high), axis=1)


def printed(rows, header):
    """Print a table."""
    table = [header, *[[cell if isinstance(cell, str) else f"{cell:.4g}" for cell in row] for row in rows]]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]
    for row in table:
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths)))


def figure(name, draw, **shape):
    """Draw in the package's look and write a picture where `--out` says."""
    import matplotlib.pyplot as plt

    from radiation_ss.style import look

    with look():
        fig, axes = plt.subplots(**shape)
        draw(axes)
        folder = options().out
        folder.mkdir(parents=True, exist_ok=True)
        fig.savefig(folder / f"{name}.png")
        plt.close(fig)
    print(f"picture: {folder / name}.png")


@lru_cache
def options():
    """Return the command line: --full (the paper's size), --runs, --seeds, --out (folder of pictures)."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--full", action="store_true", help="the paper's number of members in Figs. 14 to 17")
    parser.add_argument("--runs", type=int, default=200, help="of Figs. 9, 10 and Table 3; the paper has 1000")
    parser.add_argument("--seeds", type=int, default=10, help="starts and seas of the medians in Figs. 14 to 17")
    parser.add_argument("--out", type=Path, default=Path("paper_figures"))
    return parser.parse_known_args()[0]
