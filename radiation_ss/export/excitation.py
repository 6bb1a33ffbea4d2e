"""Wave excitation as a state-space model, and OpenFAST's .ssexctn (ExctnMod = 2).

HydroDyn integrates x' = A x + B eta(t + tc) with the wave elevation eta at the origin, and adds C x to the loads
(SS_Excitation.f90). Excitation is not causal, the force leads the elevation at the body, so the elevation is taken tc
ahead: X(w) = C (i w I - A)^-1 B exp(i w tc).
"""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from radiation_ss.arrays import ComplexArray, FloatArray, read_only
from radiation_ss.atomic import write_rows
from radiation_ss.errors import InputError
from radiation_ss.fit.rational import Realisation, frequency_response
from radiation_ss.fit.start import least_squares
from radiation_ss.hydro.data import HydroData, force_unit
from radiation_ss.hydro.files import as_data
from radiation_ss.hydro.readers.assemble import six_dofs, six_places
from radiation_ss.hydro.readers.text import head_and_rows, index, leading
from radiation_ss.methods import Brief

log = logging.getLogger("radiation_ss")


@dataclass(frozen=True, eq=False, repr=False)
class ExcitationFit(Brief):
    """State-space model of the wave excitation force per metre of elevation in one direction."""

    dofs: tuple[str, ...]
    # a, b, c (N, N), (N, 1), (n, N)
    a: FloatArray
    b: FloatArray
    c: FloatArray
    lead: float  # How far ahead the elevation is taken, tc [s]
    direction: float  # Wave direction [rad]
    # ||X - X_fit|| / ||X|| over all samples, each degree of freedom scaled by its largest |X|; see `fit_excitation`
    relative_error: float = np.nan

    def __str__(self) -> str:
        error = "not known" if np.isnan(self.relative_error) else f"{self.relative_error:.3f}"
        return (f"ExcitationFit of {', '.join(self.dofs)}: {self.a.shape[0]} states, waves to "
                f"{np.degrees(self.direction):g} deg, elevation {self.lead:g} s ahead, relative error {error}")

    def frequency_response(self, omega: ArrayLike) -> ComplexArray:
        """Return X(w), shape (nw, n)."""
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        return frequency_response(self.a, self.b, self.c, w)[:, :, 0] * np.exp(1j * w * self.lead)[:, None]

    def write(self, path: str | Path) -> Path:
        """Write OpenFAST's .ssexctn, six rows of C for each body."""
        target = Path(path)
        places, bodies = six_places(self.dofs, target)
        N, n = self.a.shape[0], 6 * len(bodies)
        if len(bodies) > 1:
            raise InputError(f"{target.name}: {len(bodies)} bodies found; HydroDyn takes the elevation at each body: "
                             "fit and write each alone (data.select)")
        c = np.zeros((n, N))
        c[places] = self.c
        # All states serve all degrees of freedom; HydroDyn uses the sum of the numbers only.
        owned = [N if k == places[0] else 0 for k in range(n)]
        lines = ["radiation_ss: state-space wave excitation model",
                 f"{np.degrees(self.direction):g}    %Wave heading angle [deg]",
                 f"{self.lead:.10g}    %time offset (tc) [s]", f"{N}    %total # of states",
                 f"{' '.join(map(str, owned))}    %# states per degree of freedom"]
        write_rows(target, lines, (self.a, self.b, c))
        return target


def fit_excitation(data: HydroData, direction: float = 0.0, states: int | None = None, lead: float | None = None,
                   passes: int = 12, least: float = 0.01, resolved: float = 0.1) -> ExcitationFit:
    """Fit the wave excitation force of one direction by vector fitting with poles shared by all degrees of freedom.

    Gustavsen & Semlyen 1999, IEEE Trans. Power Delivery 14, 1052; unstable poles are mirrored.

    Parameters
    ----------
    data : HydroData, xarray.Dataset or path
        With X.
    direction : float
        One of the data's directions [rad].
    states : int, optional
        Number of states of the whole model; by default 30, or the number of frequencies if that is smaller.
    lead : float, optional
        How far ahead the elevation is taken [s]; by default the best of a quarter to three periods of the wave where
        the force is largest.
    passes : int
        Relocations of the poles.
    least : float
        Each degree of freedom counts in units of its largest |X|, but of no less than this share of the largest force,
        or moment, of all: what symmetry makes zero but for rounding is no force to be fitted.
    resolved : float
        Least damping rate of a pole within the band over the spacing of the frequencies; what is narrower, as at
        irregular frequencies, is warned of.

    Raises
    ------
    InputError
        If the data have no excitation in this direction, or fewer frequencies than states.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 40)).select("Heave")
    >>> fit = rss.fit_excitation(data, data.directions[0], states=8)
    >>> fit.a.shape, bool(np.linalg.eigvals(fit.a).real.max() < 0.0)
    ((8, 8), True)
    """
    data = as_data(data)
    if data.X is None or data.directions is None:
        raise InputError(f"{data.source or 'data'}: no wave excitation forces X; read them with the coefficients")
    at = np.flatnonzero(np.isclose(np.asarray(data.directions), direction, atol=1e-6))
    if not at.size:
        raise InputError(f"direction: {np.degrees(direction):g} deg found; the data have "
                         f"{', '.join(f'{np.degrees(v):g}' for v in np.asarray(data.directions))} deg")
    there = np.isfinite(data.X[:, at[0]]).all(axis=1)
    omega, X = data.omega[there], data.X[there, at[0]]
    states = min(30, omega.size) if states is None else states
    if not 2 <= states <= omega.size or states != int(states):
        raise InputError(f"states: {states} found; 2 to {omega.size}, the number of frequencies with a force, needed")
    size = np.abs(X).max(axis=0)
    if not size.any():
        raise InputError(f"{data.source or 'data'}: X is zero in direction {np.degrees(direction):g} deg")
    turning = np.array([force_unit(dof) == "N m" for dof in data.dofs])
    size = np.maximum(size, least * np.where(turning, size.max(where=turning, initial=0.0),
                                             size.max(where=~turning, initial=0.0)))
    active = size > 0.0
    Y = X[:, active] / size[active]
    peak = omega[int(np.argmax(np.abs(Y).sum(axis=1)))]
    leads = (2.0 * np.pi / peak * np.arange(0.25, 3.01, 0.25) if lead is None
             else read_only(np.atleast_1d(lead), "lead [s]", (1,)))

    def fitted(tc: float) -> ExcitationFit:
        ahead = Y * np.exp(-1j * omega * tc)[:, None]
        a, b, scaled = _vector_fit(omega, ahead, int(states), passes)
        error = float(np.linalg.norm(frequency_response(a, b, scaled, omega)[:, :, 0] - ahead) / np.linalg.norm(Y))
        c = np.zeros((data.n, a.shape[0]))
        c[active] = size[active, None] * scaled
        return ExcitationFit(data.dofs, a, b, c, float(tc), float(direction), error)

    best = min(map(fitted, leads), key=lambda fit: fit.relative_error)
    poles = np.linalg.eigvals(best.a)
    step = np.interp(poles.imag, omega, np.gradient(omega))
    narrow = np.flatnonzero((poles.imag > omega[0]) & (poles.imag < omega[-1]) & (-poles.real < resolved * step))
    if narrow.size:
        k = narrow[np.argmin(-poles.real[narrow])]
        log.warning("%s: %d of %d poles of the excitation decay far more slowly than frequencies %.2g rad/s apart "
                    "resolve (%.2g 1/s at %.4g rad/s): irregular frequencies, or too many states",
                    data.source or "data", narrow.size, states, step[k], -poles.real[k], poles.imag[k])
    return best


def _vector_fit(omega: FloatArray, Y: ComplexArray, states: int, passes: int) -> Realisation:
    """Return (a, b, c) of the strictly proper model Y(w) = c (i w I - a)^-1 b, shape (nw, outputs)."""
    at = np.linspace(omega[0], omega[-1], states // 2)
    poles = -0.05 * at + 1j * at
    real = np.full(states % 2, -omega[-1])
    for _ in range(passes):
        a, b = _modal(poles, real)
        basis = frequency_response(a, b, np.eye(states), omega)[:, :, 0]
        rows = []
        for y in Y.T:
            # c basis - y d basis = y: the part of the rows that c cannot reach tells d.
            left, right = _real(basis), _real(np.c_[-y[:, None] * basis, y])
            q = np.linalg.qr(left)[0]
            rows.append(right - q @ (q.T @ right))
        stacked = np.vstack(rows)
        d = least_squares(stacked[:, :-1], stacked[:, -1])
        roots = np.linalg.eigvals(a - b @ d[None, :])
        roots = -np.abs(roots.real) - 1e-6 * omega[-1] + 1j * roots.imag
        poles, real = (roots[roots.imag > 1e-9 * omega[-1]],
                       np.sort(roots[np.abs(roots.imag) <= 1e-9 * omega[-1]].real))
    a, b = _modal(poles, real)
    basis = frequency_response(a, b, np.eye(states), omega)[:, :, 0]
    return a, b, np.stack([least_squares(basis, y) for y in Y.T])


def _modal(poles: ComplexArray, real: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the real modal form of pairs and real poles."""
    blocks = np.moveaxis(np.array([[poles.real, poles.imag], [-poles.imag, poles.real]]), -1, 0)
    return block_diag(*blocks, np.diag(real)), np.r_[np.tile([2.0, 0.0], poles.size), np.ones(real.size)][:, None]


def _real(rows: ComplexArray) -> FloatArray:
    return np.vstack([rows.real, rows.imag])


def read_excitation(path: str | Path) -> ExcitationFit:
    """Read OpenFAST's .ssexctn.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    ExcitationFit

    Raises
    ------
    InputError
        If the numbers of rows do not fit the header.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 40)).select("Heave")
    >>> fit = rss.fit_excitation(data, data.directions[0], states=8)
    >>> again = rss.read_excitation(fit.write("heave.ssexctn"))
    >>> bool(np.allclose(again.frequency_response(1.0).ravel()[2], fit.frequency_response(1.0)))
    True
    """
    source = Path(path)
    head, rows = head_and_rows(source, 5, "an OpenFAST .ssexctn file")
    angle, lead, states = (leading(source, k, head[k], 1, what)[0] for k, what in (
        (1, "wave heading [deg]"), (2, "time offset [s]"), (3, "number of states")))
    N = index(source, 3, states, 10_000, "number of states")
    n = len(rows) - 2 * N
    if n < 6 or n % 6 or [len(row) for row in rows] != [N] * N + [1] * N + [N] * n:
        raise InputError(f"{source.name}: {len(rows)} rows of numbers; {N} states need {N} rows of {N}, {N} of 1 "
                         f"and 6 of {N} for each body")
    names = six_dofs([""] * (n // 6))
    return ExcitationFit(names, np.reshape(rows[:N], (N, N)), np.reshape(rows[N:2 * N], (N, 1)),
                         np.reshape(rows[2 * N:], (n, N)), lead, float(np.radians(angle)))
