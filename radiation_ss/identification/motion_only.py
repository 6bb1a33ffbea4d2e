"""The method "spectral", motion only: families of seas compete, each climbed to its modes, weighed and mixed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.estimate import Band
from radiation_ss.identification.channels import known_force, motion_channels, thinned
from radiation_ss.identification.force import compare_forces, estimate_force
from radiation_ss.identification.laws import law_warnings, least_of, score_laws
from radiation_ss.identification.motion_likelihood import MotionLikelihood, motion_likelihoods
from radiation_ss.identification.sea import families as sea_families
from radiation_ss.identification.spectral import SpectralLikelihood, spectral_likelihood
from radiation_ss.identification.study import Findings, ForceEstimate, Study, cautious, with_body_held
from radiation_ss.inference.laplace import Climb, Likelihood, Peak, Target, find_peak, sample

LEFT_IN = "motion alone leaves it in A and B, and its size is the first step from a linear fit"
STEPS = 15  # At most, of a climb of the sea alone, with the body held
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
    branches = mixed(study, structures(study, parts, decays), decays)
    sea: dict[str, Any] = {}
    force: dict[str, ForceEstimate] = {}
    changes = {}
    for i, (record, part) in enumerate(zip(runs, parts)):
        name, seas = record.name, [branch.sea(i) for branch in branches]
        families = dict.fromkeys(sea_families(), 0.0)
        for branch, (own, _) in zip(branches, seas):
            families[own.sea.name] += branch.probability
        sea[name] = describe_sea(seas, families)
        free = sum(share for family, share in families.items() if "free" in family or "lumpy" in family)
        if free >= 0.5:
            warnings.append(f"record {name}: the sea is not JONSWAP-like (free with a probability of {free:.0%}); "
                            "motion alone says little of the body in such a sea, and the answer stays near the model")
        force[name] = estimate_force([(own, branch.draws[:, :study.n_u], v)
                                      for branch, (own, v) in zip(branches, seas)])
        idle = idle_sea(study, part)[None]
        changes[name] = compare_forces(study, record, force[name], estimate_force(
            [(part, np.zeros((1, study.n_u)), idle)]))
    best = branches[0]
    if best.structure.apart:
        warnings.append("with a sea of one system in every record no body that is near the model explains the motion: "
                        "the seas repeat or have lines, or the body has what the model lacks (drag), which goes into A "
                        "and B here; the bands do not hold that: run diagnose on records with a known force")
    tests = score_laws(best.target, best.structure.modes[0], decays)
    asked = [name for name, row in tests.items()
             if row["p"] < study.rules.nonlinear / len(tests) and row["estimate"] > least_of(study, name)]
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


def climb(target: Target, start: FloatArray, n: int, rough: bool = False, *, scoring: int = 10, ridge: int = 60,
          slope: float = 0.3) -> Peak:
    """Return the mode of body and sea of n degrees of freedom above a start; `rough`: what all steps come to.

    With several degrees of freedom: `scoring` steps, then at most `ridge` of a quasi-Newton search, to this slope a
    posterior deviation: Fisher's information says little of a ridge that is long, sharp and bent.
    """
    if n == 1:
        return find_peak(target, start, Climb(rough=rough))
    near = find_peak(target, start, Climb(scoring, rough=True))
    root = np.linalg.cholesky(np.linalg.inv(near.fisher))

    def below(x: FloatArray) -> tuple[float, FloatArray]:
        phi = near.phi + root @ x
        if not np.isfinite(target.value(phi)):
            return -near.value + 1e6, x
        value, gradient, _ = target.local(phi)
        return -value, -root.T @ gradient

    found = minimize(below, np.zeros(near.phi.size), jac=True, method="BFGS",
                     options={"maxiter": ridge, "gtol": slope})
    phi = near.phi + root @ found.x
    value, _, fisher = target.local(phi)
    return Peak(phi, fisher, value)


@dataclass(frozen=True, eq=False)
class Structure:
    """One choice of a family for every sea."""

    parts: tuple[SpectralLikelihood, ...]
    modes: tuple[Peak, ...]  # Distinct modes of the posterior of body and all seas, the most probable first
    # Whether each sea's family was chosen from its record alone, because one system in every sea did not do
    apart: bool = False

    @property
    def evidence(self) -> float:
        """Log prior probability of the structure plus Laplace's log evidence, summed over modes."""
        prior = sum(np.log(part.sea.family.probability) for part in self.parts)
        return float(prior + logsumexp([mode.evidence for mode in self.modes]))


@dataclass(frozen=True, eq=False)
class Branch:
    """A structure with its target, its probability, the share of it that is passive, and the draws it contributes."""

    structure: Structure
    target: Target
    probability: float
    share: float
    draws: FloatArray

    def sea(self, number: int) -> tuple[SpectralLikelihood, FloatArray]:
        """Return a record's likelihood and the draws of its sea and noise."""
        part = self.structure.parts[number]
        at = next(at for own, at in zip(self.target.likelihoods, self.target.places) if own is part)
        return part, self.draws[:, at]


def idle_sea(study: Study, part: SpectralLikelihood) -> FloatArray:
    """Return the most probable sea and noise for the prior's body."""
    return with_body_held(part, np.zeros(study.n_u), np.zeros(part.size), STEPS).phi


def structures(study: Study, parts: Sequence[SpectralLikelihood], others: Sequence[Likelihood],
               far: float = 8.0) -> list[Structure]:
    """Return the structures of the seas that Laplace's evidence leaves room for, the most probable first.

    From one system in every sea each sea is tried in each other family, one after the other; what is more probable is
    kept, and what remains in the race is the best structure and those that differ from it in one sea. A family whose
    climb reaches no mode is left out; where that is one system in every sea, or its mode is `far` prior standard
    deviations away, each has the family of its own record.
    """
    seas = [idle_sea(study, part) for part in parts]
    none = None
    try:
        best = _climbed(study, parts, others, seas)
        tried = [best]
    except SolverError as error:
        if len(parts) > 1:
            return [_each_its_own(study, parts, others)]
        none, tried = error, []
        best = _climbed(study, parts, others, seas, rough=True)  # a start for other families
    if len(parts) > 1 and np.abs(best.modes[0].phi[:study.n_u]).max(initial=0.0) > far:
        return [_each_its_own(study, parts, others)]
    for i, idle in enumerate(seas):
        for name in parts[i].families[1:]:
            other = _with_family(study, best, i, others, name, idle)
            if other is not None:
                tried.append(other)
        best = max(tried or [best], key=lambda item: item.evidence)
    if none and not tried:
        raise none
    tried.sort(key=lambda item: -item.evidence)
    return [item for item in tried if item.evidence > best.evidence - study.rules.hopeless]


def _climbed(study: Study, parts: Sequence[SpectralLikelihood], others: Sequence[Likelihood],
             seas: Sequence[FloatArray], rough: bool = False) -> Structure:
    """Return the structure of these families with its mode from the prior's body and some seas."""
    target = study.target([*parts, *others])
    start = np.concatenate([np.zeros(study.n_u), *seas])
    start = np.r_[start, np.zeros(target.size - start.size)]
    return Structure(tuple(parts), (climb(target, start, study.model.n, rough),))


def _each_its_own(study: Study, parts: Sequence[SpectralLikelihood], others: Sequence[Likelihood]) -> Structure:
    """Return the structure in which each sea has the family that its record alone makes most probable."""
    alone = [structures(study, [part], others)[0] for part in parts]
    at = slice(study.n_u, None)
    seas = [best.modes[0].phi[at][:best.parts[0].size] for best in alone]
    found = _climbed(study, [best.parts[0] for best in alone], others, seas)
    return replace(found, apart=True)


def _with_family(study: Study, known: Structure, number: int, others: Sequence[Likelihood], name: str,
                 idle: FloatArray, same: float = 0.5) -> Structure | None:
    """Return the structure with another family in one sea; None if no mode is reached.

    Climbs start from the prior's body and, with one degree of freedom, from the best mode's, which may have made up for
    what the sea lacks. Modes less than `same` posterior standard deviations apart are one. `idle`: the sea (of one
    system) and the noise for the prior's body.
    """
    n, part, mode = study.n_u, known.parts[number], known.modes[0].phi
    new = replace(part, sea=replace(part.sea, name=name))
    parts = (*known.parts[:number], new, *known.parts[number + 1:])
    at = n + sum(item.size for item in known.parts[:number])
    target, modes = study.target([*parts, *others]), list[Peak]()
    bodies = [np.zeros(n), mode[:n]][:2 if study.model.n == 1 else 1]
    for u, start in product(bodies, _starts(new, idle)):
        try:
            sea = with_body_held(new, u, start, STEPS)
            peak = climb(target, np.r_[u, mode[n:at], sea.phi, mode[at + part.size:]], study.model.n)
        except SolverError:
            continue
        if not any(peak.near(other, same) for other in modes):
            modes.append(peak)
    modes.sort(key=lambda peak: -peak.evidence)
    return Structure(parts, tuple(mode for mode in modes if mode.evidence > modes[0].evidence - study.rules.hopeless)
                     ) if modes else None


def _starts(part: SpectralLikelihood, idle: FloatArray, periods: tuple[float, float] = (0.65, 1.5),
            energy: float = 0.5) -> Iterator[FloatArray]:
    """Yield starts in a family: the idle sea without departure; with a second system on either side of the first.

    `periods`, `energy`: of the second over the first.
    """
    sea, noise = part.sea, idle[idle.size - part.size + part.sea.size:]
    rest = np.r_[np.zeros(sea.size - sea.family.shape), noise]
    if sea.family.systems == 0:
        yield np.zeros(part.size)
    elif sea.family.systems == 1:
        yield np.r_[idle[:3], rest]
    else:
        for period in periods:
            yield np.r_[sea.with_second(idle[:3], energy, period), rest]


def mixed(study: Study, found: Sequence[Structure], others: Sequence[Likelihood]) -> list[Branch]:
    """Draw from every structure and return them by their evidence, of the passive part where that is large enough."""
    least = study.rules.least_passive
    targets = [study.target([*item.parts, *others]) for item in found]
    drawn = [sample(target, item.modes, study.rng, study.rules.draws, least) for item, target in zip(found, targets)]
    logs, share = np.array([item.evidence for item in found]), np.array([share for _, share in drawn])
    weights = np.exp(logs - logsumexp(logs))
    if float(weights @ share) > least:
        weights = np.where(share > least, weights * share, 0.0)
        weights = weights / weights.sum()
    counts = np.diff(np.r_[0, np.round(np.cumsum(weights) * study.rules.draws).astype(int)])
    branches = [Branch(item, target, float(weight), one, rows[study.rng.permutation(rows.shape[0])[:count]])
                for item, target, (rows, one), weight, count in zip(found, targets, drawn, weights, counts) if count]
    return sorted(branches, key=lambda branch: -branch.probability)
