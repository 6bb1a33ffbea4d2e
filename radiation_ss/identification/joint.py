"""Joint recursive filter: body, sea and coloured force from motion only, block after block.

The motion of each block updates a normal distribution of body, sea and noise parameters through its exact likelihood
(an iterated extended Kalman filter in information form); the force of the block follows from the motion up to its end
with the parameters of that moment. The force's spectrum is the sea's through Haskind's relation, refitted all along, so
that no fixed shaping filter can turn its misfit into a bias of the body.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.identification.banded import REACH, Coefficients
from radiation_ss.identification.channels import Channels, motion_channels
from radiation_ss.identification.force_smoother import MARGIN, NORMAL, smooth_one, total_deviation
from radiation_ss.identification.haskind import relation
from radiation_ss.identification.motion_only import describe_sea, force_model
from radiation_ss.identification.posterior import Likelihood, find_peak, sample
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.identification.sea_structure import PRIOR, structures
from radiation_ss.identification.spectral import (
    SpectralLikelihood,
    band_of_bins,
    frequencies,
    one_each,
    spectral_likelihood,
)
from radiation_ss.identification.study import Findings, Study, cautious

BLOCK = 30.0            # typical periods in a block
FORGET = 0.97           # what a block leaves of the precision of sea and noise, so that a changing sea is followed
FORCE_DRAWS = 6
BIGGEST_STEP = 1.0


@dataclass(frozen=True, eq=False)
class Belief:
    """Normal distribution of [u; v] by mean and precision."""

    mean: FloatArray
    precision: FloatArray

    def covariance(self) -> FloatArray:
        """Return the covariance."""
        return np.asarray(np.linalg.inv(self.precision), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Earlier:
    """What is believed of the body already, as a likelihood beside the prior N(0, I)."""

    body: Belief
    size: int = 0

    def values(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the log likelihoods up to a constant."""
        away = u - self.body.mean
        return np.asarray(0.5 * (np.sum(u * u, axis=-1) - np.sum(away @ self.body.precision * away, axis=-1)))

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and information in u."""
        return (float(self.values(u, v)), u - self.body.precision @ (u - self.body.mean),
                self.body.precision - np.eye(u.size))


def by_joint_filter(study: Study) -> Findings:
    """Return what the joint filter finds, going through the records in the order given."""
    n = study.n_u
    body = Belief(np.zeros(n), np.eye(n))
    if study.points is not None:
        peak = find_peak(study.target([]), np.zeros(n))
        body = Belief(peak.phi, peak.fisher)
    sea, force, said = {}, {}, list[str]()
    history: dict[str, list[object]] = {"time": [], "mean": [], "std": []}
    for record in study.records:
        channels = one_each(motion_channels(study.model, record))
        blocks = cut(channels)
        start = replace(channels, y=channels.y[:blocks[min(1, len(blocks) - 1)][1]])
        part, warnings = spectral_likelihood(study.model, study.form, start)
        said += [text for text in warnings if text not in said]
        belief = Belief(np.r_[body.mean, np.zeros(part.size)], _joined(body.precision, np.eye(part.size)))
        mean, sd = np.full((2, channels.y.shape[0], study.model.n), np.nan)
        for begin, end in blocks:
            y = channels.y[begin:end]
            if np.isfinite(y).all():
                if begin == 0:
                    part, belief = first_belief(body, part, y, study)
                else:
                    belief = updated(forgotten(belief, n), [block_likelihood(part, y)], study)
            mean[begin:end], sd[begin:end] = block_force(part, belief, channels, begin, end, study)
            u = kept_draws(study, marginal(belief, n))
            centre = cautious(study, u, [part.band])
            history["time"].append(channels.start + end * channels.dt)
            history["mean"].append(study.form.theta(centre).tolist())
            history["std"].append(study.form.theta(u).std(axis=0).tolist())
        covariance = belief.covariance()
        body = marginal(belief, n)
        draws = study.rng.multivariate_normal(belief.mean[n:], covariance[n:, n:], size=200)
        sea[record.name] = describe_sea([(part, draws)], dict.fromkeys(PRIOR, 0.0) | {part.sea.family: 1.0})
        force[record.name] = ForceEstimate(channels.time, mean.T, (mean - NORMAL * sd).T, (mean + NORMAL * sd).T)
    return Findings(u, {"history": history}, tuple(said), sea, force, centre=centre)


def marginal(belief: Belief, n_u: int) -> Belief:
    """Return the belief of the body alone."""
    return Belief(belief.mean[:n_u], np.asarray(np.linalg.inv(belief.covariance()[:n_u, :n_u]), dtype=np.float64))


def cut(channels: Channels) -> list[tuple[int, int]]:
    """Return (begin, end) samples of the blocks; the last takes what is left over."""
    length = int(BLOCK * 2.0 * np.pi / channels.frequency / channels.dt)
    count = max(1, channels.y.shape[0] // length)
    if length < 30 and count > 1:
        raise InputError(f"record {channels.name}: {length / BLOCK:.1f} samples in a period are too few for the joint "
                         "filter")
    ends = [length * (i + 1) for i in range(count - 1)] + [channels.y.shape[0]]
    return list(zip([0, *ends[:-1]], ends))


def block_likelihood(part: SpectralLikelihood, y: FloatArray) -> SpectralLikelihood:
    """Return the likelihood of one block, in the units and with the sea model of `part`."""
    channels = part.channels
    first, last = band_of_bins(channels.frequency, y.shape[0], channels.dt, part.settings)
    whole = Coefficients((y - y.mean(axis=0)) / channels.rms, channels.dt, first, last)
    low, high = (round(f(f(item.omega[[0, -1]]) for item in part.coefficients) / whole.spacing) for f in (min, max))
    coefficients = replace(whole, first=max(first, low), last=min(last, max(high, low + 2 * REACH + 2)))
    haskind, _ = relation(part.model, frequencies(coefficients))
    return replace(part, coefficients=(coefficients,), haskind=(haskind,))


def first_belief(body: Belief, part: SpectralLikelihood, y: FloatArray,
                 study: Study) -> tuple[SpectralLikelihood, Belief]:
    """Return the likelihood with the more probable number of wave systems, and mean and precision after a first block.

    They are those of the posterior itself, by importance sampling: a short record's is far from normal, and its mode
    is no good estimate. Passivity is left to the draws.
    """
    block, known = block_likelihood(part, y), [Earlier(body)]
    study = replace(study, points=None)         # the body's belief holds them
    best = structures(study, [block], known)[0]
    target = replace(study.target([*best.parts, *known]), passive=None)
    draws = sample(target, best.modes, study.rng, 4 * study.draws).draws
    covariance = np.cov(draws.T) + 1e-9 * np.eye(target.size)
    chosen = replace(part, sea=best.parts[0].sea)
    return chosen, Belief(draws.mean(axis=0), np.asarray(np.linalg.inv(covariance), dtype=np.float64))


def forgotten(belief: Belief, n_u: int) -> Belief:
    """Return the belief with the precision of sea and noise let go a little, towards their prior."""
    P = belief.covariance()
    grow = np.r_[np.ones(n_u), np.full(P.shape[0] - n_u, FORGET**-0.5)]
    widened = P * np.outer(grow, grow)
    return Belief(belief.mean, np.asarray(np.linalg.inv(widened), dtype=np.float64))


def updated(belief: Belief, likelihoods: list[Likelihood], study: Study) -> Belief:
    """Return the belief after one more block: one scoring step from where it stood (recursive maximum likelihood).

    Not iterated to the block's own peak: the score at the present estimate has mean zero at the truth, while the peaks
    of short blocks average the logarithm of the spectrum, which is biased low.
    """
    n = study.n_u
    gradient, information = _local(likelihoods, belief.mean, n)
    precision = belief.precision + information
    step = _limited(precision, gradient)
    while not study.allowed(belief.mean[:n] + step[:n]):
        step = 0.5 * step
    return Belief(belief.mean + step, precision)


def _local(likelihoods: list[Likelihood], phi: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Return the summed gradient and information at phi = [u; v]."""
    gradient, information = np.zeros(phi.size), np.zeros((phi.size, phi.size))
    for part in likelihoods:
        _, g, F = part.local(phi[:n], phi[n:])
        gradient, information = gradient + g, information + F
    return gradient, information


def _limited(precision: FloatArray, gradient: FloatArray) -> FloatArray:
    """Return the scoring step, shortened to BIGGEST_STEP prior standard deviations."""
    step = np.asarray(np.linalg.solve(precision, gradient), dtype=np.float64)
    return step * min(1.0, BIGGEST_STEP / max(float(np.abs(step).max()), 1e-300))


def block_force(part: SpectralLikelihood, belief: Belief, channels: Channels, begin: int, end: int,
                study: Study) -> tuple[FloatArray, FloatArray]:
    """Return force mean and standard deviation (nt, n) of a block from the motion up to its end."""
    period = 2.0 * np.pi / channels.frequency
    lead = max(0, begin - int(2.0 * MARGIN * period / channels.dt))
    y = channels.y[lead:end] / part.channels.rms
    draws = study.rng.multivariate_normal(belief.mean, belief.covariance(), size=FORCE_DRAWS)
    draws = np.array([row if study.allowed(row[:study.n_u]) else belief.mean for row in draws])
    results = [smooth_one(force_model(part, row[:study.n_u], row[study.n_u:]), y, channels.dt, period) for row in draws]
    means = np.array([mean for mean, _ in results])
    sd = total_deviation(means, np.array([variance for _, variance in results]))
    return means.mean(axis=0)[begin - lead:], sd[begin - lead:]


def kept_draws(study: Study, body: Belief) -> FloatArray:
    """Return draws of the body's parameters that the prior allows: stable, and passive where enough of them are."""
    return study.kept(study.rng.multivariate_normal(body.mean, body.covariance(), size=2 * study.draws))[:study.draws]


def _joined(a: FloatArray, b: FloatArray) -> FloatArray:
    out = np.zeros((a.shape[0] + b.shape[0],) * 2)
    out[:a.shape[0], :a.shape[0]], out[a.shape[0]:, a.shape[0]:] = a, b
    return out
