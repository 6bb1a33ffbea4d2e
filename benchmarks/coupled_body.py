"""Bodies of any number of coupled degrees of freedom, and any motion, for timing and for checking the loops."""

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.inference.subsystems import Subsystems
from radiation_ss.records.record import Record

COUPLED = ((0, 4), (1, 3), (1, 5))


def body(n, order, couplings=()):
    """A body for timing: stable subsystems with all poles at -8 rad/s, a quarter of the coupling of Table 3's size."""
    denominator = np.poly(-8.0 * np.ones(order))[:0:-1]
    dofs = tuple(f"Dof{i}" for i in range(n))
    entries = [(i, i) for i in range(n)] + [pair for pair in couplings if max(pair) < n]
    theta = np.concatenate([np.concatenate([denominator, (20.0 if j == k else 5.0) * denominator / 8.0])
                            for j, k in entries])
    parts = Subsystems(dofs, tuple(entries), (order,) * len(entries), theta)
    return Model(dofs, np.eye(n) * 5.3, np.eye(n) * 5.8, np.eye(n) * 580.0, parts.fit(theta))


def noise_record(model, samples, dt=0.01):
    """Any motion will do for timing: harmonics in each channel."""
    t, channels = dt * np.arange(samples), {}
    for i, dof in enumerate(model.dofs):
        phase = (6.0 + 0.1 * i) * t
        channels |= {dof: 3e-3 * np.sin(phase), dof + "_velocity": 2e-2 * np.cos(phase),
                     dof + "_acceleration": -0.12 * np.sin(phase)}
    return Record(t, channels)
