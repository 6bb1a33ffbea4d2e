"""Result of `identify`: coefficients, force and sea with bands, and where each number came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.fit.result import RadiationFit
from radiation_ss.methods import Shown, later

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA = "radiation_ss.identification/1"
LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Band:
    """A quantity's posterior mean with the limits of its central 95 % band (of complex values: of each part)."""

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @classmethod
    def of(cls, draws: np.ndarray) -> Band:
        """Return the band of equally weighted draws along the first axis."""
        tail = [50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)]
        if np.iscomplexobj(draws):
            real, imag = np.percentile(draws.real, tail, axis=0), np.percentile(draws.imag, tail, axis=0)
            return cls(draws.mean(axis=0), real[0] + 1j * imag[0], real[1] + 1j * imag[1])
        lower, upper = np.percentile(draws, tail, axis=0)
        return cls(draws.mean(axis=0), lower, upper)

    def about(self, estimate: np.ndarray) -> Band:
        """Return the band with another estimate in place of the mean, widened to hold it."""
        if np.iscomplexobj(estimate):
            real, imag = (Band(self.mean, f(self.lower), f(self.upper)).about(f(estimate)) for f in (np.real, np.imag))
            return Band(estimate, real.lower + 1j * imag.lower, real.upper + 1j * imag.upper)
        return Band(estimate, np.minimum(self.lower, estimate), np.maximum(self.upper, estimate))

    def to_dict(self) -> dict[str, Any]:
        """Return nested lists (real quantities)."""
        return {"mean": self.mean.tolist(), "lower": self.lower.tolist(), "upper": self.upper.tolist()}


@dataclass(frozen=True, eq=False)
class ForceEstimate:
    """Exciting force of one record with its 95 % band, each (n, nt), at times (nt,) [s]."""

    time: FloatArray
    mean: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True, eq=False)
class Identification(Shown):
    """What the records say of a body's radiation memory, and how surely.

    Parameters
    ----------
    method : str
    dofs : tuple of str
    omega : ndarray, shape (nw,)
        Frequencies [rad/s] of A, B, K and the information shares.
    A, B, K : Band of (nw, n, n)
        Added mass, damping, K(iw) = B + i w (A - A_inf).
    K_zero : Band of (n, n)
        K(0) = B(0).
    A_inf : ndarray, shape (n, n)
        Added mass at infinite frequency; taken as known.
    fit : RadiationFit
        The subsystem of the mean parameters.
    parameters : dict
        name -> mean, std, prior_mean, prior_std, moved (change of the mean over the prior's standard deviation) and
        resolved (1 - posterior variance / prior variance). `inertia [dof]`, `stiffness [dof]`, `sensor [dof]`: relative
        changes of the model's nominal numbers.
    sea : dict
        Record -> Hs [m], Tp [s], gamma, each with mean, lower, upper; and tests of the sea model. Empty without one.
    information : dict
        "omega" and, per frequency, the shares "prior", "points", "data" of the estimate's precision: they add up to 1;
        "power": whether a record has power there. Without power the band is at least the prior's and "data" is zero.
    force : dict
        Record -> ForceEstimate; empty where the force was known.
    baseline : dict
        What doing nothing gives (parameters left at the prior mean), beside the estimate.
    warnings : tuple of str
    draws : ndarray, shape (S, d)
        Draws of the parameters from the posterior.
    prior : dict
        "A", "B", "K": the model's own coefficients, (nw, n, n).
    """

    method: str
    dofs: tuple[str, ...]
    omega: FloatArray
    A: Band
    B: Band
    K: Band
    K_zero: Band
    A_inf: FloatArray
    fit: RadiationFit
    parameters: Mapping[str, Mapping[str, float]]
    sea: Mapping[str, Any]
    information: Mapping[str, FloatArray]
    force: Mapping[str, ForceEstimate]
    baseline: Mapping[str, Any]
    warnings: tuple[str, ...]
    draws: FloatArray
    prior: Mapping[str, np.ndarray]

    def to_dict(self, force_files: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Return the JSON form of the interface."""
        return {"schema": SCHEMA, "method": self.method, "dofs": list(self.dofs), "level": LEVEL,
                "omega": self.omega.tolist(), "A": self.A.to_dict(), "B": self.B.to_dict(),
                "K_zero": self.K_zero.mean.tolist(), "K_zero_band": self.K_zero.to_dict(), "A_inf": self.A_inf.tolist(),
                "parameters": {name: dict(values) for name, values in self.parameters.items()}, "sea": _plain(self.sea),
                "information": _plain(self.information), "force": dict(force_files or {}),
                "baseline": _plain(self.baseline), "warnings": list(self.warnings)}

    def save(self, folder: str | Path) -> Path:
        """Write identify.json, force_<record>.csv for each estimated force, and pictures; return the folder."""
        return later(self, "save", folder)

    def plot(self) -> Figure:
        """Return a figure of A, B and the information shares of each diagonal entry."""
        return later(self, "plot")

    @property
    def spoken(self) -> tuple[tuple[float, float], ...]:
        """Ranges of omega [rad/s] at which the records have power."""
        power = np.asarray(self.information.get("power", np.ones(self.omega.size, dtype=bool)), dtype=bool)
        edges = np.flatnonzero(np.diff(np.r_[0, power.astype(int), 0]))
        return tuple((float(self.omega[a]), float(self.omega[b - 1])) for a, b in zip(edges[::2], edges[1::2]))

    def _coefficients(self) -> list[str]:
        """Return lines of A and B of each degree of freedom, at three frequencies that the data speak of."""
        lines = []
        power = np.asarray(self.information.get("power", np.ones(self.omega.size, dtype=bool)), dtype=bool)
        there = np.flatnonzero(power)
        picks = there[np.unique(np.linspace(0, there.size - 1, 5).astype(int)[1:4])] if there.size else there
        for j, dof in enumerate(self.dofs):
            for k in picks:
                values = "; ".join(f"{name} {band.mean[k, j, j]:.4g} ({band.lower[k, j, j]:.4g} to "
                                   f"{band.upper[k, j, j]:.4g}), model {self.prior[name][k, j, j]:.4g}"
                                   for name, band in (("A", self.A), ("B", self.B)))
                lines.append(f"  {dof} at {self.omega[k]:.3g} rad/s: {values}; {self.information['data'][k]:.0%} of it "
                             "from the data")
        return lines

    def __str__(self) -> str:
        ranges = ", ".join(f"{low:.3g} to {high:.3g}" for low, high in self.spoken) or "nowhere"
        lines = [f"{self.method}: {', '.join(self.dofs)}; in brackets 95 % bands",
                 f"  the data speak at {ranges} rad/s; elsewhere the answer is the model's, with the prior's band",
                 *self._coefficients(), "  parameters:"]
        for name, p in self.parameters.items():
            lines.append(f"  {name:>14s} {p['mean']:12.5g} +- {p['std']:.2g}  (prior {p['prior_mean']:.5g} +- "
                         f"{p['prior_std']:.2g}, moved {p['moved']:+.2f} sd, resolved {100 * p['resolved']:.0f} %)")
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])


def _plain(value: Any) -> Any:
    """Return nested dicts, lists and numbers that JSON takes; a number that is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Band):
        return value.to_dict()
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
