"""Pictures of the demo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss import style
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData
from radiation_ss.report.tank import tank_section

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from radiation_ss.report.demo import Demo


@style.look()
def radiation(hydro: HydroData, fit: RadiationFit) -> Figure:
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
def identification(demo: Demo) -> Figure:
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
