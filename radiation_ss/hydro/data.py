"""Hydrodynamic coefficients of a floating body as one frozen, checked record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray, couples, positive, reached, read_only
from radiation_ss.errors import InputError
from radiation_ss.methods import Shown, later

if TYPE_CHECKING:
    import control as ct
    import xarray as xr
    from matplotlib.figure import Figure

    from radiation_ss.hydro.findings import QualityReport

ROTATIONS = ("Roll", "Pitch", "Yaw")
TRANSLATIONS = ("Surge", "Sway", "Heave")
RIGID = TRANSLATIONS + ROTATIONS
MATRICES = ("A_inf", "A_zero", "M", "C", "D")  # one for all frequencies, or none


def mode(dof: str) -> str:
    """Return the rigid-body mode of a degree of freedom: 'Heave' of 'float__Heave'."""
    return dof.rsplit("__", 1)[-1]


def body(dof: str) -> str:
    """Return the body of a degree of freedom: 'float' of 'float__Heave', '' where only one body is there."""
    return dof.rsplit("__", 1)[0] if "__" in dof else ""


def motion_unit(dof: str) -> str:
    """Return the unit of the displacement, 'm' or 'rad'."""
    return "rad" if mode(dof) in ROTATIONS else "m"


def force_unit(dof: str) -> str:
    """Return the unit of the generalised force, 'N' or 'N m'."""
    return "N m" if mode(dof) in ROTATIONS else "N"


@dataclass(frozen=True, eq=False, repr=False)
class HydroData(Shown):
    """Added mass, damping, exciting force and inertia of a body in waves, SI, time factor e^{+i w t}.

    Parameters
    ----------
    omega : array_like, shape (nw,)
        Circular frequencies [rad/s], positive, strictly ascending.
    A, B : array_like, shape (nw, n, n)
        Added mass [kg, kg m, kg m^2] and radiation damping [kg/s, kg m/s, kg m^2/s].
    A_inf : array_like, shape (n, n), optional
        Added mass at infinite frequency. None where the source does not give it.
    dofs : sequence of str
        Names of the degrees of freedom: Surge, Sway, Heave, Roll, Pitch, Yaw; `body__Heave` for several bodies.
    rho, g, depth : float
        Water density [kg/m^3], gravity [m/s^2], water depth [m] (inf for deep water).
    M, C : array_like, shape (n, n), optional
        Rigid-body mass matrix and hydrostatic (plus mooring) stiffness.
    D : array_like, shape (n, n), optional
        Linear damping that is not radiation (power take-off, mooring).
    X : array_like, shape (nw, n_dir, n), optional
        Complex exciting force per metre wave amplitude; force(t) = Re[X a e^{i w t}] for a wave
        of elevation a cos(w t) at the origin.
    directions : array_like, shape (n_dir,), optional
        Directions of propagation [rad] that belong to X.
    reference_point : tuple of float
        Point (x, y, z) [m] about which rotations and moments are taken, z up from the still water surface;
        NaN where the source does not say, or bodies have their own points.
    A_zero : array_like, shape (n, n), optional
        Added mass at zero frequency where the source gives it.
    source : str
        Where the data come from, for messages.
    notes : sequence of str, optional
        What a reader had to assume or leave out.

    Raises
    ------
    InputError
        If a field has the wrong shape or unit range, is not finite, or frequencies are not ascending.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> omega = np.array([0.5, 1.0, 2.0, 4.0])
    >>> A, B = 3.0 + 1.0 / (1.0 + omega**2), omega**2 / (1.0 + omega**2)
    >>> data = rss.HydroData(omega, A[:, None, None], B[:, None, None], [[3.0]], ("Heave",))
    >>> data.K.shape, data.times(2.0).B[1, 0, 0], data.to_frd().input_labels
    ((4, 1, 1), np.float64(1.0), ['heave_vel'])
    """

    omega: FloatArray
    A: FloatArray
    B: FloatArray
    A_inf: FloatArray | None = None
    dofs: tuple[str, ...] = ()
    rho: float = 1000.0
    g: float = 9.81
    depth: float = np.inf
    M: FloatArray | None = None
    C: FloatArray | None = None
    X: ComplexArray | None = None
    D: FloatArray | None = None
    directions: FloatArray | None = None
    reference_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    A_zero: FloatArray | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        dofs = (self.dofs,) if isinstance(self.dofs, str) else tuple(str(dof) for dof in self.dofs)
        n = len(dofs)
        if n == 0:
            raise InputError("dofs: empty; name each degree of freedom, for example ('Heave',)")
        if len(set(dofs)) != n:
            raise InputError(f"dofs: {list(dofs)} holds a name twice")
        omega = read_only(self.omega, "omega", (None,))
        if omega.size == 0 or omega[0] <= 0.0:
            raise InputError("omega: must be positive frequencies in rad/s (limits go into A_zero and A_inf)")
        if (late := np.flatnonzero(np.diff(omega) <= 0.0)).size:
            at = int(late[0]) + 1
            raise InputError(f"omega: must ascend without repeats, but omega[{at}] = {omega[at]:g} rad/s "
                             f"follows {omega[at - 1]:g} rad/s")
        nw = omega.size
        fixed: dict[str, object] = {"dofs": dofs, "omega": omega, "A": read_only(self.A, "A", (nw, n, n)),
                                    "B": read_only(self.B, "B", (nw, n, n))}
        fixed |= {name: read_only(value, name, (n, n)) for name in MATRICES
                  if (value := getattr(self, name)) is not None}
        if self.X is not None:
            fixed["X"] = X = read_only(self.X, "X", (nw, None, n), dtype=complex)
            if self.directions is None and X.shape[1] > 1:
                raise InputError(f"directions: missing; where the {X.shape[1]} waves of X run to is needed [rad]")
            directions = self.directions if self.directions is not None else np.zeros(X.shape[1])
            fixed["directions"] = angles = read_only(directions, "directions", (X.shape[1],))
            if (far := np.abs(angles).max(initial=0.0)) > 2.0 * np.pi + 1e-6:
                raise InputError(f"directions: {far:g} is too much for radians; np.deg2rad turns degrees")
            _refuse_two_forces(X, angles, dofs)
        for name, unit in (("rho", "kg/m^3"), ("g", "m/s^2"), ("depth", "m")):
            fixed[name] = positive(getattr(self, name), name, unit, or_infinite=name == "depth")
        point = read_only(self.reference_point, "reference_point (x, y, z) [m]", (3,), finite=False)
        fixed["reference_point"] = tuple(point.tolist())
        for name, value in fixed.items():
            object.__setattr__(self, name, value)

    def __str__(self) -> str:
        return later("hydro.clean:text", self)

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dofs)

    @property
    def K(self) -> ComplexArray:
        """Radiation transfer function K(iw) = B + i w (A - A_inf), shape (nw, n, n); velocity to force (2)-(4).

        InputError if A_inf is missing; `with_A_inf()` estimates it.
        """
        if self.A_inf is None:
            raise InputError(f"{self.source or 'data'}: A_inf is missing; use data.with_A_inf() to estimate it")
        return self.B + 1j * self.omega[:, None, None] * (self.A - self.A_inf)

    def index(self, dof: str) -> int:
        """Return the position of a degree of freedom; InputError names the ones there are.

        >>> data.index("Heave")
        0
        """
        if dof not in self.dofs:
            raise InputError(f"degree of freedom {dof!r} is not among {list(self.dofs)}")
        return self.dofs.index(dof)

    def select(self, dofs: Sequence[str] | str) -> HydroData:
        """Return the data of some degrees of freedom, in the order given.

        >>> data.select(["Heave"]).dofs
        ('Heave',)
        """
        names = (dofs,) if isinstance(dofs, str) else tuple(dofs)
        pick = [self.index(dof) for dof in names]
        rows, columns = np.ix_(pick, pick)
        return self.mapped(lambda matrix: matrix[..., rows, columns], lambda X: X[..., pick], dofs=names)

    def coupled(self, dofs: Sequence[str], least: float = 0.03, noise: float = 1e-3) -> tuple[str, ...]:
        """Return these degrees of freedom and those that inertia, stiffness or radiation couple to them by `least`.

        Of the geometric mean of both diagonals; less changes an impedance by a thousandth. A diagonal counts as a share
        `noise` of the inertia's part of the impedance at least: that of a mode that does not radiate is rounding.

        >>> data.coupled(data.dofs[:1])
        ('Heave',)
        """
        inertia, omega = (self.A if self.M is None else self.A + self.M).mean(axis=0), float(np.mean(self.omega))
        others = ((self.B.mean(axis=0), omega), (self.D, omega), (self.C, omega**2))
        return tuple(self.dofs[i] for i in reached(couples(inertia, others, least, noise), [*map(self.index, dofs)]))

    def times(self, length: float) -> HydroData:
        """Return the data of a prismatic body of this length [m] from data per unit length (strip of a section).

        >>> data.times(2.0).A_inf
        array([[6.]])
        """
        length = positive(length, "length", "m")
        return self.mapped(lambda matrix: matrix * length, lambda X: X * length)

    def mapped(self, matrix: Callable[[FloatArray], FloatArray], force: Callable[[ComplexArray], ComplexArray],
               **changes: object) -> HydroData:
        """Return a copy whose matrices (..., n, n) and exciting force (nw, n_dir, n) are what functions make of them.

        >>> data.mapped(lambda matrix: 3.0 * matrix, lambda X: X).A_inf
        array([[9.]])
        """
        there = {name: matrix(value) for name in ("A", "B", *MATRICES) if (value := getattr(self, name)) is not None}
        return self.replace(X=None if self.X is None else force(self.X), **there, **changes)

    def replace(self, **changes: ArrayLike | object) -> HydroData:
        """Return a copy with some fields replaced, checked anew.

        >>> data.replace(rho=1025.0).rho
        1025.0
        """
        return replace(self, **changes)  # type: ignore[arg-type]

    def rao(self) -> ComplexArray:
        """Return the motion per metre wave amplitude, (C + i w (B + D) - w^2 (M + A)) xi = X, shape (nw, n_dir, n).

        Response amplitude operator, m/m or rad/m, phase as that of X; A and B as they are, without a fit. InputError if
        M, C or X is missing.

        >>> moved = data.replace(M=[[2.0]], C=[[8.0]], X=np.full((4, 1, 1), 4.0), directions=[0.0])
        >>> float(np.round(abs(moved.rao()[1, 0, 0]), 2))
        1.57
        """
        return later("hydro.clean:rao", self)

    def kernel(self, t: ArrayLike) -> FloatArray:
        """Return the retardation kernel L(t) from the damping (2), shape (nt, n, n); see `transforms.kernel`.

        >>> data.kernel([0.0, 1.0]).shape
        (2, 1, 1)
        """
        return later("hydro.transforms:kernel", self.omega, self.B, t)

    def with_A_inf(self) -> HydroData:
        """Return the data with A_inf estimated from A and B where it is missing, and a note of its uncertainty.

        >>> data.with_A_inf().A_inf
        array([[3.]])
        """
        return later("hydro.clean:with_A_inf", self)

    def at(self, reference_point: Sequence[float]) -> HydroData:
        """Return the data about another reference point (x, y, z) [m]; see `hydro.clean.at`.

        >>> data.at((0.0, 0.0, -1.0)).reference_point
        (0.0, 0.0, -1.0)
        """
        return later("hydro.clean:at", self, reference_point)

    def check(self, tolerance: float = 0.03) -> QualityReport:
        """Return what is wrong with the coefficients, as text and picture; see `quality.check`.

        >>> print(str(data.check()).splitlines()[0])
        coefficients: 1 degree of freedom, 4 frequencies from 0.5 to 4 rad/s, rho 1000 kg/m^3, depth inf m
        """
        return later("hydro.quality:check", self, tolerance)

    def clean(self, **repairs: Any) -> HydroData:
        """Return the data with the repairs that are asked for, each said in the notes; see `clean.clean`.

        >>> data.clean(negative_damping=True).notes
        ('clean: no negative damping to lift',)
        """
        return later("hydro.clean:clean", self, **repairs)

    def plot(self, dofs: Sequence[str] | str | None = None) -> Figure:
        """Draw added mass, damping and exciting force over frequency; see `report.plots.plot_hydro`.

        >>> len(data.plot().axes)
        2
        """
        return later("report.plots:plot_hydro", self, dofs)

    def to_xarray(self) -> xr.Dataset:
        """Return the data as a dataset in Capytaine's form; `read_hydro` takes it back with the same numbers.

        >>> float(rss.read_hydro(data.to_xarray()).B[1, 0, 0])
        0.5
        """
        return later("hydro.readers.capytaine:to_dataset", self)

    def to_frd(self) -> ct.FrequencyResponseData:
        """Return K(iw) as ct.FrequencyResponseData: inputs `<dof>_vel`, outputs `<dof>_rad`.

        >>> data.to_frd().output_labels
        ['heave_rad']
        """
        import control as ct

        return ct.frd(np.moveaxis(self.K, 0, -1), self.omega, inputs=[f"{signal(d)}_vel" for d in self.dofs],
                      outputs=[f"{signal(d)}_rad" for d in self.dofs], name="radiation")


def _refuse_two_forces(X: ComplexArray, angles: FloatArray, dofs: tuple[str, ...], alike: float = 0.01) -> None:
    """Refuse forces of one direction, but for whole turns, that differ by more than a share of the largest."""
    for i, j in np.argwhere(np.triu(np.abs(np.exp(1j * (angles[:, None] - angles)) - 1.0) < 1e-6, 1)):
        for unit in {motion_unit(dof) for dof in dofs}:
            forces = X[:, :, [motion_unit(dof) == unit for dof in dofs]]
            if np.abs(forces[:, i] - forces[:, j]).max() > alike * np.abs(forces).max():
                raise InputError(f"directions: {np.degrees(angles[i]):.6g} and {np.degrees(angles[j]):.6g} deg are one "
                                 "direction, and have different forces; give each direction once")


def signal(dof: str) -> str:
    """Return the signal stem of a degree of freedom: 'heave' of 'Heave', 'float_heave' of 'float__Heave'."""
    return dof.replace("__", "_").replace(".", "_").replace(" ", "_").lower()
