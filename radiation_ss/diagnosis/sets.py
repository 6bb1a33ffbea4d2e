"""Sets of effects by name, how probable they are, and what is said of several."""

from collections.abc import Mapping, Sequence

import numpy as np

from radiation_ss.effects import library
from radiation_ss.inference.candidates import Key, Keys
from radiation_ss.inference.search import Found

Names = tuple[str, ...]
"""A set of effects, each by its label."""


def zeros() -> list[str]:
    """Return the effects by which a zero is off in all records alike: of a force, or of a sensor."""
    return sorted(e.name for e in library().values() if e.family == "offset" and not e.per_record)


def with_zeros(dofs: Sequence[str], known: Names, off: Sequence[str]) -> tuple[Names, ...]:
    """Return the sets of names beside which zeros are off, each by one of the effects that make it so."""
    return tuple((*known, *(label(dofs, zero, dof) for dof in off)) for zero in zeros()) if off else ()


def label(dofs: Sequence[str], name: str, where: str) -> str:
    """Return an effect with its place, which is not said of a body with one motion."""
    return f"{name} on {where}" if where and len(dofs) > 1 else name


def places(dof: str) -> tuple[str, str]:
    """Take a place apart."""
    one, _, other = dof.partition(",")
    return one, other


def joint(found: Found, keys: Sequence[Key]) -> float:
    """Return the probability that all of some effects are there."""
    wanted = set(keys)
    return float(sum(p for c, p in zip(found.candidates, found.probabilities()) if wanted <= c.keys))


def unrivalled(found: Found, key: Key, sure: float) -> bool:
    """Whether no other effect in the place of one makes a set that is nearly as likely."""
    best = max((c for c in found.candidates if key in c.keys), key=lambda c: c.log_probability)
    rest = best.keys - {key}
    others = [c.log_probability for c in found.candidates
              if len(c.keys) == len(best.keys) and rest < c.keys != best.keys]
    if len(instead(found, best.keys, key)) > 1:
        return False
    return best.log_probability - max(others, default=-np.inf) >= np.log(sure / (1.0 - sure))


def told_sets(found: Found, kept: Keys) -> dict[Names, float]:
    """Return sets of names with their probabilities, the first candidate's first.

    Untold are effects of the first candidate that are not `kept`, and zeros that are off where none of `kept` is: they
    are no other answer.
    """
    shifting = {e.name for e in library().values() if e.family == "offset"}
    small, zeroed = found.candidates[0].keys - kept, {dof for name, dof, _ in kept if name in shifting}
    chances: dict[Names, float] = {}
    for candidate, p in zip(found.candidates, found.probabilities()):
        told = frozenset(k for k in candidate.keys - small if k[0] not in shifting or k[1] in zeroed)
        alike = [told]
        for key in told:
            alike = [keys for one in alike for keys in instead(found, one, key)]
        for keys in alike:
            labels = tuple(sorted(label(found.problem.model.dofs, a, f"{b},{c}" if c else b) for a, b, c in keys))
            chances[labels] = chances.get(labels, 0.0) + float(p) / len(alike)
    return chances


def instead(found: Found, keys: Keys, key: Key) -> list[Keys]:
    """Return a set of effects, and those with what is the same as one of them in static tests alone.

    Of a motion that the model restores, by itself alone, they give the ratio of load and place: stiffness and gains are
    one factor.
    """
    problem, dofs = found.problem, found.problem.model.dofs
    names = {"linear_stiffness", "excitation_gain", "sensor_gain"}
    if key[0] not in names or key in found.null.keys or any(run.record.kind != "static" for run in problem.runs):
        return [keys]
    same = {term.key for term in found.terms if term.key[0] in names and term.key[1:] == key[1:]} - {key}
    i = dofs.index(key[1])
    if same & keys or list(np.flatnonzero(problem.model.C[i])) != [i]:
        return [keys]
    return [keys, *(keys - {key} | {one} for one in sorted(same))]


def within(chances: Mapping[Names, float], names: Names) -> float:
    """Return the probability that no effect but some is there."""
    return sum(p for labels, p in chances.items() if set(labels) <= set(names))


def likely_sets(chances: Mapping[Names, float], least: float, most: int) -> tuple[Names, ...]:
    """Return sets of names, the first one first, others if `least` times as probable, `most` at most."""
    first, *others = chances
    others = [labels for labels in others if chances[labels] >= least * chances[first]]
    return first, *sorted(others, key=lambda labels: -chances[labels])[: most - 1]


def less_sure(named: set[str], sets: Sequence[Names], most: int = 2) -> str:
    """Return what is said of sets beside the named one, `most` in full: a zero that is off, less likely effects."""
    others = [s for s in sets if set(s) != named]
    more = [" + ".join(part for part in s if part not in named) for s in others]
    if len(others) == len(sets) and all(part.partition(" on ")[0] in zeros() for part in more):
        return f"beside it a zero is off: {' or '.join(more)}"
    told = [f"{rest} beside it" if named < set(s) else " + ".join(s) or "recalibration alone"
            for s, rest in zip(others, more)]
    left = len(told) - most
    told = [*told[:most], f"{left} more set{'s' * (left > 1)}"] if left > 0 else told
    return f"less sure: {' or '.join(told)}"


def alternatives(sets: Sequence[Names]) -> str:
    """Return what all sets have, and what these records do not tell apart."""
    if len(sets) == 1:
        return f"Likely {' and '.join(sets[0])}"
    common = [label for label in sets[0] if len(sets) > 1 and all(label in s for s in sets)]
    rest = [" + ".join(label for label in s if label not in common) for s in sets]
    if not common:
        return "These records do not tell apart: " + " or ".join(r or "recalibration alone" for r in rest)
    return (f"{' and '.join(common)} in every set that may hold; these records do not tell apart what goes with it: "
            + " or ".join(r or "nothing more" for r in rest))
