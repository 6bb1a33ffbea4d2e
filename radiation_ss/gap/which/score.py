"""Score test: how much each effect of the library would gain, from derivatives at the null fit alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.fitting import Fit
from radiation_ss.gap.posterior.problem import Problem, whitened
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.simulation.rollout import Path

STILL, MOVING = 32, 8  # terms of one model, without and with states of their own; keeps its functions small


@dataclass(frozen=True, eq=False)
class Score:
    """One term's promise.

    Parameters
    ----------
    term : Term
    gain : float
        Log posterior that its strengths would gain, to first order.
    strength : ndarray
        Where they would go, in prior standard deviations, in the order of `term.strengths` (and records).
    columns : ndarray, shape (nk, ns)
        Whitened derivatives of the strengths with the null's own directions projected out.
    gradient : ndarray, shape (ns,)
    information : ndarray, shape (ns, ns)
    slopes : tuple of ndarray, shape (nk, ns)
        Derivatives of each channel's prediction by the strengths, as they are.
    follows : ndarray, shape (nq, ns)
        How the optimum of all that the null has free moves with the strengths, to first order.
    """

    term: Term
    gain: float
    strength: FloatArray
    columns: FloatArray
    gradient: FloatArray
    information: FloatArray
    slopes: tuple[FloatArray, ...]
    follows: FloatArray


def scores(null: Fit, terms: list[Term]) -> list[Score]:
    """Return the score of each term beside the null fit, best first."""
    r, J = null.whitened()
    inverse = null.covariance
    found: list[Score] = []
    for group in alike(terms):
        # With all strengths zero the motion is the null's; own states of effects make it longer, so they are run anew.
        moving = bool(group[0].active.effect.states)
        paths = None if moving else motion_of(null, null.problem.setting.fine_enough(group))
        found += scored_in_chunks(null, group, MOVING if moving else STILL, r, J, inverse, paths)
    return sorted(found, key=lambda item: -item.gain)


def alike(terms: Sequence[Term]) -> list[list[Term]]:
    """Return the terms in groups that need the same steps and have, or have not, states of their own."""
    groups: dict[tuple[int, bool], list[Term]] = {}
    for term in terms:
        groups.setdefault((term.active.effect.halvings, term.active.effect.states > 0), []).append(term)
    return list(groups.values())


def motion_of(null: Fit, setting: Setting) -> Sequence[Path]:
    """Return the motion of a fit in every record, in the steps of a setting that has the same records."""
    if setting is null.problem.setting:
        return null.point.paths
    problem = Problem(setting, null.problem.terms)
    return [problem.path(null.q, k) for k in range(len(setting.records))]


def scored_in_chunks(null: Fit, terms: Sequence[Term], size: int, r: FloatArray, J: FloatArray, inverse: FloatArray,
                     paths: Sequence[Path] | None) -> list[Score]:
    """Return the scores of terms, `size` of them at a time in one model."""
    found: list[Score] = []
    for at in range(0, len(terms), size):
        chunk = tuple(terms[at:at + size])
        problem = Problem(null.problem.setting.fine_enough(chunk), (*null.problem.terms, *chunk))
        places = [strength_columns(problem, len(null.problem.terms) + k, term) for k, term in enumerate(chunk)]
        q, flat = problem.extend(null.q, null.problem), [c for place in places for c in place]
        try:
            point = problem.at(q, only=flat, paths=paths)
        except SolverError:  # one of them has derivatives beyond all bounds: leave that one out
            found += scored_in_chunks(null, chunk, 1, r, J, inverse, paths) if len(chunk) > 1 else []
            continue
        _, all_columns = whitened(point, null.noise)
        assert all_columns is not None
        widths = [len(place) for place in places]
        found += score_all(chunk, widths, r, J, all_columns, inverse, null.q, point.slopes or ())
    return found


def strength_columns(problem: Problem, index: int, term: Term) -> list[int]:
    """Return the positions in q of a term's strengths."""
    k = len(problem.setting.nominal) + index
    return [c for j in term.strengths for c in problem.where[k, j]]


def score_all(terms: Sequence[Term], widths: Sequence[int], r: FloatArray, J: FloatArray, C: FloatArray,
              inverse: FloatArray, q: FloatArray, slopes: Sequence[FloatArray] = ()) -> list[Score]:
    """Return the score of each term; their whitened columns, `widths` of them, lie side by side in C (and slopes)."""
    follows = -inverse @ (J.T @ C)
    projected = C + J @ follows
    gradient = projected.T @ r + C.T @ (J @ (inverse @ q))
    ends = np.cumsum(widths)
    raw = [np.split(values, ends[:-1], axis=1) for values in slopes]
    return [score(term, columns, own, slope, tuple(values[k] for values in raw), follow)
            for k, (term, columns, own, slope, follow) in enumerate(zip(
                terms, np.split(projected, ends[:-1], axis=1), np.split(C, ends[:-1], axis=1),
                np.split(gradient, ends[:-1]), np.split(follows, ends[:-1], axis=1)))]


def score(term: Term, projected: FloatArray, C: FloatArray, gradient: FloatArray,
          slopes: tuple[FloatArray, ...], follows: FloatArray) -> Score:
    """Return the score of one term; a strength that would go the forbidden way gains nothing."""
    information = definite(C.T @ projected)
    strength = posterior_covariance(information)[0] @ gradient
    signs = np.array([term.signs[j] for j in term.strengths])
    per = C.shape[1] // len(signs)
    if np.any((np.repeat(signs, per) > 0) & (strength < 0.0)):
        return Score(term, 0.0, np.maximum(strength, 0.0), projected, gradient, information, slopes,
                     follows)
    return Score(term, 0.5 * float(gradient @ strength), strength, projected, gradient, information, slopes,
                     follows)


def definite(matrix: FloatArray) -> FloatArray:
    """Return a symmetric matrix without the negative eigenvalues that rounding gives to huge derivatives."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def posterior_covariance(information: FloatArray) -> tuple[FloatArray, float]:
    """Return (information + 1)^-1 and log det (information + 1); by eigenvalues, since derivatives may be huge."""
    values, vectors = np.linalg.eigh(information)
    values = 1.0 + np.maximum(values, 0.0)
    return np.asarray((vectors / values) @ vectors.T), float(np.sum(np.log(values)))


def shortlist(ranked: list[Score], length: int) -> list[Score]:
    """Return the best start of each of the best effects."""
    best: dict[tuple[str, str, str], Score] = {}
    for item in ranked:
        best.setdefault(item.term.key, item)
    return list(best.values())[:length]
