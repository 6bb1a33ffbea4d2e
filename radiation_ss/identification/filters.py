"""The recursive methods, motion only: the dual filter from record to record, and the method "joint", block by block.

Of the method "joint" each block's motion updates a normal distribution of body, sea and noise parameters through its
exact likelihood (an extended Kalman filter in information form); its force follows from the motion up to its end. The
force's spectrum is the sea's through Haskind's relation, refitted all along: no fixed shaping filter can turn its
misfit into a bias of the body.
"""

from dataclasses import dataclass, replace

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.filter.dual_enkf import DualEnKF
from radiation_ss.identification.channels import Channels, motion_channels
from radiation_ss.identification.force import MARGIN, force_model, smoothed
from radiation_ss.identification.motion_only import describe_sea, structures
from radiation_ss.identification.sea import families
from radiation_ss.identification.spectral import SpectralLikelihood, spectral_likelihood
from radiation_ss.identification.study import Findings, ForceEstimate, Study, cautious
from radiation_ss.inference.laplace import find_peak, sample
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.prior import relative_spread
from radiation_ss.inference.subsystems import subsystems_of


def entrywise(model: Model, prior: float) -> Parametrisation:
    """Return the dual filter's own parametrisation: each entry a polynomial fraction with poles of its own."""
    parts = subsystems_of(model.fit)
    std = np.abs(parts.theta)
    for block, poles in zip(parts.form.blocks, parts.poles(parts.theta)):
        own = slice(block.start, block.start + 2 * block.order)
        alone = replace(block, start=0, entries=((0, 0),))
        std[own] *= prior / relative_spread(alone, parts.theta[own], std[own], poles)
    return replace(parts.form, A_inf=np.array(model.A_inf), std=std)


def by_dual_filter(study: Study) -> Findings:
    """Return what the dual filter finds from each record; the parameters of the record that told most."""
    form, rules = study.form, study.rules
    used = form.std > 0.0
    # One relative standard deviation for all coefficients, as the filter takes it.
    options = {"prior": float(np.median(form.std[used] / np.abs(form.mean[used]))), "points": study.given_points,
               "point_noise": rules.point_tolerance, "preset": rules.preset,
               "n_ensemble": 100 if rules.preset else max(100, study.rules.draws // 2)}
    runs = {record.name: DualEnKF(study.model, seed=study.seed, **options | dict(rules.filter)).run(record)
            for record in study.records}
    best = min(runs, key=lambda name: float(np.mean([p.std / p.prior_std for p in runs[name].parameters.values()
                                                     if p.prior_std > 0.0])))
    said = dict.fromkeys(text for run in runs.values() for text in run.warnings)
    if len(runs) > 1:
        said[f"the dual filter takes one record at a time: the parameters are those of record {best}, which told most"
             ] = None
    force = {name: ForceEstimate(run.time, *run.force) for name, run in runs.items()}
    # How far the force is from that of parameters left at their start, relative to its rms.
    changes = {name: {"change": float(np.sqrt(np.mean((run.force.mean - run.baseline["force"]) ** 2)
                                              / np.mean(run.force.mean**2)))} for name, run in runs.items()}
    u = (runs[best].members.T - form.mean)[:, form.active] / form.std[form.active]
    return Findings(np.asarray(u, dtype=np.float64), {"force": changes}, tuple(said), force=force)


@dataclass(frozen=True, eq=False)
class Belief:
    """Normal distribution of [u; v] by mean and precision; of u alone a likelihood beside the prior N(0, I)."""

    mean: FloatArray
    precision: FloatArray
    size: int = 0

    @property
    def covariance(self) -> FloatArray:
        """The covariance."""
        return np.asarray(np.linalg.inv(self.precision), dtype=np.float64)

    def of_body(self, n: int) -> "Belief":
        """Return the distribution of the first n parameters."""
        return Belief(self.mean[:n], np.asarray(np.linalg.inv(self.covariance[:n, :n]), dtype=np.float64))

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood up to a constant."""
        away = u - self.mean
        return 0.5 * float(u @ u - away @ self.precision @ away)

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and information in u."""
        return self.value(u, v), u - self.precision @ (u - self.mean), self.precision - np.eye(u.size)


def by_joint_filter(study: Study, forget: float = 0.97) -> Findings:
    """Return what the joint filter finds, going through the records in the order given.

    `forget`: what a block leaves of the precision of sea and noise, so that a changing sea is followed.
    """
    n = study.n_u
    body = Belief(np.zeros(n), np.eye(n))
    if study.points is not None:
        peak = find_peak(study.target([]), np.zeros(n))
        body = Belief(peak.phi, peak.fisher)
    sea, force, said = {}, {}, list[str]()
    history: dict[str, list[object]] = {"time": [], "mean": [], "std": []}
    for record in study.records:
        channels = motion_channels(study.model, record).one_each()
        blocks = cut(channels)
        start = channels.cut(0, blocks[min(1, len(blocks) - 1)][1])
        part, warnings = spectral_likelihood(study.model, study.form, start, study.rules.tolerances["force"])
        said += [text for text in warnings if text not in said]
        belief = Belief(np.r_[body.mean, np.zeros(part.size)], np.eye(n + part.size))
        belief.precision[:n, :n] = body.precision
        mean, half = np.full((2, channels.y.shape[0], study.model.n), np.nan)
        for begin, end in blocks:
            y = channels.y[begin:end]
            if np.isfinite(y).all():
                if begin == 0:
                    part, belief = first(body, part, y, study)
                else:  # the precision of sea and noise is let go a little, towards their prior
                    grow = np.r_[np.ones(n), np.full(belief.mean.size - n, forget**-0.5)]
                    belief = Belief(belief.mean, np.linalg.inv(belief.covariance * np.outer(grow, grow)))
                    belief = updated(belief, block_likelihood(part, y), study)
            mean[begin:end], half[begin:end] = block_force(part, belief, channels, (begin, end), study)
            now = belief.of_body(n)
            count = study.rules.draws
            u = study.kept(study.rng.multivariate_normal(now.mean, now.covariance, 2 * count))[:count]
            centre = cautious(study, u, [part.band])
            history["time"].append(channels.start + end * channels.dt)
            history["mean"].append(study.form.theta(centre).tolist())
            history["std"].append(study.form.theta(u).std(axis=0).tolist())
        body = belief.of_body(n)
        draws = study.rng.multivariate_normal(belief.mean[n:], belief.covariance[n:, n:], size=200)
        known = dict.fromkeys(families(), 0.0) | {part.sea.name: 1.0}
        sea[record.name] = describe_sea([(part, draws)], known)
        force[record.name] = ForceEstimate(channels.time, mean.T, (mean - half).T, (mean + half).T)
    return Findings(u, {"history": history}, tuple(said), sea, force, centre=centre, bands=(part.band,))


def cut(channels: Channels, periods: float = 30.0) -> list[tuple[int, int]]:
    """Return (begin, end) samples of blocks of some typical periods; the last takes what is left over."""
    length = int(periods * channels.period / channels.dt)
    count = max(1, channels.y.shape[0] // length)
    if length < 30 and count > 1:
        raise InputError(f"record {channels.name}: {length / periods:.1f} samples in a period are too few for the "
                         "joint filter")
    ends = [length * (i + 1) for i in range(count - 1)] + [channels.y.shape[0]]
    return list(zip([0, *ends[:-1]], ends))


def block_likelihood(part: SpectralLikelihood, y: FloatArray) -> SpectralLikelihood:
    """Return the likelihood of one block, in the units and with the sea model of `part`."""
    whole = part.rules.windowed((y - y.mean(axis=0))[None], part.channels)
    low, high = (round(f(f(item.omega[[0, -1]]) for item in part.coefficients) / whole.spacing) for f in (min, max))
    least = low + 2 * whole.reach + 2
    return replace(part, coefficients=(replace(whole, first=max(whole.first, low),
                                               last=min(whole.last, max(high, least))),))


def first(body: Belief, part: SpectralLikelihood, y: FloatArray, study: Study) -> tuple[SpectralLikelihood, Belief]:
    """Return the likelihood with the most probable family of seas, and the belief after a first block.

    By the mean and covariance of the posterior itself: a short record's is far from normal. Passivity is left to the
    draws.
    """
    study = replace(study, points=None)         # the body's belief holds them
    best = structures(study, [block_likelihood(part, y)], [body])[0]
    target = replace(study.target([*best.parts, body]), kept=None)
    draws, _ = sample(target, best.modes, study.rng, 4 * study.rules.draws, 0.0)
    covariance = np.cov(draws.T) + 1e-9 * np.eye(target.size)
    return (replace(part, sea=best.parts[0].sea),
            Belief(draws.mean(axis=0), np.asarray(np.linalg.inv(covariance), dtype=np.float64)))


def updated(belief: Belief, block: SpectralLikelihood, study: Study, longest: float = 1.0) -> Belief:
    """Return the belief after one more block, by one scoring step (recursive maximum likelihood): peaks of short blocks
    average the log spectrum, which is biased low. The step is at most `longest` prior standard deviations.
    """
    n = study.n_u
    _, gradient, information = block.local(belief.mean[:n], belief.mean[n:])
    precision = belief.precision + information
    step = np.linalg.solve(precision, gradient)
    step *= min(1.0, longest / max(float(np.abs(step).max()), 1e-300))
    while not study.allowed(belief.mean[:n] + step[:n]):
        step = 0.5 * step
    return Belief(belief.mean + step, precision)


def block_force(part: SpectralLikelihood, belief: Belief, channels: Channels, block: tuple[int, int], study: Study,
                draws: int = 6) -> tuple[FloatArray, FloatArray]:
    """Return force mean and half the width of its band (nt, n) of a block from the motion up to its end."""
    n = study.n_u
    lead = max(0, block[0] - int(2.0 * MARGIN * channels.period / channels.dt))
    y = channels.y[lead:block[1]] / part.channels.rms
    rows = study.rng.multivariate_normal(belief.mean, belief.covariance, size=draws)
    allowed = [row if study.allowed(row[:n]) else belief.mean for row in rows]
    models = [force_model(part, row[:n], row[n:]) for row in allowed]
    mean, half = smoothed(models, y, channels.dt, channels.period)
    return mean[block[0] - lead:], half[block[0] - lead:]
