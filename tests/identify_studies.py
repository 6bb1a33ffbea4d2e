"""What `identify` claims over many seeds: tests try a few of them, `benchmarks/identify_seeds.py` all."""

import numpy as np
from identify_tank import BAND, drawn_truth, ratio, sail, scattered_truth, tank, with_waves

from radiation_ss import Record, identify, simulate


def covers(band, true):
    """Share of the values that lie in a band."""
    return np.mean((band.lower <= true) & (true <= band.upper))


def known_force(seeds):
    """Ratio of the errors of K, share of B in its bands, what the data tell and one-step errors after and before."""
    rows = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        truth = drawn_truth(tank(), rng)
        record, _ = sail(truth, 30.0, rng)
        found = identify(tank(), record, "prediction-error", omega=BAND, seed=seed, draws=300)
        error = found.baseline["one_step_error"]["record"]
        rows.append((ratio(found.K.mean, truth, tank()), covers(found.B, truth.fit.frequency_response(BAND).real),
                     found.information["data"].mean(), error["identified"] / error["do_nothing"]))
    return np.array(rows).T


def not_smooth(seeds):
    """Of coefficients that are off independently: ratio of the errors of K, share of B in its bands, dampers named."""
    rows = []
    for seed in seeds:
        rng = np.random.default_rng([11, seed])
        truth = scattered_truth(tank(), rng, 0.15)
        record, _ = sail(truth, 30.0, rng)
        found = identify(tank(), record, "prediction-error", omega=BAND, seed=seed, draws=300)
        rows.append((ratio(found.K.mean, truth, tank()), covers(found.B, truth.fit.frequency_response(BAND).real),
                     any("waves do not carry away all damping" in text for text in found.warnings)))
    return np.array(rows).T


def motion_alone(seeds):
    """Errors of K after and before, shares of B and of the force in their bands, what the data tell."""
    start, rows = with_waves(tank()), []
    for seed in seeds:
        rng = np.random.default_rng(100 + seed)
        truth = scattered_truth(start, rng)
        record, force = sail(truth, 90.0, rng, with_force=False)
        found = identify(start, record, "spectral", omega=BAND, seed=seed)
        K, estimate = truth.fit.frequency_response(BAND), found.force["record"]
        rows.append((np.linalg.norm(found.K.mean - K), np.linalg.norm(found.prior["K"] - K), covers(found.B, K.real),
                     np.mean((estimate.lower[0] <= force) & (force <= estimate.upper[0])),
                     found.information["data"].mean()))
    return np.array(rows).T


def contradicting(seeds):
    """Bodies of the prior that are said to contradict it at a limit of one deviation."""
    said = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 8])
        record, _ = sail(drawn_truth(tank(), rng), 30.0, rng)
        found = identify(tank(), record, "prediction-error", omega=BAND, draws=50, contradiction=1.0)
        said.append(any("contradict" in text for text in found.warnings))
    return np.array(said)


def decay(body, seed, effects=()):
    """Return a decay test from 20 mm with sensor noise of 1e-3 of that."""
    t = 0.02 * np.arange(400)
    start = np.zeros(body.fit.states + 2)
    start[-2] = 0.02
    still = Record(t, {"Heave": np.zeros(t.size), "Heave_force": np.zeros(t.size)}, kind="decay")
    y = simulate(body, still, effects, start=start).outputs[0]
    noisy = y + 2e-5 * np.random.default_rng(seed).standard_normal(t.size)
    return still.with_channels(Heave=noisy)


def warned(seed):
    """Warnings of misfit on three sound records of one body: a sea, one with more noise, a decay."""
    rng = np.random.default_rng(seed)
    body = drawn_truth(tank(), rng)
    records = [sail(body, 30.0, rng)[0], sail(body, 30.0, rng, noise=0.03)[0], decay(body, seed)]
    return [text for record in records
            for text in identify(tank(), record, "prediction-error", omega=BAND, draws=50).warnings
            if "the linear model leaves" in text]
