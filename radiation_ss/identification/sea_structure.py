"""Families of seas (one system of waves, two, free): competing models, weighed by their evidence and mixed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.identification.passivity import LEAST
from radiation_ss.identification.posterior import Likelihood, Peak, Target, find_peak
from radiation_ss.identification.spectral import SpectralLikelihood
from radiation_ss.identification.study import Inference, Study

PRIOR = {"one system": 0.5, "two systems": 0.2, "free": 0.2, "lumpy": 0.1}    # probability of each family of seas


@dataclass(frozen=True, eq=False)
class FixedBody:
    """A record's likelihood with the body held at one set of radiation parameters: only sea and noise are free."""

    part: SpectralLikelihood
    u: FloatArray

    @property
    def size(self) -> int:
        """Number of nuisance parameters."""
        return self.part.size

    def values(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the log likelihoods."""
        return self.part.values(np.broadcast_to(self.u, (v.shape[0], self.u.size)), v)

    def local(self, u: FloatArray, v: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return log likelihood, gradient and Fisher information in v."""
        value, gradient, fisher = self.part.local(self.u, v)
        n = self.u.size
        return value, gradient[n:], fisher[n:, n:]


@dataclass(frozen=True, eq=False)
class Structure:
    """One choice of a family for every sea.

    Parameters
    ----------
    parts : tuple of SpectralLikelihood
    modes : tuple of Peak
        Distinct modes of the posterior of body and all seas, the most probable first.
    """

    parts: tuple[SpectralLikelihood, ...]
    modes: tuple[Peak, ...]

    @property
    def prior(self) -> float:
        """Log prior probability of the structure."""
        return float(sum(np.log(PRIOR[part.sea.family]) for part in self.parts))

    @property
    def evidence(self) -> float:
        """Log prior probability of the structure plus Laplace's log evidence, summed over modes."""
        return self.prior + float(logsumexp([mode.evidence for mode in self.modes]))


@dataclass(frozen=True, eq=False)
class Branch:
    """A structure with its posterior, its probability, and the draws that it contributes."""

    parts: tuple[SpectralLikelihood, ...]
    inference: Inference
    probability: float
    draws: FloatArray


def sea_mode(part: SpectralLikelihood, u: FloatArray, start: FloatArray | None = None, steps: int = 15) -> Peak:
    """Return the most probable sea and noise with the body held at u, or what some scoring steps come to."""
    target = Target(0, [FixedBody(part, u)], lambda rows: np.ones(rows.shape[0], dtype=bool))
    return find_peak(target, np.zeros(part.size) if start is None else start, steps, rough=True)


def structures(study: Study, parts: Sequence[SpectralLikelihood], others: Sequence[Likelihood],
               hopeless: float = 6.0) -> list[Structure]:
    """Return the structures of the seas that Laplace's evidence leaves room for, the most probable first.

    From one system in every sea each sea is tried in each other family, one after the other; what is more probable is
    kept, and what remains in the race is the best structure and those that differ from it in one sea. A family whose
    climb reaches no mode is left out.

    Parameters
    ----------
    hopeless : float
        Log odds by Laplace's evidence below which a structure is not drawn from.
    """
    seas = [sea_mode(part, np.zeros(study.n_u)).phi for part in parts]
    rest = np.zeros(sum(part.size for part in others))
    first = find_peak(study.target([*parts, *others]), np.concatenate([np.zeros(study.n_u), *seas, rest]))
    best = Structure(tuple(parts), (first,))
    tried = [best]
    for i, idle in enumerate(seas):
        # The ratio of several motions tells of the body in any sea: there a free one is alternative enough.
        for family in list(PRIOR)[1:] if parts[i].channels.count == 1 else ("free",):
            other = _with_family(study, best, i, others, family, idle, hopeless)
            if other is not None:
                tried.append(other)
        best = max(tried, key=lambda item: item.evidence)
    tried.sort(key=lambda item: -item.evidence)
    return [item for item in tried if item.evidence > best.evidence - hopeless]


def _with_family(study: Study, known: Structure, number: int, others: Sequence[Likelihood], family: str,
                 idle: FloatArray, hopeless: float) -> Structure | None:
    """Return the structure with another family in one sea; None if no mode is reached.

    The climbs start from the body of the best mode and from the prior's: a body that has made up for what a sea lacks
    is no good place to look for it. `idle` is the sea (of one system) and the noise for the prior's body.
    """
    n, part, mode = study.n_u, known.parts[number], known.modes[0].phi
    new = replace(part, sea=replace(part.sea, family=family))
    parts = (*known.parts[:number], new, *known.parts[number + 1:])
    offset = n + sum(item.size for item in known.parts[:number])
    target, modes = study.target([*parts, *others]), list[Peak]()
    climbs = []
    for u in (np.zeros(n), mode[:n]):
        for start in _starts(new, idle):
            try:
                climbs.append((u, sea_mode(new, u, start)))
            except SolverError:
                continue
    climbs.sort(key=lambda item: -(item[1].value - 0.5 * float(item[0] @ item[0])))
    here = slice(offset, offset + part.size)
    floor = sea_mode(part, mode[:n], mode[here]).evidence - 2.0 * hopeless
    for u, sea in climbs[:2]:
        if sea.evidence - 0.5 * float(u @ u) < floor - 0.5 * float(mode[:n] @ mode[:n]):
            continue
        try:
            modes.append(find_peak(target, np.concatenate([u, mode[n:offset], sea.phi, mode[offset + part.size:]])))
        except SolverError:
            continue
    return Structure(parts, _distinct(modes)) if modes else None


def _starts(part: SpectralLikelihood, idle: FloatArray, periods: Sequence[float] = (0.65, 1.5),
            energy: float = 0.5) -> Iterator[FloatArray]:
    """Yield starts in a family: a second system on either side of the first; no lumps; a level without departure."""
    if part.sea.family == "two systems":
        for period in periods:
            yield part.sea.with_second(idle, energy, period)
    elif part.sea.family == "lumpy":
        after = part.size - part.sea.size
        yield np.r_[idle[:-after], np.zeros(part.sea.lumps.size), idle[-after:]]
    else:
        yield np.zeros(part.size)


def mixed(study: Study, race: Sequence[Structure], others: Sequence[Likelihood]) -> list[Branch]:
    """Draw from every structure and return them by their evidence, the most probable first.

    Evidence is that of the passive part where enough of the whole posterior is passive.
    """
    found = [study.drawn(study.target([*item.parts, *others]), item.modes) for item in race]
    logs = np.array([item.evidence for item in race])
    weights = np.exp(logs - logsumexp(logs))
    share = np.array([one.share for one in found])
    if float(weights @ share) > LEAST:
        weights = np.where(share > LEAST, weights * share, 0.0)
        weights = weights / weights.sum()
    counts = np.diff(np.r_[0, np.round(np.cumsum(weights) * study.draws).astype(int)])
    branches = [Branch(item.parts, one, float(weight), one.draws[study.rng.permutation(one.draws.shape[0])[:count]])
                for item, one, weight, count in zip(race, found, weights, counts) if count]
    return sorted(branches, key=lambda branch: -branch.probability)


def family_probabilities(branches: Sequence[Branch], number: int) -> Mapping[str, float]:
    """Return the probability of each family for one sea."""
    out = dict.fromkeys(PRIOR, 0.0)
    for branch in branches:
        out[branch.parts[number].sea.family] += branch.probability
    return out


def _distinct(modes: Sequence[Peak], same: float = 0.5, hopeless: float = 6.0) -> tuple[Peak, ...]:
    """Return modes that differ (in posterior standard deviations) and are not hopeless, the most probable first."""
    kept: list[Peak] = []
    for mode in sorted(modes, key=lambda peak: -peak.evidence):
        near = any((mode.phi - other.phi) @ other.fisher @ (mode.phi - other.phi) < same**2 for other in kept)
        if not near and (not kept or mode.evidence > kept[0].evidence - hopeless):
            kept.append(mode)
    return tuple(kept)
