"""The paper's tank in heave, simulated by superposition of frequency responses, independent of the filters."""

import numpy as np

from radiation_ss import HydroData, Model, RadiationFit, Record
from radiation_ss.inference import parametrise

RHO, G, LENGTH, DEPTH = 1000.0, 9.81, 0.297, 0.45
TABLE_3 = ((1130.3213, 230.9063, 22.0178), (105.7441, 12.9617, 0.5849))
BAND = np.linspace(4.0, 13.0, 40)


def tank(a=TABLE_3[0], b=TABLE_3[1]) -> Model:
    companion = np.diag(np.ones(2), -1)
    companion[:, 2] = -np.array(a)
    fit = RadiationFit(("Heave",), companion, RHO * LENGTH * np.array(b)[:, None], np.array([[0.0, 0.0, 1.0]]), order=3)
    mass = 52.4 / G
    return Model(("Heave",), [[mass]], [[11.1 - mass]], [[582.7]], fit)


def with_waves(model: Model) -> Model:
    """Attach tabulated coefficients and the section's exciting force, |X|^2 = 2 rho g c_g B L."""
    w = np.linspace(0.5, 25.0, 80)
    K = model.fit.frequency_response(w)
    B = np.maximum(K.real, 1e-3)
    X = np.sqrt(2.0 * RHO * G * group_velocity(w)[:, None] * B[:, 0] * LENGTH).astype(complex)
    data = HydroData(w, model.A_inf + K.imag / w[:, None, None], B, A_inf=model.A_inf, dofs=("Heave",), depth=DEPTH,
                     M=model.M, C=model.C, X=X[:, None, :])
    return model.replace(hydro=data)


def drawn_truth(model: Model, rng, prior=0.15) -> Model:
    """Draw a body from the prior around the model: stable, and damping waves at every frequency."""
    form = parametrise(model.fit, model.A_inf, prior)
    while True:
        theta = form.theta(rng.standard_normal(form.active.size))
        if form.stable(theta) and form.realise(theta).passive:
            return model.replace(fit=form.realise(theta))


def scattered_truth(model: Model, rng, prior=0.08) -> Model:
    """Draw a body whose coefficients are off independently, which is not what the prior believes."""
    form = parametrise(model.fit, model.A_inf, prior)
    while True:
        theta = form.mean * (1.0 + prior * rng.standard_normal(form.mean.size))
        if form.stable(theta) and form.realise(theta).passive:
            return model.replace(fit=form.realise(theta))


def jonswap(w, hs=0.01, tp=1.1, gamma=3.3):
    x = np.maximum(w * tp / (2.0 * np.pi), 0.2)
    r = np.exp(-0.5 * ((x - 1.0) / np.where(x < 1.0, 0.07, 0.09)) ** 2)
    shape = x**-5 * np.exp(-1.25 * x**-4) * gamma**r
    return hs**2 / 16.0 * shape / np.trapezoid(shape, w)


def group_velocity(w):
    k = w**2 / G
    for _ in range(100):
        k = 0.5 * k + 0.5 * w**2 / G / np.tanh(k * DEPTH)
    kh = np.minimum(2.0 * k * DEPTH, 300.0)
    return 0.5 * w / k * (1.0 + kh / np.sinh(kh))


def sail(model: Model, duration, rng, *, noise=0.01, dt=0.05, spectrum=jonswap, with_force=True):
    """Return a record in a random sea (random amplitudes, period 8 times the record) and the true force (nt,)."""
    step = 2.0 * np.pi / (8.0 * duration)
    w = step * np.arange(1, int(30.0 / step))
    S = spectrum(w)
    K = model.fit.frequency_response(w)[:, 0, 0]
    X = np.sqrt(np.maximum(2.0 * RHO * G * group_velocity(w) * K.real * LENGTH, 0.0))
    amplitude = (rng.standard_normal(w.size) + 1j * rng.standard_normal(w.size)) * np.sqrt(S * step)
    F = X * amplitude
    Y = F / (-w**2 * (model.M + model.A_inf)[0, 0] + 1j * w * (K + model.D[0, 0]) + model.C[0, 0])
    t = dt * np.arange(round(duration / dt))
    # The sum of Re[F e^{i w t}] over w = step k, at t = dt m: step dt = 2 pi / N, so one FFT of length N does it.
    N = 8 * t.size
    f, y = (0.5 * N * np.fft.irfft(np.r_[0.0, values], N)[:t.size] for values in (F, Y))
    channels = {"Heave": y + noise * y.std() * rng.standard_normal(t.size)}
    if with_force:
        channels["Heave_force"] = f + noise * f.std() * rng.standard_normal(t.size)
    return Record(t, channels, kind="waves" if with_force else "motion-only"), f


def ratio(result_K, truth: Model, start: Model, omega=BAND):
    """Return the error of K over the wave band after / before."""
    true = truth.fit.frequency_response(omega)
    return np.linalg.norm(result_K - true) / np.linalg.norm(start.fit.frequency_response(omega) - true)
