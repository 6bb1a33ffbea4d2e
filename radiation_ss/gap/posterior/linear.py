"""The linear model over frequency, along the motion of a fit."""

from __future__ import annotations

import numpy as np
from scipy.fft import next_fast_len

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.fit.rational import frequency_response
from radiation_ss.gap.posterior.fitting import Fit


def paths(root: Fit) -> list[dict]:
    """Return time, displacement and velocity of the root's motion on each record's grid."""
    problem, found = root.problem, []
    m, n = problem.setting.model.fit.states, problem.setting.model.n
    for r, prepared in enumerate(problem.setting.records):
        motion = problem.motion(root.q, r)
        found.append({"time": prepared.grid, "h": problem.setting.h, "x": motion.state[:, m:m + n],
                      "v": motion.state[:, m + n:m + 2 * n],
                      "padded": next_fast_len(2 * prepared.grid.size, real=True)})
    return found


def frequencies(count: int, h: float) -> FloatArray:
    """Return the circular frequencies of the transform of `count` real values in steps of h [rad/s]."""
    return np.asarray(2.0 * np.pi * np.fft.rfftfreq(count, h))


def receptance(model: Model, omega: FloatArray) -> ComplexArray:
    """Return the displacement per force of the linear model, shape (nw, n, n)."""
    K = frequency_response(model.fit.a, model.fit.b, model.fit.c, omega)
    w = omega[:, None, None]
    return np.asarray(np.linalg.inv(model.C - w**2 * (model.M + model.A_inf) + 1j * w * (K + model.D)
                                    + 1e-9 * np.eye(model.n) * np.abs(model.M + model.A_inf).max()))


def smooth(values: FloatArray, h: float, top: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacement, velocity and acceleration below the circular frequency `top`, by Fourier series.

    The straight line through the ends is taken out and the rest reflected oddly, so that the series is continuous
    with its slope and its derivatives do not ring.
    """
    count = values.shape[0]
    line = values[0] + (values[-1] - values[0]) * np.linspace(0.0, 1.0, count)[:, None]
    rest = values - line
    double = np.concatenate([rest, -rest[-2:0:-1]])
    at = 2.0 * np.pi * np.fft.rfftfreq(double.shape[0], h)[:, None]
    spectrum = np.fft.rfft(double, axis=0) * (at <= top)
    x, v, a = (np.fft.irfft((1j * at) ** k * spectrum, double.shape[0], axis=0)[:count] for k in range(3))
    return x + line, v + (values[-1] - values[0]) / (h * (count - 1)), a
