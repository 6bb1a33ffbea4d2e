"""The exciting force of a random sea, from X(w, direction); directional spreading."""

import logging

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.methods import accepting
from radiation_ss.waves.realise import Sea

log = logging.getLogger("radiation_ss")


@accepting(body=lambda given: given if isinstance(given, HydroData) else as_model(given))
def exciting_force(body: Model | HydroData, sea: Sea, *, outside: float = 0.01) -> FloatArray:
    """Return the wave-exciting force of a sea on a body, shape (n, samples) [N, N m].

    force_j(t) = Re sum_k sum_d X_j(w_k, beta_d) a_dk e^{i w_k t}. X is interpolated in frequency (modified Akima, real
    and imaginary part, without the phase of a body far from the phase's origin) and linearly in direction, with a
    warning where it turns too fast or is far from linear. Harmonics outside the frequencies of X are left out: they
    exert no force.

    Parameters
    ----------
    body : Model, HydroData or path
        With X.
    sea : Sea
        From `realise`.
    outside : float
        Largest share of the sea's energy, the variance of the elevation, that may be left out, 0 to 1.

    Raises
    ------
    InputError
        If X is missing, a direction of the sea is not covered, or a larger share of the sea's energy lies outside the
        frequencies of X.

    Examples
    --------
    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60), gyradius=0.07)
    >>> data = section.select("Heave").times(0.3)
    >>> model = rss.Model.from_hydro(data, rss.fit_radiation(data, 3))
    >>> sea = rss.realise(rss.jonswap(0.02, tp=1.0), 30.0, 0.05, seed=0)
    >>> rss.exciting_force(model, sea).shape
    (1, 600)
    """
    return sea.signal(force_harmonics(body, sea, outside))


def energy_outside(data: HydroData, sea: Sea) -> tuple[float, str]:
    """Return the share of a sea's energy outside the frequencies of X, 0 to 1, and a sentence on it."""
    energy = np.sum(np.abs(sea.amplitudes) ** 2, axis=0)
    low, high = data.omega[[0, -1]]
    below, above = (float(energy[part].sum() / energy.sum()) for part in (sea.omega < low, sea.omega > high))
    return below + above, (f"{data.source or 'data'}: {below + above:.1%} of the sea's energy lies outside the "
                           f"frequencies of X ({below:.1%} below {low:g} rad/s, {above:.1%} above {high:g} rad/s)")


def force_harmonics(body: Model | HydroData, sea: Sea, outside: float = 0.01, rough: float = 0.1) -> ComplexArray:
    """Return force amplitudes, (n, period // 2 + 1), that `exciting_force` sums; warns where X curves by `rough`."""
    data = body.hydro if isinstance(body, Model) else body
    if data is None or data.X is None:
        raise InputError(f"{getattr(data, 'source', '') or 'body'}: the exciting force X is missing")
    if not 0.0 <= outside <= 1.0:
        raise InputError(f"outside: {outside:g}; a share of the sea's energy from 0 to 1 is needed")
    share, said = energy_outside(data, sea)
    if share > outside:
        enough = f"{np.ceil(100.0 * share) / 100.0:g}"
        raise InputError(f"{said}, more than {outside:g}; give X there, another sea, or leave that energy out of the "
                         f"force: outside={enough}, --outside {enough}")
    inside = (sea.omega >= data.omega[0]) & (sea.omega <= data.omega[-1])
    force = np.zeros((data.n, sea.omega.size), dtype=complex)
    directions = [None] if sea.directions is None else sea.directions.tolist()
    worst, where = 0.0, ""
    for amplitudes, direction in zip(sea.amplitudes, directions):
        X = transfer(data, sea.omega[inside], direction)
        force[:, inside] += (X * amplitudes[inside, None]).T
        worst, where = max((worst, where), bent(data, sea.omega[inside], direction, amplitudes[inside]))
        for dof, share in zip(data.dofs, turning(data, sea.omega[inside], direction, amplitudes[inside])):
            if share > rough:
                log.warning("%s: X of %s turns by more than a radian from one frequency to the next, with %.0f %% of "
                            "this sea's force: give X at more frequencies", data.source or "data", dof, 100.0 * share)
    if worst > rough:
        log.warning("%s: the force is taken as linear between the directions of X; at %s, a curve through them differs "
                    "by %.0f %%; give X at closer directions", data.source or "data", where, 100.0 * worst)
    return force


def transfer(data: HydroData, omega: ArrayLike, direction: float | None = None) -> ComplexArray:
    """Return X(w, direction), shape (nw, n), interpolated from data with X and its directions.

    `omega` (nw,): frequencies within the data's [rad/s]. `direction`: of propagation [rad]; absent: the only one of X.
    """
    return between(data.omega, toward(data, direction), np.asarray(omega, dtype=float))


def toward(data: HydroData, direction: float | None) -> ComplexArray:
    """Return X at its own frequencies for a direction, shape (nw, n), linear between those of X."""
    assert data.X is not None
    order, known, at = around(data, direction)
    right = min(int(np.searchsorted(known, at)), known.size - 1)
    left = max(right - 1, 0)
    apart = known[right] - known[left]
    if apart > 0.5 * np.pi + 1e-9 and min(at - known[left], known[right] - at) > 1e-3:
        raise InputError(f"direction: {np.degrees(at):.4g} deg lies between {np.degrees(known[left]):.4g} and "
                         f"{np.degrees(known[right]):.4g} deg, the closest ones of X, more than a right angle apart; a "
                         "force is not linear over so much; give X for more directions")
    share = (at - known[left]) / apart if right > left else 1.0
    return np.asarray((1.0 - share) * data.X[:, order[left]] + share * data.X[:, order[right]])


def turning(data: HydroData, omega: FloatArray, direction: float | None, waves: ComplexArray,
            turn: float = 1.0) -> FloatArray:
    """Return the share (n,) of the power of waves' force from where X turns too far to be interpolated.

    By `turn` [rad] from one frequency to the next, beside what its distance from the phase's origin makes. `omega`,
    `waves`: frequencies and amplitudes (nw,).
    """
    at, X = data.omega, toward(data, direction)
    if at.size < 2:
        return np.zeros(data.n)
    flat = X * np.exp(1j * distances(at, X) * at[:, None] ** 2)
    far = np.abs(np.angle(flat[1:] * flat[:-1].conj())) > turn
    power = np.abs(between(at, np.abs(X), omega) * waves[:, None]) ** 2
    there = far[np.clip(np.searchsorted(at, omega) - 1, 0, at.size - 2)]
    return np.asarray(np.sum(power * there, axis=0) / np.maximum(power.sum(axis=0), 1e-300))


def around(data: HydroData, direction: float | None) -> tuple[NDArray[np.int64], FloatArray, float]:
    """Return the order of X's directions, these [rad], the circle closed, and the direction among them."""
    assert data.directions is not None
    if direction is None:
        if data.directions.size > 1:
            some = ", ".join(f"{angle:.4g}" for angle in np.degrees(data.directions[:6]))
            raise InputError(f"direction: X is given for {data.directions.size} directions ({some}"
                             f"{', ...' if data.directions.size > 6 else ''} deg); say which the sea has, in rad: "
                             f"realise(..., directions=[{data.directions[np.argmin(np.abs(data.directions))]:.6g}])")
        direction = float(data.directions[0])
    order = np.argsort(data.directions)
    known = data.directions[order]
    if known.size > 2 and 1e-9 < known[0] + 2.0 * np.pi - known[-1] <= 1.01 * np.diff(known).max():
        order, known = np.append(order, order[0]), np.append(known, known[0] + 2.0 * np.pi)
    return order, known, bring_into(direction, known)


def bent(data: HydroData, omega: FloatArray, direction: float | None, waves: ComplexArray,
         rounding: float = 1e-4) -> tuple[float, str]:
    """Return how far a cubic through X's directions is from the straight line, of the force of waves, and in what.

    The largest share of a motion's force, 0 where X has the direction itself; a force below the share `rounding` of
    the largest is one that symmetry makes zero. `omega`, `waves`: frequencies and amplitudes (nw,).
    """
    assert data.X is not None
    order, known, at = around(data, direction)
    if known.size < 3 or np.abs(known - at).min() < 1e-9:
        return 0.0, ""
    closed = "periodic" if order[-1] == order[0] else "not-a-knot"
    curved = between(data.omega, CubicSpline(known, data.X[:, order], axis=1, bc_type=closed)(at), omega)
    straight = transfer(data, omega, at)
    size, off = (np.linalg.norm(values * waves[:, None], axis=0) for values in (straight, curved - straight))
    share = off / np.maximum(size, max(rounding * size.max(), 1e-300))
    worst = int(np.argmax(share))
    return float(share[worst]), f"{np.degrees(at):.4g} deg, {data.dofs[worst]}"


def between(at: FloatArray, X: ComplexArray, omega: FloatArray) -> ComplexArray:
    """Return X (nw, n) of the frequencies `at` interpolated to `omega` within them, shape (omega.size, n).

    Modified Akima: the force on a long body turns its phase within a few frequencies of a file, which a straight line
    between them cuts off by 5 % where there are eight a turn, this by less than 1 %.
    """
    if at.size == 1:
        return np.broadcast_to(X, (np.size(omega), X.shape[1])).copy()
    away = distances(at, X)
    flat = X * np.exp(1j * away * at[:, None] ** 2)
    return np.asarray((Akima1DInterpolator(at, flat.real, method="makima")(omega)
                       + 1j * Akima1DInterpolator(at, flat.imag, method="makima")(omega))
                      * np.exp(-1j * away * np.reshape(omega, (-1, 1)) ** 2))


def distances(at: FloatArray, X: ComplexArray, turned: float = 0.8, flatter: float = 4.0,
              seen: float = 0.05) -> FloatArray:
    """Return R / g of each column of X (nw, n): a body at R from the phase's origin turns it by k R, in deep water.

    The one that leaves X flattest. 0 where X turns by less than `turned` [rad] from one frequency to the next, where it
    has the share `seen` of its largest, or where the sum of squared differences is not `flatter` times less with it.
    """
    size, found = np.abs(X), np.zeros(X.shape[1])
    strong = np.minimum(size[1:], size[:-1]) > seen * size.max(axis=0)
    turns = np.where(strong, np.abs(np.angle(X[1:] * X[:-1].conj())), 0.0).max(axis=0)
    tried = np.arange(-4.0 * np.pi * at.size, 4.0 * np.pi * at.size, 1.5) / at[-1] ** 2
    for j in np.flatnonzero(turns > turned):
        uneven = np.sum(np.abs(np.diff(X[:, j] * np.exp(1j * tried[:, None] * at**2), axis=1)) ** 2, axis=1)
        if flatter * uneven.min() < np.sum(np.abs(np.diff(X[:, j])) ** 2):
            found[j] = tried[np.argmin(uneven)]
    return found


def on_all(at: FloatArray, X: ComplexArray, omega: FloatArray) -> ComplexArray:
    """Return X (nw, n) on any frequencies: below the table its first value holds, above it the force is zero."""
    found = between(at, X, np.clip(omega, at[0], at[-1]))
    found[omega > at[-1]] = 0.0
    return found


def bring_into(direction: float, known: FloatArray) -> float:
    """Return the direction plus the multiple of 2 pi that brings it into the known ones."""
    for turn in (0.0, 2.0 * np.pi, -2.0 * np.pi):
        if known[0] - 1e-3 <= direction + turn <= known[-1] + 1e-3:
            return float(np.clip(direction + turn, known[0], known[-1]))
    raise InputError(f"direction: {direction:g} rad is outside the directions of X, {known[0]:g} to {known[-1]:g} rad")


def cosine_spreading(directions: ArrayLike, mean: float = 0.0, exponent: float = 10.0) -> FloatArray:
    """Return the shares of a cos^(2s)((direction - mean) / 2) spreading, normalised to sum 1 over the directions.

    Parameters
    ----------
    directions : array_like, shape (n_dir,)
        Evenly spaced directions of propagation [rad].
    mean : float
        Main direction [rad].
    exponent : float
        s; about 5 for wind sea, 25 to 75 for swell (Longuet-Higgins et al. 1963; Goda 2000).

    Raises
    ------
    InputError
        If directions are no radians, none lies near the main direction, or the exponent is negative.
    """
    angle = np.asarray(directions, dtype=float) - mean
    if np.abs(angle).max(initial=0.0) > 4.0 * np.pi or exponent < 0.0:
        raise InputError(f"directions, exponent: {np.abs(angle).max(initial=0.0):g} rad from the main direction and "
                         f"{exponent:g} found; radians and a positive exponent are needed, np.radians(...)")
    weight = np.abs(np.cos(0.5 * angle)) ** (2.0 * exponent)
    if not weight.sum() > 0.0:
        raise InputError("directions: none lies near the main direction")
    return weight / weight.sum()
