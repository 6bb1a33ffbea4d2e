"""Systems of known truth for the tests of the fits."""

import numpy as np

import radiation_ss as rss
from radiation_ss.fit import Port, frequency_response

OMEGA = np.linspace(0.5, 40.0, 80)


def data_of(a, b, c, omega=OMEGA, dofs=("Heave",), A_inf=None):
    n = len(dofs)
    K = frequency_response(a, b, c, omega)
    A_inf = 2.0 * np.eye(n) if A_inf is None else A_inf
    return rss.HydroData(omega, A_inf + K.imag / omega[:, None, None], K.real, A_inf, dofs=dofs)


def random_passive(states, m, seed, zero=False):
    rng = np.random.default_rng(seed)
    half = states // 2
    port = Port(states - half, half, m, min(m, half) if zero else 0)
    a, b = port.realise(rng.uniform(0.4, 1.5, port.size) * rng.choice([-1.0, 1.0], port.size))
    return a, b, b.T
