"""Simulated records of the tank with nominal numbers off within tolerance; truth and fit share the integrator."""

import numpy as np
from plant_bodies import tank_model

from radiation_ss import Record
from radiation_ss.simulation import simulate

KINDS = ("decay", "decay", "waves", "waves")


def tank_case(effects, seed=0, kinds=KINDS, noise=0.01, tolerance=0.02, duration=30.0, dt=0.05):
    """Return the nominal model and noisy records of the true body."""
    model, rng = tank_model(), np.random.default_rng(seed)
    off = 1.0 + tolerance * rng.standard_normal(4)
    fit = type(model.fit)(model.fit.dofs, model.fit.a, model.fit.b, model.fit.c * off[2], model.fit.order)
    truth = model.replace(M=model.M * off[0], C=model.C * off[1], fit=fit)
    time = np.arange(0.0, duration, dt)
    records = []
    for k, kind in enumerate(kinds):
        start, force, level = None, np.zeros(time.size), k % 5 + 1
        if kind == "decay":
            start = np.array([0.0, 0.0, 0.0, 0.015 * level, 0.0])
        else:
            omega = np.linspace(4.0, 12.0, 60)
            size = 0.8 * level * np.exp(-(((omega - 8.0) / 1.5) ** 2))
            force = size @ np.cos(np.outer(omega, time) + rng.uniform(0.0, 2.0 * np.pi, (60, 1)))
        motion = simulate(truth, (time, off[3] * force[None]), effects, start=start).outputs[0]
        motion = motion + noise * motion.std() * rng.standard_normal(time.size)
        records.append(Record(time, {"Heave": motion, "Heave_force": force}, kind=kind, name=f"{kind} {k + 1}"))
    return model, records
