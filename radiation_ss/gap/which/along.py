"""Pairs of effects along the measured motion.

Beside a null that is far from what was measured the score test asks what an effect would do to the wrong motion. Along
the measured one all is linear in the strengths: with y measured and H the linear model,

    y = y_linear + J delta + sum_k theta_k H phi_k(y) + noise,

phi_k the force of effect k at unit strength, its own states driven by y (a series-parallel model, Narendra and
Parthasarathy 1990). So every pair from many shapes is weighed at once by least squares. It only tells from where to
start: fits and evidence are those of the full model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import cho_factor, cho_solve

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.fitting import Fit, fit_free_noise, residual_energy
from radiation_ss.gap.posterior.linear import frequencies, receptance
from radiation_ss.gap.posterior.measured import Measured, measured, path_along, states_along
from radiation_ss.gap.posterior.problem import Problem
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.gap.which.candidates import FAR
from radiation_ss.gap.which.scan import MANY, slopes
from radiation_ss.gap.which.score import strength_columns

BEST = 3  # pairs that are fitted
BLUR = 0.01  # of a channel's rms: what smoothing and noise of the motion leave in the forces along it


@dataclass(frozen=True, eq=False)
class Beginning:
    """A pair and where its fit starts.

    Parameters
    ----------
    terms : tuple of Term
    strengths : tuple of ndarray
        In prior standard deviations.
    others : ndarray
        Nominal numbers, starts and discrepancy beside it.
    gain : float
        Log posterior.
    """

    terms: tuple[Term, Term]
    strengths: tuple[FloatArray, FloatArray]
    others: FloatArray
    gain: float


def pairs_along(null: Fit, terms: Sequence[Term], floors: tuple[float, ...], known: Sequence[Fit]) -> list[Fit]:
    """Return full fits of the pairs that explain most along the measured motion; none if it is not measured whole."""
    found: list[Fit] = []
    for begin in beginnings(null.problem.setting, terms, floors)[:BEST]:
        problem = Problem(null.problem.setting.fine_enough(begin.terms), begin.terms)
        q = problem.extend(begin.others, Problem(null.problem.setting))
        for k, (term, strength) in enumerate(zip(begin.terms, begin.strengths)):
            q[strength_columns(problem, k, term)] = strength
        ceiling = min(residual_energy(one) for one in (*known, *found)) + FAR
        try:
            found.append(fit_free_noise(problem, floors, null.noise, q, ceiling=ceiling))
        except SolverError:
            continue
    return found


def beginnings(setting: Setting, terms: Sequence[Term], floors: tuple[float, ...]) -> list[Beginning]:
    """Return every pair of forces on single degrees of freedom, each from its best shapes, the best pair first."""
    motions = [measured(setting.finer.finer, r) for r in range(len(setting.records))]
    groups = [dense(group) for group in groups_of(terms)]
    if any(motion is None for motion in motions) or len(groups) < 2:
        return []
    known = [motion for motion in motions if motion is not None]
    bare = Problem(setting)
    zero = np.zeros(bare.size)
    coarse = [measured(setting, r) for r in range(len(setting.records))]
    along = [path_along(setting.model, motion) for motion in coarse if motion is not None]
    J = np.concatenate(bare.at(zero, paths=along).slopes or [])
    J = np.concatenate([J, setting.stacked], axis=1) if setting.unnamed else J
    channels = [c for item in setting.records for c in item.channels]
    weights = np.concatenate([np.full(c.time.size, 1.0 / max(floor, BLUR * float(np.sqrt(np.mean(c.value**2)))))
                              for c, floor in zip(channels, floors)])
    C = columns_along(setting.finer.finer, groups, known) * weights[:, None, None]
    r = np.concatenate(bare.at(zero, slopes=False).residuals)
    return weighed([term for group in groups for term in group], r * weights, J * weights[:, None], C)


def groups_of(terms: Sequence[Term]) -> list[list[Term]]:
    """Return the terms of each effect and place that is a force on one degree of freedom, the same in all records.

    Linear ones without states are left out: a force M a + C x + ... along the motion measured is that motion again.
    """
    groups: dict[tuple[str, str, str], list[Term]] = {}
    for term in terms:
        effect = term.active.effect
        plain = effect.linear and effect.states == 0
        if effect.force is not None and effect.scope == "dof" and not effect.per_record and not plain:
            groups.setdefault(term.key, []).append(term)
    return list(groups.values())


def dense(group: Sequence[Term]) -> list[Term]:
    """Return a term from every combination of more shapes than a fit starts from."""
    one, grids = group[0], []
    for j in range(len(one.spread)):
        starts = sorted({term.active.vector[j] for term in group})
        shape = one.spread[j] > 0.0 and j not in one.strengths
        grids.append(refined(starts) if shape else starts)
    return [replace(one, active=one.active.with_values(values)) for values in product(*grids)]


def refined(starts: list[float]) -> list[float]:
    """Return more values of a shape: around a single one, else between them and beyond by a third of their spacing."""
    if len(starts) == 1:
        return [0.6 * starts[0], 3.0 * starts[0]]
    parts = 2 if len(starts) > MANY else 3
    at = np.arange(-1, parts * (len(starts) - 1) + 2) / parts
    inner = np.interp(at, np.arange(len(starts)), starts)
    inner[0] -= (starts[1] - starts[0]) / parts
    inner[-1] += (starts[-1] - starts[-2]) / parts
    return [float(value) for value in inner]


def columns_along(setting: Setting, groups: Sequence[Sequence[Term]], motions: Sequence[Measured]) -> FloatArray:
    """Return the readings' derivatives by the strengths of each term, shape (nk, terms, most strengths)."""
    size = 2 * max(item.grid.size for item in setting.records)
    along = [{"time": m.time[::2], "h": setting.h, "x": m.x[::2], "v": m.v[::2],
              "padded": next_fast_len(size, real=True)} for m in motions]
    responses = [receptance(setting.model, frequencies(m["padded"], setting.h)) for m in along]
    width = max(len(group[0].strengths) for group in groups)
    found = []
    for group in groups:
        dof = setting.model.dofs.index(group[0].active.dof)
        if group[0].active.effect.states:
            for rows, motion in zip(along, motions):
                rows["own"] = dict(zip(group, states_along(group, motion, dof)))
        values = np.concatenate(slopes(setting, group, along, responses))
        table = np.zeros((values.shape[0], len(group), width))
        table[:, :, : len(group[0].strengths)] = values.reshape(values.shape[0], len(group), -1)
        found.append(table)
    return np.concatenate(found, axis=1)


def weighed(terms: Sequence[Term], r: FloatArray, J: FloatArray, C: FloatArray) -> list[Beginning]:
    """Return the best shapes of every pair of effects by least squares with standard normal priors, best pair first.

    A pair with a strength of the forbidden sign is left out.
    """
    nk, count, width = C.shape
    C = np.where(np.isfinite(C).all(axis=0), C, 0.0).reshape(nk, -1)
    root = cho_factor(J.T @ J + np.eye(J.shape[1]))
    follows = cho_solve(root, J.T @ C)
    information = (C.T @ C - (J.T @ C).T @ follows).reshape(count, width, count, width)
    gradient = (C.T @ r - follows.T @ (J.T @ r)).reshape(count, width)
    own = information[np.arange(count), :, np.arange(count)] + np.eye(width)
    limited = np.zeros((count, width), bool)
    for k, term in enumerate(terms):
        limited[k, : len(term.strengths)] = [term.signs[j] > 0 for j in term.strengths]
    best: dict[frozenset, tuple[float, int, int, FloatArray, FloatArray]] = {}
    for k, term in enumerate(terms):
        inverse = np.linalg.inv(own[k])
        across = information[k + 1:, :, k]
        rest = own[k + 1:] - across @ inverse @ across.transpose(0, 2, 1)
        right = gradient[k + 1:] - across @ (inverse @ gradient[k])
        theirs = np.linalg.solve(rest, right[..., None])[..., 0]
        mine = (gradient[k] - np.einsum("bij,bi->bj", across, theirs)) @ inverse
        gains = 0.5 * (gradient[k] @ inverse @ gradient[k] + np.sum(right * theirs, axis=1))
        gains[np.any(limited[k + 1:] & (theirs < 0.0), axis=1) | np.any(limited[k] & (mine < 0.0), axis=1)] = 0.0
        for b in np.argsort(gains)[::-1]:
            other = terms[k + 1 + b]
            key = frozenset((term.key, other.key))
            if other.key != term.key and gains[b] > best.get(key, (0.0,))[0]:
                best[key] = (float(gains[b]), k, k + 1 + int(b), mine[b], theirs[b])
    found = []
    for gain, one, two, mine, theirs in sorted(best.values(), key=lambda entry: -entry[0]):
        pair = (terms[one], terms[two])
        strengths = (mine[: len(pair[0].strengths)], theirs[: len(pair[1].strengths)])
        spent = sum(follows[:, width * k: width * k + values.size] @ values for k, values in zip((one, two), strengths))
        found.append(Beginning(pair, strengths, cho_solve(root, J.T @ r) - spent, gain))
    return found
