"""The null simulated and fitted anew: what evidence an effect claims where nothing is missing, without linearisation.

Slower than `null_law` by the time of a whole search for each replicate, so finished replicates are kept in a file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from radiation_ss.errors import SolverError
from radiation_ss.gap.posterior.setting import Setting, Term
from radiation_ss.gap.tolerance.tolerated import noisy_inputs, sized, unnamed
from radiation_ss.gap.which.null_law import QUANTILE, NullLaw
from radiation_ss.gap.which.search import Search, search

NOTHING = -1e3  # claim of a replicate whose fits fail


def refitted_law(found: Search, terms: Sequence[Term], count: int, seed: int, cache: Path | None,
                 progress: Callable[[str, float], None]) -> NullLaw:
    """Raise each threshold of the linearised law to what the largest claim of any effect reaches in refitted nulls.

    Parameters
    ----------
    found : Search
    terms : sequence of Term
        The library.
    count : int
        Replicates; 50 or more for a threshold that one null in fifty exceeds.
    seed : int
    cache : path, optional
        File that keeps finished replicates of these records, model and library; others in it are replaced.
    progress : callable (text, share)
    """
    key = fingerprint(found, terms, seed)
    claims = stored(cache, key)[:count]
    for k in range(len(claims), count):
        progress(f"null {k + 1} of {count}", k / count)
        claims.append(largest_claim(found, terms, np.random.default_rng([seed, k])))
        if cache is not None:
            cache.parent.mkdir(parents=True, exist_ok=True)
            cache.write_text(json.dumps({"key": key, "claims": claims}) + "\n", encoding="utf-8")
    level = float(np.quantile(claims, QUANTILE)) if claims else NOTHING
    evidence = {term.key: max(level, found.law.evidence.get(term.key, level)) for term in terms}
    return replace(found.law, evidence=evidence, refits=len(claims))


def largest_claim(found: Search, terms: Sequence[Term], rng: np.random.Generator) -> float:
    """Return the log evidence, prior odds included, of the best effect over none in one simulated null."""
    try:
        again = search(simulated(found, rng), list(terms), pairs=False)
    except SolverError:
        return NOTHING
    none = next(c.evidence for c in again.candidates if not c.terms)
    return max((c.evidence - none for c in again.candidates if c.terms), default=NOTHING)


def simulated(found: Search, rng: np.random.Generator) -> Setting:
    """Return the same tests of a body without any effect: numbers within tolerance, noise as large and as coloured."""
    null, noise = found.null, found.candidates[0].fit.noise
    setting = null.problem.setting
    q = null.q.copy()
    numbers, size = sized(len(setting.nominal), 1, rng)
    q[: len(setting.nominal)] = numbers[:, 0]
    q[q.size - setting.unnamed:] = 0.0
    point = null.problem.at(q, slopes=False)
    errors = [a * size + b for a, b in zip(unnamed(null, rng, 1), noisy_inputs(null, rng, 1))]
    records, k = [], 0
    for item in setting.records:
        channels = []
        for channel in item.channels:
            drawn = rng.standard_normal(channel.value.size + channel.value.size // 4)
            sound = noise.colour(k, drawn)[-channel.value.size:]
            clean = channel.value - point.residuals[k]
            channels.append(replace(channel, value=clean + errors[k][:, 0] + sound))
            k += 1
        records.append(replace(item, channels=tuple(channels)))
    return replace(setting, records=tuple(records), discrepancy=(), tolerated=0)


def fingerprint(found: Search, terms: Sequence[Term], seed: int) -> str:
    """Return a hash of all that the replicates depend on."""
    setting = found.null.problem.setting
    digest = hashlib.sha256(repr((seed, sorted(t.key for t in terms), sorted(setting.tolerance.items()))).encode())
    model = setting.model
    arrays = [model.M, model.A_inf, model.C, model.D, model.fit.a, model.fit.b, model.fit.c, found.null.q]
    arrays += [part for item in setting.records for c in item.channels for part in (c.time, c.value)]
    for values in arrays:
        digest.update(np.ascontiguousarray(np.round(values, 12)).tobytes())
    return digest.hexdigest()


def stored(cache: Path | None, key: str) -> list[float]:
    """Return the claims that a file keeps for the same records, model and library."""
    try:
        content = json.loads(cache.read_text(encoding="utf-8")) if cache is not None else {}
    except (OSError, ValueError):
        return []
    return [float(v) for v in content.get("claims", [])] if content.get("key") == key else []
