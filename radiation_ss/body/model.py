"""The linear model of a floating body: inertia, stiffness, damping and radiation memory."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, FrozenMap, read_only
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro import velocity_transform
from radiation_ss.hydro.data import HydroData
from radiation_ss.methods import Shown, later

if TYPE_CHECKING:
    import control as ct
    from matplotlib.figure import Figure


TOLERANCES = ("mass", "stiffness", "A_inf", "kernel", "force")


@dataclass(frozen=True, eq=False, repr=False)
class Model(Shown):
    """Cummins model (1): (M + A_inf) xi'' + D xi' + int L(t - tau) xi'(tau) dtau + C xi = f.

    Parameters
    ----------
    dofs : tuple of str
    M, A_inf, C : ndarray, shape (n, n)
        Rigid-body mass, added mass at infinite frequency, stiffness (hydrostatic plus mooring), SI. A stiffness of zero
        is lawful: surge, sway and yaw of an unmoored body.
    fit : RadiationFit
        The radiation model, a subsystem from velocity to radiation force.
    D : ndarray, shape (n, n), optional
        Linear damping that is not radiation; zero if not given.
    hydro : HydroData, optional
        The coefficients that the fit was made from; carries the exciting force X.
    name : str
    tolerance : mapping of str to float, optional
        How far the numbers may be off, relative (0.1 is 10 %), by name: mass, stiffness, A_inf, kernel, force. What is
        absent is not stated.

    Raises
    ------
    InputError
        If a matrix has another shape, an inertia or M + A_inf is not positive, the fit has other degrees of freedom, or
        a tolerance has another name or is not between 0 and 1.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    >>> model = rss.Model(("Heave",), [[50.0]], [[30.0]], [[3000.0]], fit)
    >>> model.to_ss().state_labels[-2:]
    ['heave', 'heave_vel']
    """

    dofs: tuple[str, ...]
    M: FloatArray
    A_inf: FloatArray
    C: FloatArray
    fit: RadiationFit
    D: FloatArray = field(default=None)  # type: ignore[assignment, arg-type]
    hydro: HydroData | None = None
    name: str = "body"
    tolerance: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.dofs)
        if tuple(self.fit.dofs) != tuple(self.dofs):
            raise InputError(f"fit: its degrees of freedom {list(self.fit.dofs)} are not the model's {list(self.dofs)}")
        if self.D is None:
            object.__setattr__(self, "D", np.zeros((n, n)))
        for name in ("M", "A_inf", "C", "D"):
            object.__setattr__(self, name, read_only(getattr(self, name), name, (n, n)))
        for dof, mass in zip(self.dofs, np.diag(self.M)):
            if mass <= 0.0:
                raise InputError(f"M: the inertia of {dof} is {mass:.4g}; it must be positive")
        inertia = self.M + self.A_inf
        if np.linalg.eigvalsh(0.5 * (inertia + inertia.T))[0] <= 0.0:
            raise InputError("M + A_inf: not positive definite; check the mass matrix and its reference point")
        # What swings no faster than in 1e6 s is a mesh's integral of zero: the waterline of a submerged body.
        least = (2.0 * np.pi / 1e6) ** 2 * np.sqrt(np.outer(np.diag(inertia), np.diag(inertia)))
        object.__setattr__(self, "C", read_only(np.where(np.abs(self.C) < least, 0.0, self.C), "C", (n, n)))
        object.__setattr__(self, "tolerance", checked_tolerance(self.tolerance))

    @classmethod
    def from_hydro(cls, data: HydroData, fit: RadiationFit | None = None, *, dofs: Sequence[str] | None = None,
                   order: int | None = None, accuracy: float | None = None, **fit_options: object) -> Model:
        """Build the model from data with inertia and hydrostatics; fit the memory unless a fit is given.

        A missing A_inf is estimated; `hydro.notes` then says so, with its uncertainty.
        With `accuracy` (and no order) the order is raised up to 8 until the relative error of the fit is below it. A
        fit that misses what a motion feels at its natural frequency is made again, exact there, and one that damps a
        motion without stiffness at rest with K(0) = 0; `fit.notes` says so.

        Raises
        ------
        InputError
            If M or C is missing, or the fit is not stable or of another body.

        Warns
        -----
        InputWarning
            If C is negative in some motion: the body is statically unstable. If M or A_inf is not symmetric: it is not
            passive. If the fit is not passive, or further off the data than it states.

        >>> section = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), [0.2 * k for k in range(1, 20)]).select("Heave")
        >>> rss.Model.from_hydro(section.replace(M=[[1500.0]]), order=3).fit.states
        3
        """
        return later("body.dynamics:from_hydro", data, fit, dofs, order, accuracy, fit_options)

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    def matrices(self) -> tuple[FloatArray, FloatArray]:
        """Return (F, G) of x' = F x + G f with x = [radiation states; displacement; velocity] (9)-(13).

        >>> [matrix.shape for matrix in model.matrices()]
        [(4, 4), (4, 1)]
        """
        return equation_of_motion(self.M + self.A_inf, self.D, self.C, (self.fit.a, self.fit.b, self.fit.c))

    def to_ss(self) -> ct.StateSpace:
        """Return the composite as ct.StateSpace: inputs `<dof>_force`, outputs `<dof>`, `<dof>_vel`, `<dof>_acc`.

        >>> model.to_ss().input_labels
        ['heave_force']
        """
        return later("body.composite:cummins", self)

    def attached(self, *, stiffness: Mapping[str, float] | ArrayLike | None = None,
                 damping: Mapping[str, float] | ArrayLike | None = None) -> Model:
        """Return the model with linear springs and dampers added (mooring, power take-off).

        Parameters
        ----------
        stiffness, damping : mapping of dof to number, or array_like of shape (n, n), optional
            [N/m, N s/m] for translations, [N m/rad, N m s/rad] for rotations.

        >>> float(model.attached(stiffness={"Heave": 500.0}).C[0, 0])
        3500.0
        """
        return self.replace(C=self.C + linear_terms(stiffness, self.dofs, "stiffness"),
                            D=self.D + linear_terms(damping, self.dofs, "damping"))

    def at(self, reference_point: Sequence[float], origin: Sequence[float] | None = None) -> Model:
        """Return the model about another reference point: matrices T^T (.) T, memory T^T K T (A.1)-(A.11).

        A congruence: a passive memory stays passive. See `hydro.clean.at`.

        Parameters
        ----------
        reference_point : sequence of float
            The new point (x, y, z) [m], z up from the still water surface.
        origin : sequence of float, optional
            The point that the model refers to now; that of its hydrodynamic data if absent.

        Raises
        ------
        InputError
            If the present point is not known, or a translation is missing that a rotation brings in.

        >>> model.at((0.0, 0.0, -1.0), origin=(0.0, 0.0, 0.0)).M
        array([[50.]])
        """
        if origin is None:
            if self.hydro is None:
                raise InputError("origin: the model has no data that name its reference point; give it")
            origin = self.hydro.reference_point
        old, new = (read_only(point, f"{name} (x, y, z) [m]", (3,), finite=False) for name, point in
                    (("origin", origin), ("reference_point", reference_point)))
        T = velocity_transform(self.dofs, old - new)
        moved = {name: T.T @ getattr(self, name) @ T for name in ("M", "A_inf", "C", "D")}
        hydro = None if self.hydro is None else self.hydro.at(reference_point)
        A_inf = None if self.fit.A_inf is None else T.T @ self.fit.A_inf @ T
        fit = self.fit.replace(b=self.fit.b @ T, c=T.T @ self.fit.c, A_inf=A_inf, entry_error=None, data=hydro)
        return self.replace(**moved, fit=fit, hydro=hydro)

    def __str__(self) -> str:
        return later("body.dynamics:text", self)

    def plot(self) -> Figure:
        """Draw motion per force and damping over frequency (see `report.plots.plot_model`).

        >>> len(model.plot().axes)
        2
        """
        return later("report.plots:plot_model", self)

    def write(self, path: str | Path) -> None:
        """Write the model as a Capytaine dataset, .nc (see `radiation_ss.body.convert.write_model`).

        >>> model.write("buoy.nc")
        >>> rss.read_model("buoy.nc").dofs
        ('Heave',)
        """
        later("body.convert:write_model", self, path)

    def replace(self, **changes: object) -> Model:
        """Return a copy with some fields replaced, checked anew.

        >>> model.replace(name="buoy").name
        'buoy'
        """
        return replace(self, **changes)  # type: ignore[arg-type]


def checked_tolerance(given: float | Mapping[str, float], names: Collection[str] = TOLERANCES, *,
                      exact: bool = False) -> FrozenMap[str, float]:
    """Return relative tolerances by name, or one number for all names; `exact`: one may be 0."""
    given = dict(given) if isinstance(given, Mapping) else dict.fromkeys(names, given)
    for name, value in given.items():
        if name not in names:
            raise InputError(f"tolerance: {name!r} is unknown; use {', '.join(names)}")
        if not isinstance(value, int | float | np.number) or not (0.0 < value < 1.0 or (exact and value == 0.0)):
            raise InputError(f"tolerance of {name}: {value!r}; a share between 0 and 1 is needed (0.02 is 2 %)")
    return FrozenMap({name: float(given[name]) for name in names if name in given})


def equation_of_motion(inertia: FloatArray, damping: FloatArray, stiffness: FloatArray,
                       memory: tuple[FloatArray, FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return (F, G) of `Model.matrices`, of several bodies along leading axes; memory (a, b, c) realises radiation."""
    (a, b, c), inverse = memory, np.linalg.inv(inertia)
    n, m = inverse.shape[-1], a.shape[-1]
    F = np.zeros((*inverse.shape[:-2], m + 2 * n, m + 2 * n))
    F[..., :m, :m], F[..., :m, m + n:], F[..., m:m + n, m + n:] = a, b, np.eye(n)
    F[..., m + n:, :m], F[..., m + n:, m:m + n] = -inverse @ c, -inverse @ stiffness
    F[..., m + n:, m + n:] = -inverse @ damping
    return F, np.concatenate([np.zeros((*inverse.shape[:-2], m + n, n)), inverse], axis=-2)


def linear_terms(value: Mapping[str, float] | ArrayLike | None, dofs: Sequence[str], label: str) -> FloatArray:
    """Return a matrix (n, n) from numbers by degree of freedom (a diagonal) or from a matrix; zero for None."""
    n = len(dofs)
    if value is None:
        return np.zeros((n, n))
    if isinstance(value, Mapping):
        if unknown := [dof for dof in value if dof not in dofs]:
            raise InputError(f"{label}: degree of freedom {unknown[0]!r} is not among {list(dofs)}")
        value = np.diag(read_only([value.get(dof, 0.0) for dof in dofs], label, (n,)))
    return read_only(np.atleast_2d(value), label, (n, n))
