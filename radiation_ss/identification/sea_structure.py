"""One wave system or two in each sea: competing models, weighed by their evidence and mixed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.identification.passivity import LEAST
from radiation_ss.identification.posterior import LEAST_EFFECTIVE, Likelihood, Peak, Target, find_peak
from radiation_ss.identification.sea import BASIC
from radiation_ss.identification.spectral import SpectralLikelihood
from radiation_ss.identification.study import ENOUGH, Inference, Study

TWO = 0.25                          # prior probability that a sea has two systems of waves
SECOND_PERIODS = (0.65, 1.5)        # where a second system is looked for, over the first's period
SECOND_ENERGY = 0.5
HOPELESS = 6.0                      # log odds by Laplace's evidence below which a structure is not drawn from
SAME = 0.5                          # distance in posterior standard deviations below which two modes are one


class FixedBody:
    """A record's likelihood with the body held at one set of radiation parameters: only sea and noise are free."""

    def __init__(self, part: SpectralLikelihood, u: FloatArray) -> None:
        self.part, self.u, self.size = part, u, part.size

    def value(self, u: FloatArray, v: FloatArray) -> float:
        """Return the log likelihood."""
        return self.part.value(self.u, v)

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and Fisher information in v."""
        value, gradient, fisher = self.part.local(self.u, v)
        n = self.u.size
        return value, gradient[n:], fisher[n:, n:]


@dataclass(frozen=True, eq=False)
class Structure:
    """One choice of wave systems for every sea.

    Parameters
    ----------
    parts : tuple of SpectralLikelihood
    modes : tuple of Peak
        Distinct modes of the posterior of body and all seas, the most probable first.
    """

    parts: tuple[SpectralLikelihood, ...]
    modes: tuple[Peak, ...]

    @property
    def evidence(self) -> float:
        """Log prior probability of the structure plus Laplace's log evidence, summed over modes."""
        return self.prior + float(logsumexp([mode.evidence for mode in self.modes]))

    @property
    def prior(self) -> float:
        """Log prior probability of the structure."""
        return float(sum(np.log(TWO if part.sea.two_systems else 1.0 - TWO) for part in self.parts))


@dataclass(frozen=True, eq=False)
class Branch:
    """A structure with its posterior, its probability, and the draws that it contributes."""

    parts: tuple[SpectralLikelihood, ...]
    inference: Inference
    probability: float
    draws: FloatArray


def do_nothing(part: SpectralLikelihood, n_u: int) -> tuple[FloatArray, float]:
    """Return the most probable sea and noise with the body at the prior mean, and the log likelihood there."""
    u = np.zeros(n_u)
    peak = find_peak(Target(0, [FixedBody(part, u)], lambda _: True), np.zeros(part.size))
    return peak.phi, part.value(u, peak.phi)


def structures(study: Study, parts: Sequence[SpectralLikelihood], others: Sequence[Likelihood],
               start: FloatArray) -> list[Structure]:
    """Return the structures of the seas that Laplace's evidence leaves room for, the most probable first.

    From one system in every sea each sea is tried with two, one after the other, and kept where that is more probable;
    what remains in the race is the best structure and those that differ from it in one sea. With several degrees of
    freedom seas keep one system: there a single climb takes up to a minute.
    """
    n = study.n_u
    best = Structure(tuple(parts), (find_peak(study.target([*parts, *others]), np.r_[np.zeros(n), start]),))
    tried = [best]
    ends = np.cumsum([part.size for part in parts])
    for i, (part, end) in enumerate(zip(parts, ends)):
        if part.channels.count > 1:
            continue
        second = _with_second_system(study, best, i, others, start[end - part.size:end])
        if second is not None:
            tried.append(second)
            best = max(best, second, key=lambda item: item.evidence)
    tried.sort(key=lambda item: -item.evidence)
    return [item for item in tried if item.evidence > best.evidence - HOPELESS]


def mixed(study: Study, race: Sequence[Structure], others: Sequence[Likelihood], start: FloatArray) -> list[Branch]:
    """Draw from every structure and return them by their evidence, the most probable first.

    A structure gets as many effective draws as it is likely to contribute. Evidence is that of the passive part where
    enough of the whole posterior is passive.
    """
    top = max(item.evidence for item in race)
    found = [study.drawn(study.target([*item.parts, *others]), item.modes, np.r_[np.zeros(study.n_u), start],
                         max(LEAST_EFFECTIVE, ENOUGH * float(np.exp(item.evidence - top)))) for item in race]
    logs = np.array([item.prior + one.evidence for item, one in zip(race, found)])
    weights = np.exp(logs - logsumexp(logs))
    share = np.array([one.share for one in found])
    if float(weights @ share) > LEAST:
        weights = np.where(share > LEAST, weights * share, 0.0)
        weights = weights / weights.sum()
    ends = np.round(np.cumsum(weights) * study.draws).astype(int)
    counts = np.diff(np.r_[0, ends])
    branches = [Branch(item.parts, one, float(weight), one.draws[study.rng.permutation(one.draws.shape[0])[:count]])
                for item, one, weight, count in zip(race, found, weights, counts) if count]
    return sorted(branches, key=lambda branch: -branch.probability)


def _with_second_system(study: Study, single: Structure, number: int, others: Sequence[Likelihood],
                        idle: FloatArray) -> Structure | None:
    """Return the structure with two systems in one more sea; None if no mode is reached.

    The climbs start from the body of the best mode and from the prior's, with the second system at longer and at
    shorter periods than the first: a body that has made up for a missing system is not a good place to look for it.
    `idle` is the sea and noise for the prior's body.
    """
    n, part, mode = study.n_u, single.parts[number], single.modes[0].phi
    two = replace(part, sea=replace(part.sea, two_systems=True))
    parts = (*single.parts[:number], two, *single.parts[number + 1:])
    target = study.target([*parts, *others])
    offset = n + sum(item.size for item in single.parts[:number])
    before, after = mode[:offset], mode[offset + part.size:]
    modes: list[Peak] = []
    for u, v in ((mode[:n], mode[offset:offset + part.size]), (np.zeros(n), idle)):
        for period in SECOND_PERIODS:
            v2 = np.concatenate([v[:BASIC], two.sea.standardised_second(SECOND_ENERGY, period), v[BASIC:]])
            try:
                sea = find_peak(Target(0, [FixedBody(two, u)], lambda _: True), v2)
                modes.append(find_peak(target, np.concatenate([u, before[n:], sea.phi, after])))
            except SolverError:     # no second system there
                continue
    return Structure(parts, _distinct(modes)) if modes else None


def _distinct(modes: Sequence[Peak]) -> tuple[Peak, ...]:
    """Return modes that are not the same and not hopeless beside the best, the most probable first."""
    kept: list[Peak] = []
    for mode in sorted(modes, key=lambda peak: -peak.evidence):
        near = any((mode.phi - other.phi) @ other.fisher @ (mode.phi - other.phi) < SAME**2 for other in kept)
        if not near and (not kept or mode.evidence > kept[0].evidence - HOPELESS):
            kept.append(mode)
    return tuple(kept)
