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
    rows = [["doing nothing", number(demo.error_at_start), "–"],
            *([e.name, number(e.error_of_K), number(e.error_of_force)] for e in demo.estimates)]
    memory = Section("Radiation: section to subsystem", [
        Text(f"A panel method gives added mass and damping of the section in water of {demo.hydro.depth:g} m. A fit of "
             f"order {fit.order}, stable and passive by construction, gives the memory. Certificate: "
             f"{fit.certificate}."),
        picture(demo_plot.radiation(demo.hydro, fit),
                "Section, added mass, damping and retardation kernel: solver and fit.")])
    motion = Section("Thirty seconds of motion: what it tells of the body and of the force", [
        Text(f"The memory's parameters start {ERROR:.0%} wrong, sensors carry {NOISE:.0%} noise, the force is unknown. "
             "Errors are against the simulated truth, over the band of the waves."),
        Table(["", "error of K(iω)", "error of the force"], rows,
              "Motion alone hardly determines a linear body under an unknown force; what is known of K or of the sea "
              "does."),
        picture(demo_plot.identification(demo), "Damping and added mass with 95 % bands, and the force from motion.")])
    told = Text("Now the truth has an effect that the model does not know, a finer memory, and sensor noise. The "
                "program sees two records and is told nothing.")
    return Page("A floating body in the paper's tank", [
        Section("", [Verdict(str(demo.diagnosis), "good" if demo.diagnosis.verdict.status == "effect" else "warn")]),
        memory, motion, Section("The sim-to-real gap", [told]), *diagnosed.sections[1:]],
        subtitle="Hanaki, Takaoka & Minoura (2022): Lewis section b = d = 0.1 m, σ = 0.90, depth 0.45 m",
        footer="Everything on this page was computed by radiation-ss demo from the body's dimensions.")


def picture(figure: Figure, caption: str) -> Picture:
    """Return a picture whose caption serves as its description."""
    return Picture(figure, caption, caption)
