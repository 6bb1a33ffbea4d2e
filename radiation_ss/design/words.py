"""Why something cannot be seen or told apart whatever is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radiation_ss.design.information import Information
from radiation_ss.effects import Effect

# Standard deviations. 5 are 12 nats: enough to pay for a prior ten times as wide as the posterior and for the choice
# among dozens of candidates.
SHOWN, APART = 5.0, 5.0
TWINS = {
    frozenset({"constant_force", "sensor_bias"}):
        "a steady load shifts the mean by force / stiffness, a bias by itself; only a second displacement sensor, or "
        "reading the sensor with the body held at a known place, tells them apart",
    frozenset({"excitation_gain", "sensor_gain"}):
        "in a linear body twice the force and twice the reading are one, and a decay shows neither; an accelerometer "
        "or a second displacement sensor tells them apart",
    frozenset({"excitation_delay", "sensor_delay"}):
        "one late chain of force, body and sensor: an accelerometer, which reads by a chain of its own, tells where",
    frozenset({"linear_damping", "radiation_damping"}):
        "both take energy in proportion to velocity; only damping at several frequencies tells them apart",
    frozenset({"slow_drift", "sensor_bias"}): "a slow load that hardly changes in one record is a steady shift",
    frozenset({"slow_drift", "constant_force"}): "a slow load that hardly changes in one record is a steady one",
}


@dataclass(frozen=True)
class Unseen:
    """An effect that no test of the menu shows, and why."""

    effect: str
    why: str


@dataclass(frozen=True)
class Confound:
    """A pair that no set of the menu's tests tells apart."""

    pair: tuple[str, str]  # First the one of which less is left
    left: float  # Standard deviations that are left of the first beside the second
    exact: bool  # Whether the one makes the other's motion in every test, but for a thousandth
    why: str


def unseen(information: Information, whole: Sequence[int]) -> tuple[Unseen, ...]:
    """Return what the whole menu does not show."""
    size, exact = information.detectability(whole), information.exact(whole)
    found = []
    for label, value, alone in zip(information.labels, size, exact):
        if value < SHOWN:
            why = (f"retuning the model within its tolerances makes the same motion: {value:.1f} standard deviations, "
                   f"{alone:.0f} if the model's own numbers were exact" if alone >= SHOWN
                   else f"below the noise: {value:.1f} standard deviations")
            found.append(Unseen(label, why))
    return tuple(found)


def absent(forced: bool, places: int, effects: Sequence[Effect], information: Information) -> tuple[Unseen, ...]:
    """Return the effects that have no place in any test of the menu."""
    there = {term.active.name for term in information.terms}
    no_force = "no test of the menu has a known exciting force"
    no_waves = "no test of the menu has a wave elevation"
    other = "it makes no force in these tests"
    return tuple(Unseen(e.name, no_force if e.needs == "force" and not forced else
                        no_waves if e.needs == "waves" else other)
                 for e in effects if e.name not in there and (not e.coupled or places > 1))


def confounds(information: Information, whole: Sequence[int], same: float = 1e-3) -> tuple[Confound, ...]:
    """Return the pairs that the whole menu shows but does not tell apart, the closest first.

    Two make exactly the same motion if less than a share `same` of one is left beside the other.
    """
    size, left, terms = information.detectability(whole), information.separation(whole), information.terms
    found = []
    for i in range(size.size):
        for j in range(i):
            first, second = (i, j) if left[i, j] <= left[j, i] else (j, i)
            if min(size[i], size[j]) < SHOWN or left[first, second] >= APART:
                continue
            exact = bool(left[first, second] < same * size[first])
            known = TWINS.get(frozenset({terms[i].active.name, terms[j].active.name}), "")
            much = ("exactly the same motion in every test of the menu" if exact else
                    f"almost the same motion: of {size[first]:.1f} standard deviations {left[first, second]:.1f} "
                    "are left")
            found.append(Confound((information.labels[first], information.labels[second]),
                                  float(left[first, second]), exact, f"{much}; {known}" if known else much))
    return tuple(sorted(found, key=lambda c: c.left))


def counts(information: Information, chosen: Sequence[int]) -> tuple[int, int, float]:
    """Return effects seen, pairs told apart, and the same without a threshold: what makes greedy steps go on."""
    size, left = information.detectability(chosen), information.separation(chosen)
    pairs = np.minimum(left, left.T)[np.triu_indices(size.size, 1)]
    smooth = np.minimum(size / SHOWN, 1.0).sum() + np.minimum(pairs / APART, 1.0).sum()
    return int((size >= SHOWN).sum()), int((pairs >= APART).sum()), float(smooth)
