"""Fit radiation subsystems to hydrodynamic data."""

import numbers
import warnings
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, frequencies
from radiation_ss.errors import InputError, InputWarning, SolverError
from radiation_ss.fit import choices
from radiation_ss.fit.choices import Trial
from radiation_ss.fit.joint import Search, fit_joint, order_of
from radiation_ss.fit.problem import Problem, block_problem, blocks_of, entry_errors, joint_error, not_followed
from radiation_ss.fit.rational import Realisation, frequency_response, observer_form, side_by_side
from radiation_ss.fit.result import RadiationFit
from radiation_ss.fit.start import fit_kernel, sanathanan_koerner
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.files import as_data
from radiation_ss.hydro.measures import inertia_not_symmetric

if TYPE_CHECKING:
    import control as ct


@dataclass(frozen=True)
class Options:
    """How each block is fitted, and what was said of it."""

    method: str
    search: Search
    notes: list[str] = field(default_factory=list)


def fit_radiation(data: "HydroData | ct.FrequencyResponseData", order: int | None = None, *, passive: bool = True,
                  at_zero: str | float | ArrayLike = "free", points: ArrayLike | None = None, method: str = "casadi",
                  weight: ArrayLike | None = None, seed: int = 0) -> RadiationFit:
    """Fit a stable, passive, reciprocal, strictly proper model of K(s) to B + i w (A - A_inf).

    Degrees of freedom that are coupled are fitted together and share their poles; the others stay apart.

    Parameters
    ----------
    data : HydroData or ct.FrequencyResponseData
        A missing A_inf is estimated; `notes` says so. Frequency response data hold K(iw) itself, force over velocity.
    order : int, optional
        States for each independent degree of freedom of a block. None: chosen on held-out frequencies
        (see `radiation_ss.fit.choices`), never worse than order 6; `path` keeps what was tried.
    passive : bool
        False gives the free fit: stable and reciprocal, without the passivity constraint.
    at_zero : "free", "zero" or array_like
        K(0): free; exactly zero, as for bodies in three dimensions; or a value, a number for one degree of freedom,
        else an (n, n) matrix. In two dimensions and finite depth K(0) is not zero.
    points : array_like, optional
        Frequencies [rad/s] within the band where K, the mean of it and its transpose, is met exactly (25)-(27). Damping
        that rounding made negative or singular there is projected, and `notes` says so; also what the points cost.
    method : "casadi" or "quasi-newton"
        The paper's unconstrained fit of the kernel (8), entry by entry, is "quasi-newton"; it holds neither K(0) nor
        points.
    weight : array_like, shape (nw,) or (nw, n, n), optional
        Weights of the squared misfits. By default all samples count alike, but for the suspicious ones, which are
        listed in `suspects`.
    seed : int
        Of the random starts of joint fits.

    Returns
    -------
    RadiationFit

    Raises
    ------
    InputError
        If the data or an option cannot be used.
    SolverError
        If no model was found that keeps what was asked.

    Warns
    -----
    InputWarning
        If the fit misses more than half of sum |K_ii|^2 of a degree of freedom, as where its damping is negative; if
        A_inf or M is not symmetric, so that the body with the fit is not passive.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> data = rss.section_2d(rss.lewis_section(1.0, 0.5, 0.9), np.linspace(0.3, 8.0, 40)).select("Heave")
    >>> fit = rss.fit_radiation(data, order=3)
    >>> fit.states, fit.stable, fit.passive
    (3, True, True)
    """
    given = as_data(data)
    data = given.with_A_inf()
    _check(data, order, at_zero, method)
    wanted = choices.points_within(points, data)
    if method == "quasi-newton" and wanted.size:
        raise InputError("points: method 'quasi-newton' cannot hold them; use method='casadi'")
    weights = choices.weights_of(data) if weight is None else _weights(weight, data)
    suspects = choices.suspects_of(data, weights) if weight is None else ()
    blocks = blocks_of(data)
    if not blocks:
        raise InputError(f"{data.source or 'data'}: K is zero for {', '.join(data.dofs)}; there is nothing to fit")
    # Of an estimate of A_inf, and of points
    notes: list[str] = [*data.notes[len(given.notes):], *choices.notes_on_points(data, wanted)]
    parts, orders, paths = [], [], []
    for block in blocks:
        options = Options(method, Search(passive, seed), notes)
        problem = block_problem(data, block, at_zero=at_zero, points=wanted, weight=weights)
        problem = _possible(problem, order, options)
        chosen, path = (int(order), ()) if order is not None else _choose(problem, options)
        parts.append(_fit(problem, chosen, options))
        if problem.x_points.size and method == "casadi":
            _say_price_of_points(problem, parts[-1], chosen, options)
        orders.append(chosen if order is not None else order_of(problem, parts[-1][0].shape[0]))  # fewer may do
        paths.append(path)
    a, b, c = side_by_side(parts, blocks, blocks, data.n)
    fitted = RadiationFit(data.dofs, a, b, c, order=max(orders), A_inf=data.A_inf, method=method,
                          at_zero=at_zero if isinstance(at_zero, str) else np.asarray(at_zero).tolist(),
                          points=tuple(wanted.tolist()), data=data, suspects=suspects,
                          path=tuple(paths) if order is None else (),
                          blocks=tuple(tuple(data.dofs[i] for i in block) for block in blocks))
    if passive and method == "casadi" and not fitted.passive:
        raise SolverError(f"{', '.join(data.dofs)}: the model found is not passive ({fitted.certificate})")
    K = fitted.frequency_response(data.omega)
    if missed := not_followed(data, K, weights):
        warnings.warn(f"{data.source or 'data'}: {missed}; data.check() says more", InputWarning, stacklevel=2)
    if data.A_inf is not None and (skew := inertia_not_symmetric(data.A_inf, data.M, data.dofs)):
        warnings.warn(f"{data.source or 'data'}: {skew}", InputWarning, stacklevel=2)
    error = joint_error(data, K, weights)
    return fitted.replace(relative_error=error, whole_error=joint_error(data, K), entry_error=entry_errors(data, K),
                          notes=(*notes, *choices.left_out(data, weights, error, suspects)))


def fitfrd(frd: "ct.FrequencyResponseData", order: int | None = None, *, poor: float = 0.1,
           **options: Any) -> "ct.StateSpace":
    """Fit a stable, strictly proper, reciprocal state-space model to frequency response data.

    The result is passive unless `passive=False`; `options` are those of `fit_radiation`. Warns where the relative error
    is above `poor`: the result does not carry it.

    Parameters
    ----------
    frd : ct.FrequencyResponseData
        Square, symmetric up to noise; frequencies [rad/s] above zero.
    order : int, optional
        States for each independent channel; None chooses.

    Returns
    -------
    ct.StateSpace
        With the input and output labels of `frd`.

    Raises
    ------
    InputError
        If the data or an option cannot be used.

    Examples
    --------
    >>> import control as ct, numpy as np, radiation_ss as rss
    >>> w = np.linspace(0.1, 5.0, 50)
    >>> sys = rss.fitfrd(ct.frd(ct.tf([1.0, 0.0], [1.0, 0.5, 1.0]), w), 2)
    >>> bool(np.allclose(sys(1j), 2.0, rtol=1e-3))
    True
    """
    import control as ct
    if not isinstance(frd, ct.FrequencyResponseData):
        raise InputError(f"frd: {type(frd).__name__} found; a ct.FrequencyResponseData is needed, fit_radiation takes "
                         "coefficients and files")
    fitted = fit_radiation(frd, order, **options)
    if (fitted.relative_error or 0.0) > poor:
        warnings.warn(f"fitfrd: relative error {fitted.relative_error:.2g}; more states may help, and passive=False "
                      "where the data are not those of a passive system", InputWarning, stacklevel=2)
    n = len(fitted.dofs)
    return ct.ss(fitted.a, fitted.b, fitted.c, np.zeros((n, n)), inputs=frd.input_labels, outputs=frd.output_labels)


def _fit(problem: Problem, order: int, options: Options) -> Realisation:
    """Return the realisation of one block, in SI units; how it was solved goes into the notes."""
    if options.method == "quasi-newton":
        return _fit_entries(problem, order)
    a, b, c, how = fit_joint(problem, order, options.search)
    options.notes.append(f"{', '.join(problem.dofs)}: {how}")
    return a, b, c


def _say_price_of_points(problem: Problem, part: Realisation, order: int, options: Options, much: float = 0.05) -> None:
    """Say in the notes what the points cost, and warn where that is above `much` of K."""
    def error(part: Realisation) -> float:
        K = frequency_response(*part, problem.x * problem.rate) / np.outer(problem.scale, problem.scale)
        return float(np.sqrt(problem.misfit(K[:, *np.triu_indices(problem.m)]))) / problem.norm

    held, free = error(part), error(_fit(problem.without_points(), order, replace(options, notes=[])))
    said = (f"{', '.join(problem.dofs)}: with the values met that were asked for the relative error is {held:.2g}, "
            f"without them {free:.2g}")
    options.notes.append(said)
    if held - free > much:
        warnings.warn(f"{said}; more states than order {order} make room for them", InputWarning, stacklevel=3)


def _choose(problem: Problem, options: Options) -> tuple[int, tuple[Trial, ...]]:
    quick = replace(options, notes=[], search=replace(options.search, iterations=60, known={}))
    return choices.choose_order(problem, lambda part, order: _fit(part, order, quick),
                                lambda part, order: _fit(part, order, replace(options, notes=[])))


def _fit_entries(problem: Problem, order: int) -> Realisation:
    """Return the paper's fit of each entry alone, one subsystem for each pair (5)-(8)."""
    parts, rows, columns = [], [], []
    for p, (i, j) in enumerate(zip(*np.triu_indices(problem.m))):
        entry = replace(problem, dofs=(problem.dofs[i],), K=problem.K[:, [p]], weight=problem.weight[:, [p]])
        if not np.any(entry.K):
            continue
        first = min(sanathanan_koerner(entry.x, entry.K[:, 0], entry.weight[:, 0], order), key=lambda run: run[0])
        a, b, c = observer_form(*fit_kernel(entry, order, first[1:]))
        for row, column in {(int(i), int(j)), (int(j), int(i))}:
            size = np.sqrt(problem.rate * problem.scale[row] * problem.scale[column])
            parts.append((problem.rate * a, size * b, size * c))
            rows.append([row])
            columns.append([column])
    return side_by_side(parts, rows, columns, problem.m)


def _check(data: HydroData, order: Any, at_zero: object, method: str) -> None:
    if order is not None and (not isinstance(order, numbers.Integral) or isinstance(order, bool)):
        raise InputError(f"order: {order!r} found; a whole number of states, or None to choose one, is needed")
    if order is not None and order < 1:
        raise InputError(f"order: {order} found; at least 1 is needed (2 with at_zero='zero')")
    if data.omega.size < 3:
        raise InputError(f"{data.source or 'data'}: {frequencies(data.omega.size)}; at least 3 are needed for a fit")
    if method not in ("casadi", "quasi-newton"):
        raise InputError(f"method: {method!r} found; use 'casadi' or 'quasi-newton'")
    if isinstance(at_zero, str) and at_zero not in ("free", "zero"):
        raise InputError(f"at_zero: {at_zero!r} found; use 'free', 'zero' or a value [N s/m and so on]")
    size = 1.0 if isinstance(at_zero, str) else float(np.abs(np.asarray(at_zero, dtype=complex)).max(initial=0.0))
    if not size <= 1e6 * max(float(np.abs(data.K).max()), 1.0):
        raise InputError(f"at_zero: {size:g} found; K of the data is at most {np.abs(data.K).max():.3g}")


def _possible(problem: Problem, order: int | None, options: Options, rounding: float = 1e-4) -> Problem:
    """Refuse points that no passive model meets, and more coefficients than numbers; return the problem.

    Eigenvalues of the damping at the points that are negative by at most `rounding` of the largest |K_ii|, or that are
    zero but for rounding beside others that are not, are raised to a hundredth of it, which goes into the notes.
    """
    name = ", ".join(problem.dofs)
    if order is not None and order > problem.x.size:
        raise InputError(f"{name}: order {order} has more coefficients than {problem.x.size} frequencies can tell; "
                         "lower the order")
    if not options.search.passive or not problem.x_points.size:
        return problem
    values, vectors = np.linalg.eigh(problem.whole(problem.K_points.real))
    low = (values[:, 0] < -1e-9) | (values[:, 0] < 1e-8) & (values[:, -1] > rounding)
    if not low.any():
        return problem
    at = int(np.argmin(values[:, 0]))
    where = f"points: at {problem.x_points[at] * problem.rate:g} rad/s the damping of {name} in the data is"
    if values[at, 0] < -rounding:
        raise InputError(f"{where} not positive semidefinite (smallest scaled eigenvalue {values[at, 0]:.2g}); no "
                         "passive model can meet it; data.clean(negative_damping=True) repairs the data, or choose "
                         "another point")
    raised = np.maximum(values, 0.01 * rounding)
    near = np.einsum("qik,qk,qjk->qij", vectors, raised, vectors)[:, *np.triu_indices(problem.m)]
    options.notes.append(f"{where} not positive definite, by rounding (smallest scaled eigenvalue "
                         f"{values[at, 0]:.1g}); projected on the nearest damping that a passive model can meet")
    return replace(problem, K_points=np.where(low[:, None], near + 1j * problem.K_points.imag, problem.K_points))


def _weights(weight: ArrayLike, data: HydroData) -> FloatArray:
    try:
        values = np.asarray(weight, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"weight: {weight!r} found; numbers are needed, one a frequency or an entry") from None
    if values.shape not in ((data.omega.size,), data.B.shape):
        raise InputError(f"weight: shape {values.shape} found; ({data.omega.size},) or {data.B.shape} needed")
    if not np.isfinite(values).all() or (values < 0.0).any() or not values.any():
        raise InputError("weight: must be finite, not negative, and not all zero")
    return values


def price_of_passivity(fit: RadiationFit) -> tuple[float, float]:
    """Return (error of this fit, error of the free fit of the same order); see `RadiationFit.price_of_passivity`."""
    if fit.data is None:
        raise InputError("price_of_passivity: this fit does not carry its data; use fit.replace(data=...)")
    at_zero = fit.at_zero if isinstance(fit.at_zero, str) else np.asarray(fit.at_zero)
    free = fit_radiation(fit.data, fit.order, passive=False, at_zero=at_zero, points=fit.points)
    return fit.relative_error, free.relative_error
