"""report.html, report.json and corrected.json of a diagnosis, and its pictures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss import page, style
from radiation_ss.atomic import folder_written_whole, write_whole
from radiation_ss.diagnosis.prediction import energy
from radiation_ss.diagnosis.sets import alternatives, label, less_sure
from radiation_ss.diagnosis.shares import DRIFT
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import force_unit, motion_unit
from radiation_ss.page import Page, Part, Picture, Points, Table, Text, Verdict, number, with_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radiation_ss.diagnosis.result import Diagnosis, Named, Recalibrated

TONE = {"no_gap": "good", "effect": "good", "ambiguous": "warn", "unknown_effect": "bad"}


def save(found: Diagnosis, folder: str | Path, page_: Page | None = None) -> None:
    """Write report.json, report.html and corrected.json."""
    text = json.dumps(found.to_dict(), indent=1, allow_nan=False)
    with folder_written_whole(folder) as out:
        write_whole(out / "report.json", text + "\n")
        found.corrected.write(out / "corrected.json")
        page.write(page_ or page_of(found), out / "report.html")


def page_of(found: Diagnosis) -> Page:
    """Return the page of a diagnosis."""
    v = found.verdict
    further = f"To measure next: {v.next_record}." if v.next_record else ""
    detail = f"Probability {v.probability:.2f}{limit_of(found)}. {further}"
    notes = [Points(list(found.notes))] if found.notes else []
    top = Part("Verdict", [Verdict(found.sentence, TONE[v.status], detail), *notes])
    sections = [top, *budget(found), which(found), recalibration(found), where(found), hidden(found)]
    return Page(f"Sim-to-real gap of {found.model_name}", sections,
                subtitle="Where model and measurement differ, which effects cause it, how far the gap shrinks")


def limit_of(found: Diagnosis) -> str:
    """Return what keeps a name's probability from being larger, as words to follow it."""
    p, rules, left = found.verdict.probability, found.rules, found.budget.unexplained
    against = found.budget.against
    if found.verdict.status == "effect" and against and p >= 1.0 / (1.0 + against):
        return f": the effects make {against:.1%} of the gap's energy against each other"
    if found.verdict.status != "effect" or p < 1.0 - max(rules.false_alarm, left):
        return ""
    if left > rules.false_alarm:
        return f", at most 1 less the {left:.1%} of the gap's energy that is left unexplained"
    return ", the most that the false-alarm rate lets a verdict claim"


def budget(found: Diagnosis) -> list[Part]:
    """Where the gap goes, on records that no fit has seen."""
    b, h = found.budget, found.how_far
    if not found.predictions:
        return [Part("Budget of the gap", [Text("No record with a known force: motions cannot be predicted, so the "
                                            "gap on unseen data is not known.")])]
    most = found.verdict.probability if limit_of(found) else 1.0
    rows = [[f"{r.cause.replace('_', ' ')} {r.dof}".strip(), f"{r.share:.1%}", f"{r.interval[0]:.1%} to "
             f"{r.interval[1]:.1%}", "" if r.inclusion is None else f"{min(r.inclusion, most):.2f}",
             ", ".join(f"{n} {with_error(*pair)}" for n, pair in r.parameters.items())] for r in b.rows]
    table = Table(["cause", "share of the gap's energy", "95 %", "probability", "numbers"], rows,
                  f"Gap: rms of measured minus predicted over rms of measured, on {', '.join(b.unseen)}: "
                  f"{b.before:.2%} as given, {b.after:.2%} corrected, {b.noise:.2%} noise. Shrinkage, the share of the "
                  f"gap's energy beyond the noise that is closed: {h.shrinkage:.3f} "
                  f"(95 %: {h.interval[0]:.3f} to {h.interval[1]:.3f}).")
    return [Part("Budget of the gap", [
        Picture(overview(found, ["budget"]), "Share of each cause on unseen data; shares add up to one, and what makes "
                "the gap larger is negative.", "One stacked bar for each record and degree of freedom"), table]),
        Part("Prediction of unseen data", [
            Picture(overview(found, ["motion"]), "Measured and predicted, and the errors.",
                    "Measured signal with the predictions of the given and of the corrected model"),
            Picture(ledger(found), "Gap at each stage.", "Bars of the gap at each stage")])]


def which(found: Diagnosis) -> Part:
    """Sets of effects with their probabilities."""
    rows = [["; ".join(described(e) for e in c.effects) or "none", f"{c.probability:.2f}", number(c.log_evidence, 3)]
            for c in found.which if c.probability >= 0.005]
    return Part("Which effects", [
        Table(["set of effects", "probability", "log odds against the best"], rows,
              "Sets that were compared on the records of the fit; those below 0.005 are not listed. The probability of "
              "an effect in the budget is the sum over all sets that hold it, within the verdict's limit.")])


def recalibration(found: Diagnosis) -> Part:
    """The nominal numbers that were moved."""
    rows = [[f"{r.name.replace('_', ' ')} of {r.dof}".strip(), f"{r.value:+.2%}", f"{r.std:.2%}", f"{r.beyond:.1f}"]
            for r in sorted(found.recalibrated, key=lambda r: -r.beyond)[:12]]
    return Part("Recalibration", [
        Table(["nominal number", "change", "standard deviation", "in stated tolerances"], rows,
              "How the model's own numbers move beside the effects; the scale of the tolerances is learned.")])


def where(found: Diagnosis) -> Part:
    """Where the gap lies."""
    w = found.where
    character = "has no single character" if w.phase == "mixed" else f"acts like {w.phase}"
    rows = [[name, f"{value:.2%}"] for name, value in w.records.items()]
    bands = [[f"{a:.3g} to {b:.3g}", f"{share:.0%}"] for a, b, share in w.bands if share >= 0.005]
    return Part("Where it lies", [
        Text(f"The force that is missing {character}."),
        Table(["record", "error of the equation of motion, of the model's own forces"], rows),
        Table(["frequency band [rad/s]", "share"], bands)])


def hidden(found: Diagnosis) -> Part:
    """What these records cannot show."""
    names = found.verdict.not_testable
    text = "Every effect that was considered would show at its usual size."
    if names:
        text = ("These effects would not show in these records even at their usual size, so nothing is said about "
                f"them: {', '.join(n.replace('_', ' ') for n in names)}.")
    return Part("What these records cannot show", [Text(text)])


UNITS = {"displacement": "", "velocity": "/s", "acceleration": "/s²"}
FIXED = {"recalibration": style.GREEN, "offset": style.SKY, "unexplained": style.BLACK, "noise": style.GREY}
EFFECTS = (style.BLUE, style.VERMILION, style.ORANGE, style.PURPLE, style.YELLOW)


@style.look()
def overview(found: Diagnosis, parts: Sequence[str] = ("budget", "motion")) -> Figure:
    """Draw the budget, and one unseen record as measured and predicted with its error, or one of the two."""
    if not found.predictions:
        raise InputError("no record with a known force is left to be predicted, so there is nothing to draw")
    rows = [name for name in ("budget", "motion", "motion") if name in parts]
    height = 4.2 * ("motion" in parts) + (1.0 + 0.34 * len(found.budget.by_record)) * ("budget" in parts)
    figure, axes = style.figure(len(rows), 1, size=(7.6, height))
    if "budget" in parts:
        stacked(found, axes[0, 0])
    if "motion" in parts:
        motion(found, axes[-2, 0], axes[-1, 0])
    return figure


def stacked(found: Diagnosis, axis: Axes) -> None:
    """Draw the budget's bars; what makes the gap larger stands left of zero."""
    causes = [style.literal(f"{row.cause} {row.dof}".strip()) for row in found.budget.rows]
    effects = [c for c in causes if c not in FIXED]
    colour = FIXED | {c: EFFECTS[k % len(EFFECTS)] for k, c in enumerate(effects)}
    names = [style.literal(f"{record}, {dof}") for record, dof in found.budget.by_record]
    right, left = np.zeros(len(names)), np.zeros(len(names))
    for cause in causes:
        values = np.array([100.0 * shares.get(cause, 0.0) for shares in found.budget.by_record.values()])
        start = np.where(values >= 0.0, right, left)
        axis.barh(range(len(names)), values, left=start, color=colour[cause], label=cause.replace("_", " "), height=0.6)
        right, left = right + np.maximum(values, 0.0), left + np.minimum(values, 0.0)
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set_xlabel("share of the gap's energy on unseen data [%]")
    axis.legend(ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=7)


def motion(found: Diagnosis, top: Axes, bottom: Axes) -> None:
    """Draw the measured and predicted signal with the largest gap above, the errors below."""
    given, corrected = found.predictions["given"], found.predictions["corrected"]
    pick = int(np.argmax(energy(given)))
    before, after = given[pick], corrected[pick]
    dof = found.dofs[before.dof]
    unit = force_unit(dof) if before.quantity == "force" else motion_unit(dof) + UNITS[before.quantity]
    mark = "o" if before.static else None
    top.plot(before.time, before.measured, marker=mark, color=style.BLACK, label="measured")
    top.plot(before.time, before.measured - before.error, color=style.VERMILION, label="model as given")
    top.plot(after.time, after.measured - after.error, "--", color=style.BLUE, label="corrected model")
    quantity = "" if before.quantity == "displacement" else f" {before.quantity}"
    top.set_ylabel(f"{style.literal(dof)}{quantity} [{unit}]")
    top.set_title(style.literal(f"{before.record}, unseen"), loc="left", pad=20.0)
    top.legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8)
    bottom.plot(before.time, before.error, marker=mark, color=style.VERMILION)
    bottom.plot(after.time, after.error, marker=mark, color=style.BLUE)
    bottom.set(ylabel=f"error [{unit}]", xlabel="number of the place" if before.static else "time [s]")


@style.look()
def ledger(found: Diagnosis) -> Figure:
    """Draw the gaps from the model as given to the noise."""
    figure, axes = style.figure(1, 1, size=(5.6, 2.2))
    h, axis = found.how_far, axes[0, 0]
    values = 100.0 * np.array([h.gap_before, h.gap_retuned, h.gap_after, h.noise_floor])
    bars = axis.barh(["as given", "recalibrated, no effect", "corrected", "noise"], values,
                     color=[style.VERMILION, style.ORANGE, style.BLUE, style.GREY])
    axis.bar_label(bars, fmt=" {:.2g} %")
    axis.set(xlabel=f"gap on unseen data [% of {what_of(found)}'s rms]; shorter is better",
             xlim=(0.0, 1.15 * max(float(np.nan_to_num(values).max()), 1e-9)))
    axis.invert_yaxis()
    return figure


def described(effect: Named) -> str:
    """Return an effect with its place and numbers: "quadratic_drag on Heave (coefficient 31 +- 2 N/(m/s)^2)".

    One of second sensors alone has their channels for a place.
    """
    numbers = ", ".join(f"{name} {with_error(value, std, effect.units.get(name, ''))}"
                        for name, (value, std) in effect.parameters.items()
                        if name != "all_sensors" or not effect.channels)
    where = f" on {' and '.join(effect.channels) or effect.dof}" if effect.dof else ""
    return f"{effect.name}{where}" + (f" ({numbers})" if numbers else "")


def far_off(found: Diagnosis, times: float = 2.0) -> list[Recalibrated]:
    """Return the nominal numbers that are off by more than some tolerances and standard deviations."""
    return [r for r in found.recalibrated if r.beyond > times and abs(r.value) > times * r.std]


def what_of(found: Diagnosis) -> str:
    """Return what a gap is a share of: the force where every unseen record is prescribed or static."""
    return "the force" if {e.quantity for e in found.predictions.get("given", ())} == {"force"} else "the motion"


def within_tolerance(found: Diagnosis) -> str:
    """Return what is said where there is no gap."""
    h, what = found.how_far, what_of(found)
    if not found.budget.unseen:
        return "No gap that these records show; no force is known, so that no motion can be predicted"
    if h.gap_before < 1.5 * h.gap_after:
        least = min(h.gap_before, h.gap_after)
        noise = f"; noise of the records makes {h.noise_floor:.1%}" if h.noise_floor > 0.5 * least else ""
        return f"No gap beyond noise and tolerances: the model predicts unseen data to {least:.1%} of {what}{noise}"
    if far_off(found):
        return ("The model's own numbers account for the gap: recalibrated it predicts unseen data to "
                f"{h.gap_after:.1%} of {what}, as given to {h.gap_before:.1%}")
    return (f"No gap beyond the tolerances: with numbers moved within them the model predicts unseen data to "
            f"{h.gap_after:.1%} of {what}, as given to {h.gap_before:.1%}")


def sentence(found: Diagnosis) -> str:
    """Return the verdict in one sentence, after what columns may be instead where that explains more of the gap."""
    told = verdict(found)
    if not found.misreadings:
        return told
    first, *more = found.misreadings
    beside = f" (and {len(more)} more in the notes)" if more else ""
    return f"First check {first}{beside}. As the columns are read: {told}"


def verdict(found: Diagnosis) -> str:
    """Return the verdict in one sentence, with what the recalibration exceeds."""
    v, h, what = found.verdict, found.how_far, what_of(found)
    names = " and ".join(described(e) for e in v.effects)
    noise = f" (noise alone makes {h.noise_floor:.1%})" if h.noise_floor > 0.5 * h.gap_after else ""
    first = with_which(found) if v.status == "ambiguous" and len(v.indistinguishable) > 1 else ""
    shrunk = f"the gap on unseen data shrinks from {h.gap_before:.1%} to {h.gap_after:.1%}{noise}{first}"
    if h.gap_after > 0.9 * h.gap_before:
        shrunk = f"the gap on unseen data stays{first}: {h.gap_before:.1%} as given, {h.gap_after:.1%} corrected{noise}"
    if not found.budget.unseen:
        shrunk = "no force is known, so that nothing predicts unseen data"
    elif h.noise_floor > 0.9 * h.gap_before:
        shrunk = (f"unseen data are too faint to check it: of their gap of {h.gap_before:.1%} noise makes "
                  f"{h.noise_floor:.1%}")
    if v.status == "no_gap":
        told = within_tolerance(found)
    elif v.status == "effect":
        told = f"{names}, probability {v.probability:.2f}; {shrunk}"
        if v.indistinguishable:
            named = {label(found.dofs, e.name, e.dof) for e in v.effects}
            told += f"; {less_sure(named, v.indistinguishable)}"
    elif v.status == "ambiguous" and not v.indistinguishable:
        told = ("These records tell no cause: the force is not known and the motion is held, or slow against the "
                "natural periods, so any restoring and any force explain each other. They show where the body rests "
                "and how far each motion goes with the others; a decay, held until its release or not, needs "
                f"`# kind: decay`; else measure {v.next_record}")
    elif v.status == "ambiguous":
        told = f"{alternatives(v.indistinguishable)}; {shrunk}"
        if found.budget.slow and any(label.startswith(DRIFT) for names in v.indistinguishable for label in names):
            told += (f"; {found.budget.slow:.0%} of its energy is the slow force, which has a course of its own in "
                     "each record and is explained, not predicted: whether waves, wind, a passing ship, a load that "
                     "shifts or a sensor's zero make it, these records do not tell")
    elif any(r.beyond > found.rules.plausible for r in found.recalibrated):
        told = ("A gap that no effect explains unless the model's own numbers are far beyond their tolerances: with "
                f"them {h.gap_after:.1%} of {what} is left of {h.gap_before:.1%}")
    else:
        told = f"A gap that the library does not explain: {h.gap_after:.1%} of {what} is left of {h.gap_before:.1%}"
    steady = found.budget.closed_by("offset", "")
    if steady > max(found.rules.matters, np.sqrt(0.5) * h.gap_after):
        told += f"; what is left is mostly a constant, {steady:.1%} of {what}: a zero that is off, or a steady force"
    if far := far_off(found):
        most = max(far, key=lambda r: r.beyond)
        told += (f"; nominal {most.name} of {most.dof} recalibrated by {most.value:+.1%}, "
                 f"{most.beyond:.1f} times its tolerance")
    return told + "."


def with_which(found: Diagnosis) -> str:
    """Return whether the first of several sets is corrected; a slow force is told, and no correction."""
    done = {label(found.dofs, a.name, f"{a.dof},{a.other}" if a.other else a.dof) for a in found.corrected.effects}
    wanted = {told for told in found.verdict.indistinguishable[0] if not told.startswith(DRIFT)}
    return " with the first" if wanted <= done else ", none of them being corrected"
