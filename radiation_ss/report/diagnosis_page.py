"""report.html, report.json and corrected.json of a diagnosis."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from radiation_ss import page
from radiation_ss.atomic import folder_written_whole, write_whole
from radiation_ss.diagnosis.words import described
from radiation_ss.page import Page, Picture, Points, Section, Table, Text, Verdict, number
from radiation_ss.report import diagnosis_plot as plot

if TYPE_CHECKING:
    from radiation_ss.diagnosis.result import Diagnosis

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
    detail = f"Probability {v.probability:.2f}. " + (f"To measure next: {v.next_record}." if v.next_record else "")
    notes = [Points(list(found.notes))] if found.notes else []
    top = Section("Verdict", [Verdict(found.sentence, TONE[v.status], detail), *notes])
    sections = [top, *budget(found), which(found), recalibration(found), where(found), hidden(found)]
    return Page(f"Sim-to-real gap of {found.model_name}", sections,
                subtitle="Where model and measurement differ, which effects cause it, how far the gap shrinks")


def budget(found: Diagnosis) -> list[Section]:
    """Where the gap goes, on records that no fit has seen."""
    b, h = found.budget, found.how_far
    if not found.predictions:
        return [Section("Budget of the gap", [Text("No record with a known force: motions cannot be predicted, so the "
                                                   "gap on unseen data is not known.")])]
    rows = [[f"{r.cause.replace('_', ' ')} {r.dof}".strip(), f"{r.share:.1%}",
             f"{r.interval[0]:.1%} to {r.interval[1]:.1%}", "" if r.inclusion is None else f"{r.inclusion:.2f}",
             ", ".join(f"{n} {value:.3g} ± {std:.1g}" for n, (value, std) in r.parameters.items())] for r in b.rows]
    table = Table(["cause", "share of the gap's energy", "95 %", "probability", "numbers"], rows,
                  f"Gap: rms of measured minus predicted over rms of measured, on {', '.join(b.unseen)}: "
                  f"{b.before:.2%} as given, {b.after:.2%} corrected, {b.noise:.2%} noise. Shrinkage, the share of the "
                  f"gap's energy beyond the noise that is closed: {h.shrinkage:.3f} "
                  f"(95 %: {h.interval[0]:.3f} to {h.interval[1]:.3f}).")
    return [Section("Budget of the gap", [
        Picture(plot.budget_picture(found), "Share of each cause on unseen data; shares add up to one, and what makes "
                "the gap larger is negative.", "One stacked bar for each record and degree of freedom"), table]),
        Section("Prediction of unseen data", [
            Picture(plot.motion_picture(found), "Measured and predicted, and the errors.",
                    "Measured signal with the predictions of the given and of the corrected model"),
            Picture(plot.ledger(found), "Gap at each stage.", "Bars of the gap at each stage")])]


def which(found: Diagnosis) -> Section:
    """Sets of effects with their probabilities."""
    rows = [["; ".join(described(e) for e in c.effects) or "none", f"{c.probability:.2f}", number(c.log_evidence, 3)]
            for c in found.which if c.probability >= 0.005]
    return Section("Which effects", [
        Table(["set of effects", "probability", "log Bayes factor against the best"], rows,
              "Sets that were compared on the records of the fit. A probability of an effect is the sum over all sets "
              "that hold it.")])


def recalibration(found: Diagnosis) -> Section:
    """The nominal numbers that were moved."""
    rows = [[f"{r.name.replace('_', ' ')} of {r.dof}".strip(), f"{r.value:+.2%}", f"{r.std:.2%}", f"{r.beyond:.1f}"]
            for r in sorted(found.recalibrated, key=lambda r: -r.beyond)[:12]]
    return Section("Recalibration", [
        Table(["nominal number", "change", "standard deviation", "in stated tolerances"], rows,
              "How the model's own numbers move beside the effects; the scale of the tolerances is learned.")])


def where(found: Diagnosis) -> Section:
    """Where the gap lies."""
    w = found.where
    character = "has no single character" if w.phase == "mixed" else f"acts like {w.phase}"
    rows = [[name, f"{value:.2%}"] for name, value in w.records.items()]
    bands = [[f"{a:.3g} to {b:.3g}", f"{share:.0%}"] for a, b, share in w.bands if share >= 0.005]
    return Section("Where it lies", [
        Text(f"The force that is missing {character}."),
        Table(["record", "error of the equation of motion, of the model's own forces"], rows),
        Table(["frequency band [rad/s]", "share"], bands)])


def hidden(found: Diagnosis) -> Section:
    """What these records cannot show."""
    names = found.verdict.not_testable
    text = "Every effect that was considered would show at its usual size."
    if names:
        text = ("These effects would not show in these records even at their usual size, so nothing is said about "
                f"them: {', '.join(n.replace('_', ' ') for n in names)}.")
    return Section("What these records cannot show", [Text(text)])
