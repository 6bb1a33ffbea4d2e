"""Sentences of a diagnosis."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from radiation_ss.diagnosis.result import Diagnosis, Named


def described(effect: Named) -> str:
    """Return an effect with its place and numbers: "quadratic_drag on Heave (coefficient 31 +- 2 N/(m/s)^2)"."""
    numbers = ", ".join(f"{name} {value:.3g} \N{PLUS-MINUS SIGN} {std:.1g} {effect.units.get(name, '')}".strip()
                        for name, (value, std) in effect.parameters.items() if std > 0.0)
    where = f" on {effect.dof}" if effect.dof else ""
    return f"{effect.name}{where}" + (f" ({numbers})" if numbers else "")


def sentence(found: Diagnosis) -> str:
    """Return the verdict in one sentence, with what the recalibration exceeds."""
    v, h = found.verdict, found.how_far
    names = " and ".join(described(e) for e in v.effects)
    shrunk = f"the gap on unseen data shrinks from {h.gap_before:.1%} to {h.gap_after:.1%}"
    if v.status == "no_gap":
        told = f"No gap that matters: the model predicts unseen data to {h.gap_after:.1%} of the motion"
    elif v.status == "effect":
        told = f"{names}, probability {v.probability:.2f}; {shrunk}"
    elif v.status == "ambiguous":
        sets = " or ".join(" + ".join(s) or "recalibration alone" for s in v.indistinguishable)
        told = f"These records do not tell apart: {sets}; {shrunk} with the first"
    else:
        told = f"A gap that the library does not explain: {h.gap_after:.1%} of the motion is left of {h.gap_before:.1%}"
    far = [r for r in found.recalibrated if r.beyond > 2.0 and abs(r.value) > 2.0 * r.std]
    if far:
        most = max(far, key=lambda r: r.beyond)
        told += (f"; nominal {most.name} of {most.dof} recalibrated by {most.value:+.1%}, "
                 f"{most.beyond:.1f} times its tolerance")
    return told + "."


def next_record(kinds: set[str], forced: bool, status: str) -> str:
    """Return what to measure next: a kind of test that was not given."""
    if status in ("no_gap", "effect"):
        return ""
    if "decay" not in kinds and "prescribed" not in kinds:
        return "a decay test from a large displacement"
    if not forced:
        return "waves or a forced test with known force near the natural frequency"
    return "the same test at half and at twice the amplitude"
