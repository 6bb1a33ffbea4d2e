"""The record of a fitted radiation subsystem."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray, read_only
from radiation_ss.errors import InputError
from radiation_ss.fit.certificate import Certificate, certify
from radiation_ss.fit.choices import Suspect, Trial
from radiation_ss.fit.rational import frequency_response, impulse_response, minimal, to_polynomials
from radiation_ss.hydro.data import HydroData, signal
from radiation_ss.methods import Shown, later

if TYPE_CHECKING:
    import control as ct
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class RadiationFit(Shown):
    """Strictly proper state-space model of K(s), body velocity to radiation force (the body feels minus it).

    Parameters
    ----------
    dofs : tuple of str
        Degrees of freedom, n of them.
    a, b, c : ndarray, shapes (N, N), (N, n), (n, N)
        Realisation of K(s) = c (s I - a)^-1 b.
    order : int
        Order asked for or chosen: the number of states of one entry, or of common poles of a joint fit.
    A_inf : ndarray, shape (n, n), optional
        Added mass at infinite frequency that K was formed with.
    method : str
        How it was fitted.
    at_zero : str or float
        What was asked of K(0): "free", "zero" or a value.
    points : tuple of float
        Frequencies [rad/s] where K is met exactly.
    blocks : tuple of tuple of str
        Degrees of freedom that were fitted together; those of different blocks are not coupled.
    relative_error : float
        ||K - K_fit|| / ||K|| over the data, entries scaled by S^-1 K S^-1 with s_i^2 = max_w |K_ii|, samples weighted
        as in the fit, without motions that do not radiate. More states never make it larger, but for a part in a
        thousand that rounding leaves.
    whole_error : float
        The same with all samples alike, as `audit` has it.
    entry_error : ndarray, shape (n, n), optional
        The same for each entry alone, all samples alike.
    data : HydroData, optional
        The data that were fitted, for the plots.
    suspects : tuple of Suspect
        Samples that were weighted down.
    path : tuple of tuple of Trial
        Orders that were tried for each block, where the order was chosen.
    notes : tuple of str
        Which solver did what for each block, what was changed in what was asked, and what of the data was left out.
    rho : float, optional
        Density [kg/m^3] of the data, where these are not there.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    >>> fit.stable, fit.passive, fit.to_ss().output_labels
    (True, True, ['heave_rad'])
    """

    dofs: tuple[str, ...]
    a: FloatArray
    b: FloatArray
    c: FloatArray
    order: int
    A_inf: FloatArray | None = None
    method: str = "casadi"
    at_zero: str | float = "free"
    points: tuple[float, ...] = ()
    blocks: tuple[tuple[str, ...], ...] = ()
    relative_error: float = np.nan
    whole_error: float = np.nan
    entry_error: FloatArray | None = None
    data: HydroData | None = None
    suspects: tuple[Suspect, ...] = ()
    path: tuple[tuple[Trial, ...], ...] = ()
    notes: tuple[str, ...] = ()
    rho: float | None = None

    def __post_init__(self) -> None:
        n, states = len(self.dofs), np.shape(self.a)[0]
        if len(set(self.dofs)) != n:
            raise InputError(f"fit: its degrees of freedom {list(self.dofs)} hold a name twice")
        for name, shape in (("a", (states, states)), ("b", (states, n)), ("c", (n, states))):
            object.__setattr__(self, name, read_only(getattr(self, name), name, shape))
        for name in ("A_inf", "entry_error"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, read_only(getattr(self, name), name, (n, n), finite=False))

    @property
    def density(self) -> float | None:
        """Density [kg/m^3] of the data that were fitted; None if it is not known."""
        return self.rho if self.data is None else self.data.rho

    @property
    def states(self) -> int:
        """Number of states of the realisation."""
        return self.a.shape[0]

    @cached_property
    def certificate(self) -> Certificate:
        """What is proved of the model: poles, positive realness, K(0)."""
        return certify(self.a, self.b, self.c)

    @property
    def stable(self) -> bool:
        """All poles in the open left half plane."""
        return self.certificate.stable

    @property
    def passive(self) -> bool:
        """The model cannot give energy to the body, at any frequency and for any combination of motions."""
        return self.certificate.passive

    @property
    def passivity_margin(self) -> float:
        """Smallest eigenvalue of the scaled Hermitian part over all frequencies, relative to the largest; at best 0."""
        return self.certificate.margin

    def __str__(self) -> str:
        error = "" if np.isnan(self.relative_error) else f", relative error {self.relative_error:.4f}"
        if abs(self.whole_error - self.relative_error) > 5e-5:
            error += f" ({self.whole_error:.4f} with the samples that were weighted down)"
        names = ", ".join(self.dofs if len(self.dofs) <= 12 else (*self.dofs[:3], "...", self.dofs[-1]))
        return f"RadiationFit of {names}\n  order {self.order}, {self.states} states{error}\n  {self.certificate}"

    def replace(self, **changes: object) -> RadiationFit:
        """Return a copy with some fields replaced, checked anew.

        >>> fit.replace(method="mine").method
        'mine'
        """
        return replace(self, **changes)  # type: ignore[arg-type]

    def renamed(self, dofs: Sequence[str]) -> RadiationFit:
        """Return the same model with other names of its degrees of freedom, in the same order.

        >>> fit.renamed(["Roll"]).dofs
        ('Roll',)
        """
        names = dict(zip(self.dofs, dofs, strict=True))
        return self.replace(dofs=tuple(dofs), data=None, path=(), suspects=(),
                            blocks=tuple(tuple(names[dof] for dof in block) for block in self.blocks))

    def select(self, dofs: Sequence[str]) -> RadiationFit:
        """Return the radiation model of some degrees of freedom, without the states that they do not reach.

        Raises
        ------
        InputError
            If a degree of freedom is not among the fit's.

        >>> fit.select(["Heave"]).states
        2
        """
        if absent := [dof for dof in dofs if dof not in self.dofs]:
            raise InputError(f"degree of freedom {absent[0]!r} is not among {list(self.dofs)}")
        pick = [self.dofs.index(dof) for dof in dofs]
        reached = np.any(self.b[:, pick] != 0.0, axis=1)
        for _ in range(self.states):
            reached = reached | ((self.a != 0.0) @ reached)
        A_inf = None if self.A_inf is None else self.A_inf[np.ix_(pick, pick)]
        return self.replace(dofs=tuple(dofs), a=self.a[np.ix_(reached, reached)], b=self.b[reached][:, pick],
                            c=self.c[pick][:, reached], A_inf=A_inf, entry_error=None, data=None, rho=self.density,
                            blocks=(), path=(), suspects=())

    def write(self, path: str | Path) -> Path:
        """Write the fit; the suffix says how (see `radiation_ss.fit.files.write_fit`).

        >>> fit.write("heave.ss").name
        'heave.ss'
        """
        return later("fit.files:write_fit", self, path)

    def frequency_response(self, omega: ArrayLike) -> ComplexArray:
        """Return K(iw), shape (nw, n, n), evaluated for all frequencies at once.

        >>> fit.frequency_response([0.5, 1.0]).shape
        (2, 1, 1)
        """
        return frequency_response(self.a, self.b, self.c, omega)

    def kernel(self, t: ArrayLike) -> FloatArray:
        """Return the retardation kernel L(t) = c exp(a t) b, shape (nt, n, n).

        >>> fit.kernel([0.0, 1.0]).shape
        (2, 1, 1)
        """
        return impulse_response(self.a, self.b, self.c, t)

    def plot(self, entries: list[tuple[str, str]] | None = None) -> Figure:
        """Draw added mass, damping, Nyquist plot and kernel against the data (see `report.plots.plot_fit`).

        >>> data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), [0.2 * k for k in range(1, 20)])
        >>> len(rss.fit_radiation(data.select("Heave"), 3).plot().axes)
        4
        """
        return later("report.plots:plot_fit", self, entries)

    def plot_path(self) -> Figure:
        """Draw the errors of the orders that were tried (see `report.plots.plot_path`).

        >>> data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), [0.2 * k for k in range(1, 20)])
        >>> figure = rss.fit_radiation(data.select("Heave")).plot_path()
        >>> figure.axes[0].get_xlabel()
        'order'
        """
        return later("report.plots:plot_path", self)

    def polynomials(self, force: int | str = 0, velocity: int | str = 0) -> tuple[FloatArray, FloatArray]:
        """Return (den, num) of one entry as in (23), without the states that the entry does not need.

        Parameters
        ----------
        force, velocity : int or str
            Degree of freedom of the force and of the velocity, by position or name.

        Returns
        -------
        den, num : ndarray, shape (n,)
            (a_1, ..., a_n) and (b_1, ..., b_n), constant term first; empty where the entry is zero.

        >>> [part.size for part in fit.polynomials()]
        [2, 2]
        """
        row, column = (self.dofs.index(k) if isinstance(k, str) else k for k in (force, velocity))
        a, b, c = self.a, self.b[:, [column]], self.c[[row]]
        if len(self.dofs) > 1:
            a, b, c = minimal(a, b, c)
        return to_polynomials(a, b, c)

    def price_of_passivity(self) -> tuple[float, float]:
        """Return (error of this fit, error of the free fit of the same order): what passivity costs.

        Raises
        ------
        InputError
            If the fit does not carry its data.

        >>> data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 20)).select("Heave")
        >>> passive, free = rss.fit_radiation(data, 3).price_of_passivity()
        >>> passive >= free
        True
        """
        return later("fit.radiation:price_of_passivity", self)

    def to_ss(self) -> ct.StateSpace:
        """Return the native python-control system: inputs `<dof>_vel`, outputs `<dof>_rad`, states named.

        >>> fit.to_ss().output_labels
        ['heave_rad']
        """
        import control as ct

        stems = [signal(dof) for dof in self.dofs]
        return ct.ss(self.a, self.b, self.c, np.zeros((len(stems), len(stems))),
                     inputs=[f"{s}_vel" for s in stems], outputs=[f"{s}_rad" for s in stems],
                     states=[f"rad{i + 1}" for i in range(self.states)], name="radiation")
