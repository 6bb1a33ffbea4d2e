"""report.html: one page, no network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from radiation_ss import page
from radiation_ss.gap.answer import plot
from radiation_ss.gap.answer.words import described, sentence
from radiation_ss.page import Page, Picture, Points, Section, Table, Text, Verdict, number

if TYPE_CHECKING:
    from radiation_ss.gap.answer.diagnosis import Diagnosis

TONE = {"no_gap": "good", "effect": "good", "ambiguous": "warn", "unknown_effect": "bad"}


def save(found: Diagnosis, folder: str | Path, whole: Page | None = None) -> None:
    """Write report.json, corrected.json and report.html; `whole` is the page where it was made already."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    text = json.dumps(found.to_dict(), indent=1, allow_nan=False)
    (place / "report.json").write_text(text + "\n", encoding="utf-8")
    found.corrected.write(place / "corrected.json")
    page.write(whole or page_of(found), place / "report.html")


def page_of(found: Diagnosis) -> Page:
    """Return the page of a diagnosis."""
    v = found.verdict
    detail = f"Probability {v.probability:.2f}. " + (f"To measure next: {v.next_record}." if v.next_record else "")
    notes = [Points(list(found.notes))] if found.notes else []
    top = Section("Verdict", [Verdict(sentence(found), TONE[v.status], detail), *notes])
    return Page(f"Sim-to-real gap of {found.model_name}",
                [top, how_far(found), which(found), where(found), *control(found), hidden(found)],
                subtitle="Where the model and the measurement differ, which effect causes it, how far the gap shrinks")


def how_far(found: Diagnosis) -> Section:
    """How far the gap shrinks."""
    h = found.how_far
    if found.settings.get("motion_only"):
        return Section("How far the gap shrinks", [Text(
            f"Outside the waves' own band the motion is {h.gap_before:.2%} of the whole, and {h.gap_after:.2%} once "
            "what the effect explains is taken out. How far the whole gap shrinks cannot be said without a known "
            "force.")])
    table = Table(["", "gap"], [["model as given", f"{h.gap_before:.2%}"],
                                ["retuned, no effect", f"{h.gap_retuned:.2%}"],
                                ["corrected", f"{h.gap_after:.2%}"], ["noise floor", f"{h.noise_floor:.2%}"],
                                ["shrinkage", f"{h.shrinkage:.3f} (95 %: {h.interval[0]:.3f} to {h.interval[1]:.3f})"]],
                  (f"On {', '.join(h.on)}; no fit has seen it." if h.on else "On the records of the fit.")
                  + retuning(found))
    pictures = []
    if found.predictions:
        pictures.append(Picture(plot.overview(found), "Measured and predicted motion, and the errors.",
                                "Measured motion with the predictions of the given and of the corrected model"))
    return Section("How far the gap shrinks", [
        *pictures, table,
        Picture(plot.ledger(found), "Gap: rms error over rms of the motion.", "Bars of the gap at each stage")])


def retuning(found: Diagnosis) -> str:
    """Say what the retuning without an effect had to move."""
    pulls = found.where.pulls
    if not pulls:
        return ""
    name = max(pulls, key=lambda key: abs(pulls[key]))
    told = " Retuned: the model's own numbers moved, each weighed by its tolerance, with no effect"
    return told + (f"; {name} moved by {abs(pulls[name]):.0f} tolerances." if abs(pulls[name]) > 3.0 else ".")


def which(found: Diagnosis) -> Section:
    """Which effect."""
    rows = [["; ".join(described(e) for e in c.effects) or "none", number(c.probability, 2), number(c.log_evidence, 4),
             f"{c.gap_after:.2%}"] for c in found.which]
    return Section("Which effect", [
        Picture(plot.candidates(found), "The candidates; a short bar is a good one. Within 3 nats (the line) two "
                "cannot be told apart. Gap: on the records of the fit.", "Bars of log evidence below the best"),
        Table(["candidate", "probability", "log evidence against the best", "gap after"], rows,
              f"Gap before: {found.which[0].gap_before:.2%} on the records of the fit."), *threshold(found)])


def threshold(found: Diagnosis) -> list[Text]:
    """How much evidence was asked, and why so much."""
    null = found.settings.get("null")
    if not null:
        return []
    refits = f", and {null['refits']} fitted anew" if null["refits"] else ""
    text = (f"An effect had to gain {number(null['threshold'], 3)} nats of log evidence over none, its prior odds "
            f"included. Tests of the same body without any effect were simulated ({null['replicates']} by "
            f"linearisation{refits}), with the model off within its tolerances: one in a hundred claims that much, or "
            f"less than the floor of {number(null['floor'], 2)} nats.")
    return [Text(text)]


def where(found: Diagnosis) -> Section:
    """Where it lies."""
    w = found.where
    rows = [[name, f"{a:.2%}", f"{b:.2%}", f"{c:.2%}"] for name, (a, b, c) in w.records.items()]
    pulls = [[name, f"{value:+.2f}"] for name, value in w.pulls.items()]
    picture = []
    if found.missing:
        picture.append(Picture(plot.missing(found), "The missing force along the motion. Left: a line is stiffness or "
                               "inertia, a loop is damping. Right: a line is damping, a bent one grows with amplitude. "
                               "Colour: the size of the other signal.",
                               "Missing force over displacement and over velocity"))
    return Section("Where it lies", [
        Text(f"The force that is missing {'has no single character' if w.phase == 'mixed' else f'acts like {w.phase}'}"
             f"{', and changes with amplitude' if w.amplitude_dependent else ''}."), *picture,
        Picture(plot.bands(found), "Shares of the gap.", "Bars of the gap by band and by record"),
        Table(["record", "as given", "retuned", "noise"], rows),
        Table(["nominal number", "moved by [tolerances]"], pulls,
              "How the model's numbers move when no effect is allowed; clearly beyond 1 they leave their tolerance, "
              "those of memory and phase beyond 2.")])


def control(found: Diagnosis) -> list[Section]:
    """What the gap means for a controller, where one was given."""
    c = found.control
    if c is None:
        return []
    table = Table(["", "value"], [["nu-gap between the model as given and the corrected one", f"{c.nu_gap:.3f}"],
                                  ["margin b(P, C) on the model as given", f"{c.margin_before:.3f}"],
                                  ["margin b(P, C) on the corrected model", f"{c.margin_after:.3f}"]],
                  f"Feedback from {', '.join(c.measured)}. Nonlinear effects are linearised at the records' amplitude."
                  + (f" Not in the linear plant: {', '.join(c.left_out)}." if c.left_out else ""))
    return [Section("What it means for the controller", [Text(c.sentence), table])]


def hidden(found: Diagnosis) -> Section:
    """What these records cannot show."""
    names = found.verdict.not_testable
    text = "Every effect of the library would show."
    if names:
        text = ("These effects would not show in these records even at their usual size, so nothing is said about "
                f"them: {', '.join(n.replace('_', ' ') for n in names)}.")
    return Section("What these records cannot show", [Text(text)])
