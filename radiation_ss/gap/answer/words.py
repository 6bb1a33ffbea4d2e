"""Sentences of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.page import with_error

if TYPE_CHECKING:
    from radiation_ss.gap.answer.diagnosis import Diagnosis, Named
    from radiation_ss.gap.how_far.ledger import HowFar


def unit_of(pattern: str, dof: str, other: str = "") -> str:
    """Return a parameter's unit: F and X replaced by a degree of freedom's N or N m, m or rad; Y by the other's."""
    if pattern == "1":
        return ""
    force, motion = (force_unit(dof), motion_unit(dof)) if dof else ("N", "m")
    if "F" in pattern and "/" in pattern and " " in force:
        force = f"({force})"
    return pattern.replace("F", force).replace("X", motion).replace("Y", motion_unit(other) if other else motion)


def described(effect: Named) -> str:
    """Return 'quadratic drag on Heave (coefficient 150.0 ± 3.1 N/(m/s)^2)', ± one standard deviation."""
    def words(parameters: Mapping[str, tuple[float, float]]) -> str:
        return ", ".join(f"{name.replace('_', ' ')} {with_error(v, s, effect.units.get(name, ''))}"
                         for name, (v, s) in parameters.items())

    values = "; ".join(f"in {record}: {words(own)}" for record, own in effect.by_record.items())
    values = values or words(effect.parameters)
    place = f" on {effect.dof}".replace(",", " with ") if effect.dof else ""
    return f"{effect.name.replace('_', ' ')}{place} ({values})"


def sentence(found: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    v, h = found.verdict, found.how_far
    if v.status == "no_gap" and found.settings.get("motion_only"):
        return ("Motion alone shows no missing effect: nothing nonlinear, no sensor that disagrees with another. "
                "Linear causes cannot be tested without a known force.")
    if v.status == "no_gap":
        told = (f" On unseen data the error is {h.gap_before:.1%} of the motion as given, {h.gap_retuned:.1%} retuned "
                f"(noise {h.noise_floor:.1%})." if h.noise_floor <= 0.5 else "")
        return ("No gap: the model, retuned within its tolerances, explains the records; no effect of the library is "
                "needed." + told)
    shrunk = (f" On unseen data the gap goes from {h.gap_before:.1%} to {h.gap_after:.1%} of the motion "
              f"(noise {h.noise_floor:.1%}).")
    if h.noise_floor > 0.5:
        shrunk = " The unseen data hold no motion above their noise, so they say nothing of the shrinkage."
    if found.settings.get("motion_only"):
        shrunk = (f" Outside the waves' own band {h.gap_before:.2%} of the motion becomes {h.gap_after:.2%}; with an "
                  "unknown force no more of the gap can be seen.")
    left = max((c.gap_after for c in found.which[:1]), default=0.0)
    if v.status != "unknown_effect" and not found.settings.get("motion_only") and left > max(0.02, 3.0 * h.noise_floor):
        shrunk += (f" {left:.1%} is left where it was fitted, well above the noise: something else is missing too, or "
                   "the law is another.")
    if v.status == "effect" and not found.settings.get("motion_only") and closed_by_retuning(h):
        shrunk += (" Retuning closes it as well, but only by moving the model's own numbers together farther than "
                   "their tolerances allow.")
    if v.status == "effect":
        return "The model lacks " + " and ".join(described(e) for e in v.effects) + "." + shrunk
    if v.status == "ambiguous":
        sets = "; ".join(" with ".join(n.replace("_", " ") for n in names) or "no effect, but the model's own numbers "
                         "farther off than their tolerances make likely" for names in v.indistinguishable)
        return f"One of these explains the gap, and the records cannot tell which: {sets}.{shrunk}"
    if v.outline:
        names = ", ".join(repr(e.name) for e in v.outline)
        return (f"No law of the library explains the gap: the body changes in time, as "
                f"{' and '.join(map(described, v.outline))}. With that the error on the records goes from "
                f"{found.which[0].gap_before:.1%} to {left:.1%}; it was not handed on, for it need not hold in other "
                f"records (name {names} among the effects to have it).{shrunk}")
    return ("There is a gap that no effect of the library explains; where it lies says what is known of it." + shrunk)


def closed_by_retuning(h: HowFar) -> bool:
    """Whether the effect closes hardly more of the gap than retuning does, and that leaves hardly more than noise."""
    return (h.gap_retuned**2 - h.gap_after**2 < 0.01 * (h.gap_before**2 - h.noise_floor**2)
            and h.gap_retuned < 1.5 * max(h.gap_after, h.noise_floor))


ADVICE = {
    frozenset({"sensor", "offset"}): "a second, independent displacement sensor, or a static push with a known weight",
    frozenset({"sensor", "input"}): "an accelerometer beside the displacement sensor, or a decay test (no force acts)",
    frozenset({"sensor", "stiffness"}): "an inclining or static load test with a known force",
    frozenset({"input", "stiffness"}): "a decay test: it has stiffness and inertia but no exciting force",
    frozenset({"input", "damping"}): "a decay test: it has damping but no exciting force",
    frozenset({"input", "inertia"}): "a decay test: it has stiffness and inertia but no exciting force",
    frozenset({"stiffness", "inertia"}): "waves or a forced test well above and below the natural frequency",
    frozenset({"sensor", "inertia"}): "a static load test, or a second displacement sensor",
    frozenset({"sensor", "damping"}): "decays from two or more amplitudes, or a second sensor",
    frozenset({"damping", "stiffness"}): "decays from two or more amplitudes",
    frozenset({"damping"}): "decays from a large and a small amplitude: friction, linear and quadratic damping scale "
                            "differently with it",
    frozenset({"stiffness"}): "a decay or static test at larger amplitude, to both sides",
    frozenset({"inertia"}): "a decay with a known added mass",
    frozenset({"sensor"}): "a second sensor of another kind",
    frozenset({"input"}): "the force measured with the model held (diffraction test)",
}


AGAIN = "the first record once more, at the end: it tells whether the change stays, goes on or begins anew each time"


def advice(families: frozenset[str]) -> str:
    """Return what to measure next to tell families of effects apart."""
    for known, text in ADVICE.items():
        if families and known >= families:
            return text
    for known, text in ADVICE.items():
        if families & known == known:
            return text
    return "decays from several amplitudes and waves with the exciting force known"
