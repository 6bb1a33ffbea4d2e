"""The budget of a gap on records that no fit has seen: recalibration, each effect, offset, unexplained, noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import factorial
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.diagnosis.prediction import Error, energy
from radiation_ss.methods import Brief

DRAWS = 400  # of the bootstrap
DRIFT = "slow_drift"


@dataclass(frozen=True)
class Row:
    """One cause.

    Parameters
    ----------
    cause : str
        "recalibration", an effect's name, "offset" (the mean error of each record), "unexplained" or "noise".
    dof : str
    share : float
        Of the gap's energy; all rows add up to one.
    interval : (float, float)
        95 %.
    inclusion : float or None
    parameters : mapping of str to (value, standard deviation)
    law : str
        The curve that it is a term of: "damping" or "stiffness"; empty where it is none.
    """

    cause: str
    dof: str
    share: float
    interval: tuple[float, float]
    inclusion: float | None = None
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    law: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"cause": self.cause, "dof": self.dof, "share": self.share, "interval": list(self.interval),
                "inclusion": self.inclusion, "parameters": {k: list(v) for k, v in self.parameters.items()}}


@dataclass(frozen=True, eq=False, repr=False)
class Budget(Brief):
    """Where the gap goes.

    Parameters
    ----------
    unseen : tuple of str
        Records that it was measured on.
    before, after, noise : float
        Gap of the model as given, of the corrected one, and what the sensors' noise makes of the latter.
    rows : tuple of Row
    by_record : mapping of (record, dof) to mapping of cause to share
        The same for each record and degree of freedom.
    beyond : float
        Gap beyond the most that noise may make in each record and degree of freedom, of the model as given or of the
        corrected one, whichever has less.
    grown : float
        Share of the gap's energy by which the causes surely make it larger, with 97.5 % probability.
    constant : mapping of dof to float
        Gap by errors that are constant in each record, beyond the most that noise may make.
    """

    unseen: tuple[str, ...]
    before: float
    after: float
    noise: float
    rows: tuple[Row, ...]
    by_record: Mapping[tuple[str, str], Mapping[str, float]] = field(default_factory=dict)
    beyond: float = 0.0
    grown: float = 0.0
    constant: Mapping[str, float] = field(default_factory=dict)

    @property
    def unexplained(self) -> float:
        """Share of the gap's energy that nothing explains: without noise, and without zeros that are off."""
        return float(np.clip(sum(row.share for row in self.rows if row.cause == "unexplained"), 0.0, 1.0))

    @property
    def slow(self) -> float:
        """Share of the gap's energy that slow forces explain."""
        return sum(row.share for row in self.rows if row.cause == DRIFT)

    def closed_by(self, cause: str, dof: str) -> float:
        """Return how much of the motion a cause accounts for."""
        share = sum(row.share for row in self.rows if (row.cause, row.dof) == (cause, dof))
        return self.before * float(np.sqrt(max(share, 0.0)))

    @property
    def worse(self) -> bool:
        """Whether all effects together surely make more of the gap than the retuned model leaves."""
        return sum(row.interval[1] for row in self.rows if row.inclusion is not None) < 0.0

    @property
    def against(self) -> float:
        """Share of the gap's energy that several effects surely make against each other.

        Terms of one curve of restoring or of damping are one law: less of the one goes with more of the other.
        """
        laws: dict[tuple[str, str], list[Row]] = {}
        for row in self.rows:
            if row.inclusion is not None:
                laws.setdefault((row.law or row.cause, row.dof), []).append(row)
        sure = [rows for rows in laws.values() if len(rows) > 1 or rows[0].interval[1] < 0.0]
        return sum(max(-sum(row.share for row in rows), 0.0) for rows in sure) if len(laws) > 1 else 0.0

    def __str__(self) -> str:
        places = [f"{row.cause} on {row.dof}" if row.dof else row.cause for row in self.rows]
        return "\n".join([
            f"Gap on {', '.join(self.unseen) or 'no record'}: {self.before:.2%} of the motion as given, "
            f"{self.after:.2%} corrected, {self.noise:.2%} noise; shares of its energy, with 95 % intervals:",
            *(f"  {place:{max(map(len, places))}s} {row.share:7.1%}  ({row.interval[0]:.1%} to {row.interval[1]:.1%})"
              for place, row in zip(places, self.rows))])

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"unseen": list(self.unseen), "before": self.before, "after": self.after, "noise": self.noise,
                "rows": [row.to_dict() for row in self.rows],
                "by_record": [{"record": r, "dof": d, "shares": dict(s)} for (r, d), s in self.by_record.items()]}


Predict = Callable[[frozenset[int]], list[Error]]


def shapley(count: int, value: Callable[[frozenset[int]], FloatArray]) -> FloatArray:
    """Return each part's mean decrease of an energy over all orders of adding, shape (count, ...) (Shapley 1953).

    Beyond five parts only orders that begin or end with the part are taken, with equal weight.
    """
    known: dict[frozenset[int], FloatArray] = {}

    def of(parts: frozenset[int]) -> FloatArray:
        if parts not in known:
            known[parts] = value(parts)
        return known[parts]

    whole, found = frozenset(range(count)), []
    for k in range(count):
        rest = sorted(whole - {k})
        if count > 5:
            found.append(0.5 * (of(frozenset()) - of(frozenset({k})) + of(whole - {k}) - of(whole)))
            continue
        found.append(np.sum([factorial(size) * factorial(count - size - 1) / factorial(count)
                             * (of(frozenset(s)) - of(frozenset(s) | {k}))
                             for size in range(count) for s in combinations(rest, size)], axis=0))
    shares = np.array(found)
    if count > 5:
        total, summed = of(frozenset()) - of(whole), shares.sum(axis=0)
        shares = shares + (total - summed) / count
    return shares


def budget(causes: Sequence[Row], predict: Predict, noise: FloatArray, dofs: Sequence[str],
           block: float, rng: np.random.Generator, sizes: Mapping[tuple[str, int], float] | None = None,
           last: Sequence[Row] = ()) -> Budget:
    """Return the budget of a gap.

    Parameters
    ----------
    causes : sequence of Row
        Recalibration and effects, shares not filled in.
    predict : callable
        Errors on the unseen records with a set of causes put right.
    noise : array (errors, 2)
        Standard deviation of the noise in each error of `predict`: as it is expected, and at most.
    dofs : sequence of str
    block : float
        Length of a block for the intervals [s].
    rng : numpy.random.Generator
    sizes : mapping of (record, position of the degree of freedom) to float, optional
        Mean square that an error is compared with, where that is not the one of the signal itself.
    last : sequence of Row
        Causes that explain what the others leave and predict nothing, one after the other; `predict` numbers them on.
    """
    first = predict(frozenset())
    scale = energy(first, sizes) / np.array([max(float(np.sum(e.error**2)), 1e-300) for e in first])
    index = [((e.time - e.time[0]) / block).astype(int) for e in first]

    def blocks_of(parts: frozenset[int]) -> FloatArray:
        errors = first if not parts else predict(parts)
        return np.concatenate([s * np.bincount(k, e.error**2) for s, k, e in zip(scale, index, errors)])

    size, most = np.array([s * sd**2 * k.size for s, k, sd in zip(scale, index, noise)]).T
    ends = np.cumsum([0] + [k.max() + 1 for k in index])
    start, end = blocks_of(frozenset()), blocks_of(frozenset(range(len(causes))))
    parts = shapley(len(causes), blocks_of) if causes else np.zeros((0, start.size))
    chain = [end, *(blocks_of(frozenset(range(len(causes) + k + 1))) for k in range(len(last)))]
    parts = np.concatenate([parts, -np.diff(chain, axis=0)])
    steady = np.concatenate([s * e.error.mean() ** 2 * np.bincount(k)
                             for s, k, e in zip(scale, index, predict(frozenset(range(len(causes) + len(last)))))])
    steady = np.minimum(steady, chain[-1])
    left = chain[-1] - steady
    # Noise goes along with what is left in each block: block by block it varies, and may grow with the motion.
    quiet = np.concatenate([left[i:j] * min(1.0, total / max(left[i:j].sum(), 1e-300))
                            for i, j, total in zip(ends[:-1], ends[1:], size)])
    table = np.concatenate([parts, steady[None], (left - quiet)[None], quiet[None]])
    total = max(float(start.sum()), 1e-300)
    picks = rng.integers(0, start.size, (DRAWS, start.size))
    drawn = table[:, picks].sum(axis=2) / np.maximum(start[picks].sum(axis=1), 1e-300)
    low, high = np.quantile(drawn, [0.025, 0.975], axis=1)
    named = [*causes, *last, *(Row(c, "", 0.0, (0.0, 0.0)) for c in ("offset", "unexplained", "noise"))]
    rest = np.add.reduceat([start, end], ends[:-1], axis=1).min(axis=0)
    means = np.maximum(np.add.reduceat(steady, ends[:-1]) - most, 0.0)
    constant = {dofs[i]: float(np.sqrt(means[[e.dof == i for e in first]].sum())) for i in {e.dof for e in first}}
    rows = tuple(replace(r, share=float(table[k].sum() / total), interval=(float(low[k]), float(high[k])))
                 for k, r in enumerate(named))
    by_record = {(e.record, dofs[e.dof]): {f"{r.cause} {r.dof}".strip(): float(
        table[j, i:i2].sum() / max(start[i:i2].sum(), 1e-300)) for j, r in enumerate(named)}
        for e, i, i2 in zip(first, ends[:-1], ends[1:])}
    return Budget(tuple(dict.fromkeys(e.record for e in first)), float(np.sqrt(start.sum())),
                  float(np.sqrt(end.sum())), float(np.sqrt(quiet.sum())), rows, by_record,
                  float(np.sqrt(np.maximum(rest - most, 0.0).sum())),
                  max(float(np.quantile(-drawn[:len(parts)].sum(axis=0), 0.025)), 0.0), constant)
