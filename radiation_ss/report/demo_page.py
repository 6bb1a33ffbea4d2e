"""The page of the demo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from radiation_ss.page import Page, Picture, Section, Table, Text, Verdict, number
from radiation_ss.report import demo_plot
from radiation_ss.report.tank import ERROR, NOISE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from radiation_ss.report.demo import Demo


def demo_page(demo: Demo, diagnosed: Page) -> Page:
    """Return the page of the demo; the sections of the diagnosis come from its own page."""
    fit = demo.model.fit
    rows = [["prior model", number(demo.error_at_start), "–"],
            *([e.name, number(e.error_of_K), number(e.error_of_force)] for e in demo.estimates)]
    radiation = Section("Radiation: from the section to a state-space model", [
        Text(f"A panel method gives added mass and damping of the section in water of {demo.hydro.depth:g} m. A fit of "
             f"order {fit.order}, stable and passive by construction, is the radiation model. Certificate: "
             f"{fit.certificate}."),
        picture(demo_plot.radiation(demo.hydro, fit),
                "Section, added mass, damping and retardation kernel: solver and fit.")])
    motion = Section("Identification from thirty seconds of motion", [
        Text(f"The parameters of the prior model are wrong by {ERROR:.0%}, the sensors have {NOISE:.0%} noise, the "
             "force is unknown. Errors are relative to the simulated truth, in the band of the waves."),
        Table(["", "error of K(iω)", "error of the force"], rows,
              "Motion alone hardly determines a linear body under an unknown force; known points of K or the spectrum "
              "of the sea do."),
        picture(demo_plot.identification(demo), "Damping and added mass with 95 % bands, and the force from motion.")])
    told = Text("The simulated body has an effect that the model does not have, and radiation of higher order. The "
                "diagnosis sees two records; a third one is withheld.")
    return Page("A floating body in the paper's tank", [
        Section("", [Verdict(str(demo.diagnosis), "good" if demo.diagnosis.verdict.status == "effect" else "warn")]),
        radiation, motion, Section("The sim-to-real gap", [told]), *diagnosed.sections[1:]],
        subtitle="Hanaki, Takaoka & Minoura (2022): Lewis section b = d = 0.1 m, σ = 0.90, depth 0.45 m",
        footer="Computed by radiation-ss demo from the body's dimensions.")


def picture(figure: Figure, caption: str) -> Picture:
    """Return a picture whose caption serves as its description."""
    return Picture(figure, caption, caption)
