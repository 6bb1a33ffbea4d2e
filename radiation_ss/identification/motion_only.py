"""Motion only: the methods "spectral", by whole records, and "joint", block after block.

In "joint" each block's motion updates a normal distribution of body, sea and noise parameters through its exact
likelihood (an extended Kalman filter in information form); its force follows from the motion up to its end. The
force's spectrum is the sea's through Haskind's relation, refitted all along: no fixed shaping filter can turn its
misfit into a bias of the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.filter.estimate import Band
from radiation_ss.identification.channels import Channels, known_force, motion_channels, thinned
from radiation_ss.identification.families import Race, mixed, sea_mode, structures
from radiation_ss.identification.force import ForceSpectra, Window, smooth_force, smoothed
from radiation_ss.identification.haskind import receptance_times_X, relation
from radiation_ss.identification.motion_likelihood import MotionLikelihood, motion_likelihoods
from radiation_ss.identification.prediction_error import law_warnings, score_laws
from radiation_ss.identification.result import ForceEstimate
from radiation_ss.identification.spectral import SpectralLikelihood, one_each, spectral_likelihood, windowed
from radiation_ss.identification.study import Findings, Study, cautious
from radiation_ss.inference.laplace import find_peak, sample
from radiation_ss.records.record import Record

LEFT_IN = "motion alone leaves it in A and B, and its size is the first step from a linear fit"
Seas: TypeAlias = Sequence[tuple[SpectralLikelihood, FloatArray]]       # a record's likelihood and draws of its sea


def by_motion_only(study: Study) -> Findings:
    """Return what the spectral method finds: one body, one sea for each record; decay tests join in with zero force."""
    parts, warnings, decays = [], [], list[MotionLikelihood]()
    runs = [record for record in study.records if record.kind != "decay"]
    if not runs:
        raise InputError("records: only decay tests; use method 'prediction-error'")
    for record in study.records:
        channels = motion_channels(study.model, record)
        if record.kind == "decay":
            known = known_force(study.model, record)
            assert known is not None
            decays += motion_likelihoods(study.model, study.form, *thinned(channels, known))
            continue
        part, said = spectral_likelihood(study.model, study.form, channels, study.rules.tolerances["force"])
        parts.append(part)
        warnings += [text for text in said if text not in warnings]
    branches = mixed(study, structures(study, parts, decays, Race()), decays)
    sea: dict[str, Any] = {}
    force: dict[str, ForceEstimate] = {}
    changes = {}
    for i, (record, part) in enumerate(zip(runs, parts)):
        name, seas = record.name, [branch.sea(i) for branch in branches]
        families = dict.fromkeys(part.sea.prior.families, 0.0)
        for branch, (own, _) in zip(branches, seas):
            families[own.sea.name] += branch.probability
        sea[name] = describe_sea(seas, families)
        free = sum(share for family, share in families.items() if "free" in family or "lumpy" in family)
        if free >= 0.5:
            warnings.append(f"record {name}: the sea is not JONSWAP-like (free with a probability of {free:.0%}); "
                            "motion alone says little of the body in such a sea, and the answer stays near the model")
        force[name] = estimate_force([(own, branch.draws[:, :study.n_u], v)
                                      for branch, (own, v) in zip(branches, seas)])
        idle = sea_mode(part, np.zeros(study.n_u)).phi[None]
        changes[name] = compare_forces(study, record, force[name], estimate_force(
            [(part, np.zeros((1, study.n_u)), idle)]))
    best = branches[0]
    if best.structure.apart:
        warnings.append("with a sea of one system in every record no body that is near the model explains the motion: "
                        "the seas repeat or have lines, or the body has what the model lacks (drag), which goes into A "
                        "and B here; the bands do not hold that: run diagnose on records with a known force")
    tests = score_laws(best.target, best.structure.modes[0], decays)
    asked = [name for name, row in tests.items() if row["p"] < study.rules.nonlinear / len(tests)]
    u = np.vstack([branch.draws[:, :study.n_u] for branch in branches])
    share = sum(branch.probability * branch.share for branch in branches)
    bands = tuple(part.band for part in parts)
    return Findings(u, {"force": changes, "nonlinearity_test": tests},
                    (*warnings, *law_warnings(tests, asked, LEFT_IN)), sea, force, share,
                    cautious(study, u, bands), bands)


def describe_sea(seas: Seas, families: dict[str, float]) -> dict[str, Any]:
    """Return the spectrum, and Hs, Tp, gamma of its JONSWAP part, with bands, of the draws in each structure."""
    part = seas[0][0]
    first, labels = part.coefficients[0], part.channels.labels
    omega = np.linspace(first.omega[0], first.omega[-1], 80)
    rows = [np.array(item.sea.natural(v)) for item, v in seas if item.sea.family.systems]
    systems = dict(zip(("Hs_jonswap", "Tp", "gamma"), map(Band.of, np.hstack(rows)))) if rows else {}
    S = np.concatenate([item.sea.density(v, omega) for item, v in seas])
    noise = np.concatenate([np.sqrt(item.noise(v)) * part.channels.rms for item, v in seas])
    return {"Hs": Band.of(4.0 * np.sqrt(np.trapezoid(S, omega, axis=1))), **systems, "omega": omega,
            "S": Band.of(S),
            "noise_std": {label: Band.of(noise[:, i]) for i, label in enumerate(labels)},
            "families": families, "two_systems": families["two systems"], "relation": part.haskind[0].source}


def force_model(part: SpectralLikelihood, u: FloatArray, v: FloatArray, top: float = 6.0,
                points: int = 600) -> ForceSpectra:
    """Return the spectra of one draw on the smoother's grid, up to `top` times the motion's median frequency.

    Beyond the bins that are used the sea is as its family goes on: the force may have much of its power there, where a
    free body hardly moves.
    """
    channels = part.channels
    omega = np.linspace(0.0, min(top * channels.frequency, np.pi / channels.dt), points + 1)
    w = np.maximum(omega, omega[1])
    haskind = part.with_errors(v, relation(part.model, part.form, w)[0], w)
    X, motion = receptance_times_X(part.model, part.form, u, w, haskind)
    factors = (1j * w[:, None]) ** channels.derivative / channels.rms
    return ForceSpectra(omega, X, motion[:, channels.dof] * factors, part.sea.density(v, omega), part.noise(v),
                        part.unexplained(v))


def estimate_force(branches: Sequence[tuple[SpectralLikelihood, FloatArray, FloatArray]],
                   draws: int = 16) -> ForceEstimate:
    """Return the force of a record over (some of) the draws u, v in each structure."""
    rows = [(part, u[i], v[i]) for part, u, v in branches for i in range(u.shape[0])]
    pick = np.unique(np.linspace(0, len(rows) - 1, min(draws, len(rows))).astype(int))
    channels = branches[0][0].channels
    y = (channels.y - np.nanmean(channels.y, axis=0)) / channels.rms
    return smooth_force([force_model(*rows[i]) for i in pick], y, channels)


def compare_forces(study: Study, record: Record, found: ForceEstimate, idle: ForceEstimate) -> dict[str, float]:
    """Return how far the force is from the prior model's, and both errors where the record carries the true force."""
    size = np.sqrt(np.mean(found.mean**2))
    out = {"change": float(np.sqrt(np.mean((found.mean - idle.mean) ** 2)) / size)}
    measured = record.get("force", study.model.dofs)
    if measured is not None and measured.shape == found.mean.shape:
        good = np.isfinite(measured)
        rms = np.sqrt(np.mean(measured[good] ** 2))
        for key, estimate in (("do_nothing_error", idle), ("identified_error", found)):
            out[key] = float(np.sqrt(np.mean((estimate.mean - measured)[good] ** 2)) / rms) if rms > 0.0 else np.nan
    return out


@dataclass(frozen=True)
class Pace:
    """How the joint filter goes through a record."""

    block: float = 30.0  # Typical periods in a block
    forget: float = 0.97  # What a block leaves of the precision of sea and noise, so that a changing sea is followed
    draws: int = 6  # Of the parameters, for a block's force
    longest: float = 1.0  # Longest step of a block in any parameter, in prior standard deviations


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

    def of_body(self, n: int) -> Belief:
        """Return the distribution of the first n parameters."""
        return Belief(self.mean[:n], np.asarray(np.linalg.inv(self.covariance[:n, :n]), dtype=np.float64))

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood up to a constant."""
        away = u - self.mean
        return 0.5 * float(u @ u - away @ self.precision @ away)

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and information in u."""
        return self.value(u, v), u - self.precision @ (u - self.mean), self.precision - np.eye(u.size)


def by_joint_filter(study: Study) -> Findings:
    """Return what the joint filter finds, going through the records in the order given."""
    n, pace = study.n_u, Pace()
    body = Belief(np.zeros(n), np.eye(n))
    if study.points is not None:
        peak = find_peak(study.target([]), np.zeros(n))
        body = Belief(peak.phi, peak.fisher)
    sea, force, said = {}, {}, list[str]()
    history: dict[str, list[object]] = {"time": [], "mean": [], "std": []}
    for record in study.records:
        channels = one_each(motion_channels(study.model, record))
        blocks = cut(channels, pace)
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
                    grow = np.r_[np.ones(n), np.full(belief.mean.size - n, pace.forget**-0.5)]
                    belief = Belief(belief.mean, np.linalg.inv(belief.covariance * np.outer(grow, grow)))
                    belief = updated(belief, block_likelihood(part, y), study, pace)
            mean[begin:end], half[begin:end] = block_force(part, belief, channels, (begin, end), study, pace)
            now = belief.of_body(n)
            count = study.rules.draws
            u = study.kept(study.rng.multivariate_normal(now.mean, now.covariance, 2 * count))[:count]
            centre = cautious(study, u, [part.band])
            history["time"].append(channels.start + end * channels.dt)
            history["mean"].append(study.form.theta(centre).tolist())
            history["std"].append(study.form.theta(u).std(axis=0).tolist())
        body = belief.of_body(n)
        draws = study.rng.multivariate_normal(belief.mean[n:], belief.covariance[n:, n:], size=200)
        known = dict.fromkeys(part.sea.prior.families, 0.0) | {part.sea.name: 1.0}
        sea[record.name] = describe_sea([(part, draws)], known)
        force[record.name] = ForceEstimate(channels.time, mean.T, (mean - half).T, (mean + half).T)
    return Findings(u, {"history": history}, tuple(said), sea, force, centre=centre, bands=(part.band,))


def cut(channels: Channels, pace: Pace) -> list[tuple[int, int]]:
    """Return (begin, end) samples of the blocks; the last takes what is left over."""
    length = int(pace.block * channels.period / channels.dt)
    count = max(1, channels.y.shape[0] // length)
    if length < 30 and count > 1:
        raise InputError(f"record {channels.name}: {length / pace.block:.1f} samples in a period are too few for the "
                         "joint filter")
    ends = [length * (i + 1) for i in range(count - 1)] + [channels.y.shape[0]]
    return list(zip([0, *ends[:-1]], ends))


def block_likelihood(part: SpectralLikelihood, y: FloatArray) -> SpectralLikelihood:
    """Return the likelihood of one block, in the units and with the sea model of `part`."""
    whole = windowed((y - y.mean(axis=0))[None] / part.channels.rms, part.channels, part.rules)
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
    best = structures(study, [block_likelihood(part, y)], [body], Race())[0]
    target = replace(study.target([*best.parts, body]), kept=None)
    draws, _ = sample(target, best.modes, study.rng, 4 * study.rules.draws, 0.0)
    covariance = np.cov(draws.T) + 1e-9 * np.eye(target.size)
    return (replace(part, sea=best.parts[0].sea),
            Belief(draws.mean(axis=0), np.asarray(np.linalg.inv(covariance), dtype=np.float64)))


def updated(belief: Belief, block: SpectralLikelihood, study: Study, pace: Pace) -> Belief:
    """Return the belief after one more block: one scoring step from where it stood (recursive maximum likelihood).

    The score there has mean zero at the truth; peaks of short blocks average the log spectrum, which is biased low.
    """
    n = study.n_u
    _, gradient, information = block.local(belief.mean[:n], belief.mean[n:])
    precision = belief.precision + information
    step = np.linalg.solve(precision, gradient)
    step *= min(1.0, pace.longest / max(float(np.abs(step).max()), 1e-300))
    while not study.allowed(belief.mean[:n] + step[:n]):
        step = 0.5 * step
    return Belief(belief.mean + step, precision)


def block_force(part: SpectralLikelihood, belief: Belief, channels: Channels, block: tuple[int, int], study: Study,
                pace: Pace) -> tuple[FloatArray, FloatArray]:
    """Return force mean and half the width of its band (nt, n) of a block from the motion up to its end."""
    window, n = Window(), study.n_u
    lead = max(0, block[0] - int(2.0 * window.margin * channels.period / channels.dt))
    y = channels.y[lead:block[1]] / part.channels.rms
    draws = study.rng.multivariate_normal(belief.mean, belief.covariance, size=pace.draws)
    draws = np.array([row if study.allowed(row[:n]) else belief.mean for row in draws])
    models = [force_model(part, row[:n], row[n:]) for row in draws]
    mean, half = smoothed(models, y, channels.dt, channels.period)
    return mean[block[0] - lead:], half[block[0] - lead:]
