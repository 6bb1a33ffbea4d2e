"""The paper's tank in heave with a known truth: motion and force as sums of harmonics, exact at every sample."""

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.inference.subsystems import Subsystems
from radiation_ss.records.record import Record
from radiation_ss.waves.realise import realise
from radiation_ss.waves.spectrum import jonswap

# Table 3, first row: the kernel over density and length. M + A_inf and C as in notes on the paper's Table 1.
TABLE = np.array([1130.3213, 230.9063, 22.0178, 105.7441, 12.9617, 0.5849])
TRUTH = TABLE * np.repeat([1.0, 1000.0 * 0.297], 3)
MASS, INERTIA, STIFFNESS = 52.4 / 9.81, 11.1, 582.7
BAND = np.linspace(4.0, 11.0, 40)
POINTS = (float(np.sqrt(0.3 * 9.81 / 0.1)), float(np.sqrt(9.81 / 0.1)))  # K b = 0.3 and 1


def tank(theta=TRUTH) -> Model:
    parts = Subsystems(("Heave",), ((0, 0),), (3,), np.asarray(theta))
    return Model(("Heave",), [[MASS]], [[INERTIA - MASS]], [[STIFFNESS]], parts.fit(theta))


def start(seed, spread=0.15) -> Model:
    """The tank with parameters off by `spread`."""
    return tank(TRUTH * (1.0 + spread * np.random.default_rng(seed).standard_normal(6)))


def drawn_about(which, seed):
    """Return a start and the truth (6,) for one seed.

    "truth": the start is normal about Table 3's row, as `start` has it. "start": the row is the start, the truth is
    drawn as the filter's prior says, until it is a body: one that is no less passive than K is known to.
    """
    if which == "truth":
        return start(seed), TRUTH
    rng, spread = np.random.default_rng([seed, 1]), np.sqrt(np.log1p(0.15**2))
    while True:
        theta = TRUTH * np.exp(spread * rng.standard_normal(6))
        if tank(theta).fit.passivity_margin >= -1e-3:
            return tank(), theta


def sea_record(seed, duration=30.0, dt=0.01, noise=0.01, t01=1.0, truth=TRUTH):
    """Return a record of displacement, velocity and acceleration in JONSWAP waves, and the true force (nt,)."""
    sea = realise(jonswap(0.01, t01=t01), duration, dt, seed=seed)
    w = np.maximum(sea.omega, 1e-9)
    K = tank(truth).fit.frequency_response(w)[:, 0, 0]
    # Haskind in deep water gives the size of the force; its phase is free here.
    X = np.sqrt(np.maximum(K.real, 0.0) * 1000.0 * 0.297 * 9.81**2 / w) * np.exp(-0.02j * w**2)
    F = np.where(w > 1.0, X, 0.0) * sea.amplitudes.sum(axis=0)
    Z = F / (-w**2 * INERTIA + 1j * w * K + STIFFNESS)
    rng = np.random.default_rng(seed + 1000)
    motion = [sea.signal(Z * (1j * w) ** k) for k in range(3)]
    names = ("Heave", "Heave_velocity", "Heave_acceleration")
    noisy = {name: v + noise * v.std() * rng.standard_normal(v.size) for name, v in zip(names, motion)}
    return Record(sea.time, noisy), sea.signal(F)


def with_force(record, force, seed):
    """Return the record with its force measured, 1 % noise."""
    noise = 0.01 * force.std() * np.random.default_rng(seed).standard_normal(force.size)
    return record.with_channels(Heave_force=force + noise)


def error(K, truth=TRUTH):
    """Return the error of K over the wave band, relative."""
    true = tank(truth).fit.frequency_response(BAND)
    return float(np.linalg.norm(K - true) / np.linalg.norm(true))


def known(omegas, truth=TRUTH):
    """Return the true K at some frequencies, as DualEnKF takes it."""
    return dict(zip(omegas, tank(truth).fit.frequency_response(omegas)))
