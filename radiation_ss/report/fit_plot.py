"""Pictures of a fit: coefficients, Nyquist, kernel, and the path of orders."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import force_unit, mode, motion_unit
from radiation_ss.style import BLUE, GREY, VERMILION, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_fit(fit: RadiationFit, entries: list[tuple[str, str]] | None = None) -> Figure:
    """Draw added mass, damping, Nyquist plot and kernel of some entries, data as points, fit as lines.

    Parameters
    ----------
    fit : RadiationFit
    entries : list of (force, velocity), optional
        By default the diagonal.

    Raises
    ------
    InputError
        If the fit does not carry its data or A_inf.
    """
    data, A_inf = fit.data, fit.A_inf
    if data is None or A_inf is None:
        raise InputError("plot: this fit was read from a file without its data; use fit.replace(data=..., A_inf=...)")
    wanted = entries or [(dof, dof) for block in fit.blocks or (fit.dofs,) for dof in block]
    figure_, axes = figure(len(wanted), 4, size=(13.0, 2.3 * len(wanted) + 0.5))
    omega = np.linspace(1e-3 * data.omega[-1], 1.15 * data.omega[-1], 500)
    K = fit.frequency_response(omega)
    slow = max(-float(np.linalg.eigvals(fit.a).real.max()), 0.05 * data.omega[-1])
    t = np.linspace(0.0, min(8.0 / slow, 150.0 / data.omega[-1]), 400)
    kernel, samples = fit.kernel(t), data.kernel(t)
    for row, (force, velocity) in zip(axes, wanted):
        i, j = data.index(force), data.index(velocity)
        unit = _units(force, velocity)
        _pair(row[0], data.omega, data.A[:, i, j], omega, A_inf[i, j] + K[:, i, j].imag / omega)
        row[0].axhline(A_inf[i, j], color=GREY, lw=0.8, ls=":")
        _pair(row[1], data.omega, data.B[:, i, j], omega, K[:, i, j].real)
        row[1].axhline(0.0, color=GREY, lw=0.6)
        _pair(row[2], data.K[:, i, j].real, data.K[:, i, j].imag, K[:, i, j].real, K[:, i, j].imag)
        row[2].axvline(0.0, color=GREY, lw=0.8)
        _pair(row[3], t[::4], samples[::4, i, j], t, kernel[:, i, j])
        label = mode(force) if force == velocity else f"{mode(force)}-{mode(velocity)}"
        row[0].set(ylabel=f"{label}\nA [{unit[0]}]", xlabel="ω [rad/s]")
        row[1].set(ylabel=f"B [{unit[1]}]", xlabel="ω [rad/s]")
        row[2].set(ylabel=f"Im K [{unit[1]}]", xlabel=f"Re K [{unit[1]}]")
        row[3].set(ylabel=f"L [{unit[2]}]", xlabel="t [s]")
    for axis, title in zip(axes[0], ("added mass", "damping", "Nyquist", "kernel")):
        axis.set_title(title)
    axes[0, 0].legend(["data", f"fit, order {fit.order}"], loc="best")
    return figure_


def plot_path(fit: RadiationFit) -> Figure:
    """Draw the error of each order that was tried, on fitted and held-out frequencies.

    Raises
    ------
    InputError
        If the order was given and not chosen.
    """
    if not fit.path:
        raise InputError("plot_path: the order of this fit was given, not chosen; fit with order=None")
    figure_, axes = figure(1, len(fit.path), size=(3.2 * len(fit.path) + 0.4, 2.8))
    for axis, block, path in zip(axes[0], fit.blocks, fit.path):
        orders = [trial.order for trial in path]
        axis.semilogy(orders, [trial.error for trial in path], "o-", color=BLUE, label="fitted")
        axis.semilogy(orders, [trial.held_out for trial in path], "s--", color=VERMILION, label="held out")
        axis.set(title=", ".join(mode(dof) for dof in block), xlabel="order", ylabel="relative error")
        axis.legend()
    return figure_


def _pair(axis: Axes, x: np.ndarray, y: np.ndarray, fine: np.ndarray, line: np.ndarray) -> None:
    """Draw data as points and the fit as a line."""
    axis.plot(x, y, ".", color=GREY, ms=2.5)
    axis.plot(fine, line, color=BLUE)


def _units(force: str, velocity: str) -> tuple[str, str, str]:
    """Return the units of added mass, damping and kernel of an entry."""
    turns = (force_unit(force) == "N m") + (motion_unit(velocity) == "rad")
    return (("kg", "kg m", "kg m²")[turns], ("kg/s", "kg m/s", "kg m²/s")[turns],
            ("kg/s²", "kg m/s²", "kg m²/s²")[turns])
