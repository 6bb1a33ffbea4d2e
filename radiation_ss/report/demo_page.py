"""The page of the demo and its pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss import style
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData
from radiation_ss.page import Page, Part, Picture, Table, Text, Verdict, number
from radiation_ss.report.tank import ERROR, NOISE, tank_section

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radiation_ss.report.demo import Demo


def demo_page(demo: Demo, diagnosed: Page) -> Page:
    """Return the page of the demo; the sections of the diagnosis come from its own page."""
    fit = demo.model.fit
    rows = [["prior model", number(demo.error_at_start), "–"],
            *([e.name, number(e.error_of_K), number(e.error_of_force)] for e in demo.estimates)]
    radiation = Part("Radiation: from the section to a state-space model", [
        Text(f"A panel method gives added mass and damping of the section in water of {demo.hydro.depth:g} m. A fit of "
             f"order {fit.order}, stable and passive by construction, is the radiation model. Certificate: "
             f"{fit.certificate}."),
        picture(radiation_picture(demo.hydro, fit),
                "Section, added mass, damping and retardation kernel: solver and fit.")])
    motion = Part("Identification from thirty seconds of motion", [
        Text(f"The parameters of the prior model are wrong by {ERROR:.0%}, the sensors have {NOISE:.0%} noise, the "
             "force is unknown. Errors are relative to the simulated truth, in the band of the waves."),
        Table(["", "error of K(iω)", "error of the force"], rows,
              "Motion alone hardly determines a linear body under an unknown force; known points of K or the spectrum "
              "of the sea do."),
        picture(identification_picture(demo), "Damping and added mass with 95 % bands, and the force from motion.")])
    told = Text("The simulated body has an effect that the model does not have, and radiation of higher order. The "
                "diagnosis sees two records; a third one is withheld.")
    return Page("A floating body in the paper's tank", [
        Part("", [Verdict(str(demo.diagnosis), "good" if demo.diagnosis.verdict.status == "effect" else "warn")]),
        radiation, motion, Part("The sim-to-real gap", [told]), *diagnosed.sections[1:]],
        subtitle="Hanaki, Takaoka & Minoura (2022): Lewis section b = d = 0.1 m, σ = 0.90, depth 0.45 m",
        footer="Computed by radiation-ss demo from the body's dimensions.")


def picture(figure: Figure, caption: str) -> Picture:
    """Return a picture whose caption serves as its description."""
    return Picture(figure, caption, caption)


@style.look()
def radiation_picture(hydro: HydroData, fit: RadiationFit) -> Figure:
    """Section, added mass, damping and kernel: solver against fit (Figs. 4 and 5 of the paper)."""
    figure, ((shape, mass), (damping, kernel)) = style.figure(2, 2, size=(9.0, 5.6))
    half = np.concatenate([arc.curve(np.linspace(0.0, 1.0, 60)) for arc in tank_section().arcs])
    contour = np.concatenate([-half.conj()[::-1], half])
    shape.fill(contour.real, contour.imag, color=style.SKY, alpha=0.35)
    shape.plot(contour.real, contour.imag, color=style.BLUE)
    shape.axhline(0.0, color=style.GREY, linewidth=0.8)
    shape.axhline(-hydro.depth, color=style.BLACK)
    shape.set(aspect="equal", xlabel="y [m]", ylabel="z [m]", title="Section in the tank", xlim=(-0.35, 0.35))
    fine = np.linspace(hydro.omega[0], hydro.omega[-1], 400)
    K = fit.frequency_response(fine)[:, 0, 0]
    assert fit.A_inf is not None
    for axes, data, curve, label in ((mass, hydro.A[:, 0, 0], K.imag / fine + fit.A_inf[0, 0], "added mass A [kg]"),
                                     (damping, hydro.B[:, 0, 0], K.real, "damping B [kg/s]")):
        axes.plot(hydro.omega, data, ".", color=style.BLUE, label="section solver", markersize=5)
        axes.plot(fine, curve, color=style.VERMILION, label=f"fit, order {fit.order}")
        axes.set(xlabel="ω [rad/s]", ylabel=label, title=label[0].upper() + label.split(" [")[0][1:])
    mass.legend()
    t = np.linspace(0.0, 3.0, 300)
    kernel.plot(t, hydro.kernel(t)[:, 0, 0], color=style.BLUE, label="from the damping")
    kernel.plot(t, fit.kernel(t)[:, 0, 0], color=style.VERMILION, linestyle="--", label="of the fit")
    kernel.set(xlabel="t [s]", ylabel="L(t) [kg/s²]", title="Retardation kernel")
    kernel.legend()
    return figure


@style.look()
def identification_picture(demo: Demo) -> Figure:
    """Damping, added mass and force, estimated from motion, against the truth."""
    figure, rows = style.figure(len(demo.estimates), 3, size=(11.0, 2.5 * len(demo.estimates) + 0.4), share_x=True)
    for axes, estimate in zip(rows, demo.estimates):
        found = estimate.result
        K = demo.model.fit.frequency_response(found.omega)[:, 0, 0]
        truth = (K.real, K.imag / found.omega + demo.model.A_inf[0, 0])
        for ax, band, true, prior, label in zip(axes, (found.B, found.A), truth, (found.prior["B"], found.prior["A"]),
                                                ("damping B [kg/s]", "added mass A [kg]")):
            style.band(ax, found.omega, band.lower[:, 0, 0], band.upper[:, 0, 0], style.BLUE, "95 % band")
            ax.plot(found.omega, band.mean[:, 0, 0], color=style.BLUE, label="estimate")
            ax.plot(found.omega, prior[:, 0, 0], color=style.GREY, linestyle=":", label="prior model")
            ax.plot(found.omega, true, color=style.VERMILION, linestyle="--", label="truth")
            ax.set(ylabel=label, xlim=(0.0, 16.0), title=estimate.name)
        _force(axes[2], demo, estimate.name)
    rows[0, 0].legend(loc="lower left", fontsize=7)
    rows[-1, 0].set_xlabel("ω [rad/s]")
    rows[-1, 1].set_xlabel("ω [rad/s]")
    rows[-1, 2].set_xlabel("time [s]")
    return figure


def _force(axes: Axes, demo: Demo, name: str) -> None:
    estimate = next(e for e in demo.estimates if e.name == name)
    force = estimate.result.force.get(demo.record.name)
    show = (demo.record.time >= 10.0) & (demo.record.time <= 18.0)
    if force is not None:
        part = (force.time >= 10.0) & (force.time <= 18.0)
        style.band(axes, force.time[part], force.lower[0, part], force.upper[0, part], style.BLUE)
        axes.plot(force.time[part], force.mean[0, part], color=style.BLUE)
    axes.plot(demo.record.time[show], demo.record.channels["Heave_force"][show], color=style.VERMILION, linestyle="--")
    axes.set(ylabel="wave excitation force [N]", title="force from motion")
