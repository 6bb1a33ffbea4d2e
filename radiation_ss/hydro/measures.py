"""Measures that the check and the cleaning of coefficients share; what the excitation force must be in long waves."""

from collections.abc import Iterator, Sequence

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.hydro.data import RIGID, HydroData, body, mode, motion_unit
from radiation_ss.hydro.linear_waves import group_velocity, wave_number

REVERSED = ("in long waves the horizontal wave force lags the elevation by a quarter period where it must lead: the "
            "phases are those of exp(-i w t) (then data.replace(X=data.X.conj())), or the headings are where waves "
            "come from (then directions + pi)")


def damping_scale(data: HydroData, silence: float = 1e-5) -> tuple[FloatArray, np.ndarray]:
    """Return s_i with s_i^2 = max|B_ii|, and which modes do not radiate (their s_i is infinite: left out).

    Damping below `silence` of its kind's largest is numerical noise. A mode whose diagonal is nothing but whose
    couplings are not (no passive body has that) is scaled by the couplings.
    """
    largest_entry = np.abs(data.B).max(axis=0)
    size = np.diagonal(largest_entry).copy()
    # Of a passive body |B_ij|^2 <= B_ii B_jj, so this is max|B_ii| there.
    implied = np.max(largest_entry ** 2 / np.where(size > 0.0, size, np.maximum(largest_entry, 1e-300)), axis=1)
    turning = np.array([motion_unit(dof) == "rad" for dof in data.dofs])
    silent = implied == 0.0
    for kind in (turning, ~turning):
        silent |= kind & (implied <= silence * implied[kind].max(initial=0.0))
    size = np.where(size > silence * implied, size, implied)
    return np.where(silent, np.inf, np.sqrt(np.where(silent, 1.0, size))), silent


def mass_scale(data: HydroData, silent: np.ndarray) -> FloatArray:
    """Return s_i with s_i^2 = max |A_ii - A_inf,ii|, the part of the added mass that depends on frequency."""
    diagonal = np.einsum("kii->ki", data.A)
    base = np.median(diagonal, axis=0) if data.A_inf is None else np.diagonal(data.A_inf)
    size = np.abs(diagonal - base).max(axis=0)
    return np.where(silent | (size == 0.0), np.inf, np.sqrt(np.where(size > 0.0, size, 1.0)))


def scaled(matrix: FloatArray, scale: FloatArray) -> FloatArray:
    """Return a matrix (..., n, n), entry i, j over s_i s_j."""
    return matrix / scale[:, None] / scale


def worst(values: FloatArray) -> tuple[float, list[int]]:
    """Return the largest value and where it stands."""
    at = np.unravel_index(values.argmax(), values.shape)
    return float(values[at]), [int(k) for k in at]


def bands(omega: FloatArray, flagged: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Return the intervals of frequencies that are flagged; gaps of up to two points are bridged."""
    at = np.flatnonzero(flagged)
    if at.size == 0:
        return ()
    groups = np.split(at, np.flatnonzero(np.diff(at) > 3) + 1)
    return tuple((float(omega[g[0]]), float(omega[g[-1]])) for g in groups)


def said(intervals: tuple[tuple[float, float], ...]) -> str:
    """Return the intervals in words, at most six."""
    words = [f"{a:.3g}" if a == b else f"{a:.3g} to {b:.3g}" for a, b in intervals]
    return ", ".join(words[:6]) + (f" and {len(words) - 6} more places" if len(words) > 6 else "") + " rad/s"


def pair(data: HydroData, i: int, j: int) -> tuple[str, ...]:
    """Return the degrees of freedom of an entry."""
    return (data.dofs[i],) if i == j else (data.dofs[i], data.dofs[j])


def named(data: HydroData, i: int, j: int) -> str:
    """Return the name of an entry."""
    return "-".join(pair(data, i, j))


def percent(share: float) -> str:
    """Return a share in per cent with two digits, never as a power of ten."""
    value = 100.0 * share
    return f"{value:.0f} %" if abs(value) >= 10.0 else f"{value:.2g} %"


def statically_unstable(M: FloatArray, C: FloatArray, dofs: Sequence[str], rest: float = 1e-6) -> tuple[str, ...]:
    """Return the degrees of freedom that a negative stiffness drives away from rest; of C = 0 none.

    M^-1 C then has negative eigenvalues, as (M + A)^-1 C has (Sylvester's law of inertia); those degrees of freedom are
    named that hold a tenth or more of the energy x^T C x in such a mode. `rest`: share of the largest eigenvalue that
    is round-off. The law needs a positive M: of one that is not, the sizes on its diagonal count.
    """
    if np.linalg.eigvalsh(0.5 * (M + M.T))[0] < 0.0:
        M = np.diag(np.abs(np.diag(M)))
    values, modes = np.linalg.eig(np.linalg.pinv(M) @ C)
    least = rest * np.abs(values).max()
    shapes = modes[:, (values.real < -least) & (np.abs(values.imag) <= least)].real
    energy = shapes * (C @ shapes)
    held = (np.abs(energy) >= 0.1 * np.abs(energy.sum(axis=0))).any(axis=1)
    return tuple(dof for dof, found in zip(dofs, held) if found)


def unstable_text(dofs: Sequence[str]) -> str:
    """Return words for degrees of freedom that are statically unstable."""
    return f"C < 0 in {' and '.join(dofs)}: the body is statically unstable there"


def inertia_not_positive(M: FloatArray, A_inf: FloatArray | None, dofs: Sequence[str]) -> tuple[tuple[str, ...], str]:
    """Return the degrees of freedom whose inertia no body has, and a sentence; both empty where there are none."""
    if wrong := {dof: mass for dof, mass in zip(dofs, np.diag(M)) if mass <= 0.0}:
        unit = {dof: (" kg m^2" if motion_unit(dof) == "rad" else " kg") * (mode(dof) in RIGID) for dof in wrong}
        each = ", ".join(f"of {dof} is {mass:.4g}{unit[dof]}" for dof, mass in wrong.items())
        return tuple(wrong), f"inertia_matrix (M) {each}; it must be positive"
    if A_inf is not None and np.linalg.eigvalsh(0.5 * (M + A_inf + (M + A_inf).T))[0] <= 0.0:
        return tuple(dofs), ("inertia_matrix (M) + A_inf is not positive definite, and of a body it is; check the mass "
                             "matrix, its reference point and A_inf")
    return (), ""


def inertia_not_symmetric(A_inf: FloatArray, M: FloatArray | None, dofs: Sequence[str], tolerance: float = 0.03) -> str:
    """Return a sentence where an inertia is off its transpose by `tolerance` of the root of both diagonals; else ''."""
    scale = np.sqrt(np.abs(np.diag(A_inf if M is None else M + A_inf)))
    scale[scale == 0.0] = np.inf
    for name, part, remedy in (("A_inf", A_inf, "data.clean(symmetric=True) takes the mean of both"),
                               ("M", M, "check the mass matrix")):
        skew = np.zeros((1, 1)) if part is None else np.abs(part - part.T) / np.outer(scale, scale)
        if skew.max() > tolerance:
            i, j = np.unravel_index(skew.argmax(), skew.shape)
            return (f"{name} of {dofs[i]}-{dofs[j]} and of its transpose differ by {percent(float(skew[i, j]))} of the "
                    f"inertia: the body as a whole is not passive, even where its radiation is; {remedy}")
    return ""


def horizontal_lead(X: ComplexArray | None, C: FloatArray | None, dofs: Sequence[str], directions: FloatArray | None,
                    near: float = 0.3) -> float | None:
    """Return the angle [rad] by which horizontal forces lead heave's in long waves; None where that is not known.

    In long waves heave's force is the restoring force times the elevation, and the force along the waves is a mass of
    water times its acceleration, a quarter period earlier: pi / 2. The place of the body falls out. `X` (nw, n_dir, n),
    `C` (n, n), `directions` (n_dir,): where waves run to [rad]. Waves are long from the lowest frequency up to where
    heave's force first departs from its restoring force by the share `near`; a spar or semisubmersible has that force
    again at higher ones, with the other sign.
    """
    if X is None or C is None or directions is None:
        return None
    places = {dof: k for k, dof in enumerate(dofs)}
    total = 0.0 + 0.0j
    for dof, k in places.items():
        if mode(dof) != "Heave" or not C[k, k] > 0.0:
            continue
        departed = np.abs(np.abs(X[:, :, k]) / C[k, k] - 1.0).max(axis=1) >= near
        long = ~np.logical_or.accumulate(departed)
        for name, along in (("Surge", np.cos(directions)), ("Sway", np.sin(directions))):
            if (other := places.get(f"{body(dof)}__{name}" if body(dof) else name)) is not None:
                total += (X[long, :, other] * X[long, :, k].conj() * along).sum()
    return float(np.angle(total)) if total else None


def off_scale(data: HydroData, apart: float = 6.0, long: float = 0.2, noise: float = 1e-3,
              both: float = np.sqrt(2.0)) -> Iterator[str]:
    """Yield a sentence for each heave whose force or damping is `apart` times off what it must be in long waves.

    There the force is the stiffness times the elevation and, alike from all sides, B = k |X|^2 / (4 rho g v_g) (Newman
    1977, Marine Hydrodynamics, chapter 6). Long: a share `long` at most is k times the side of the waterplane, and the
    inertia's part of the stiffness. Damping below a share `noise` of the added mass's part may be rounding. With one
    heading, or two along one line, the body may stand between walls: then the damping is larger. A force that is off
    by less, from `both` on, is named where stiffness and damping agree on it: waves have height or amplitude.
    """
    if data.X is None or data.C is None or data.directions is None:
        return
    rho_g, round_about = data.rho * data.g, np.ptp(np.mod(data.directions, np.pi)) > 1e-3
    k = wave_number(data.omega**2 / data.g, data.depth)
    for i, dof in enumerate(data.dofs):
        C, M = data.C[i, i], 0.0 if data.M is None else data.M[i, i]
        if mode(dof) != "Heave" or not C > 0.0:
            continue
        near = (k**2 * C < long**2 * rho_g) & (data.omega**2 * (M + np.abs(data.A[:, i, i])) < long * C)
        force = np.sqrt(np.mean(np.abs(data.X[:, :, i]) ** 2, axis=1))
        times = float(force[near][0]) / C if near.any() else 1.0  # a deep body feels less of shorter waves
        made = k * force**2 / (4.0 * rho_g * group_velocity(data.omega, k, data.depth))
        clear = made > noise * data.omega * np.abs(data.A[:, i, i])
        ratio = np.divide(data.B[:, i, i], made, out=np.ones_like(made), where=clear)
        damped = float(np.median(ratio[near & clear])) if (near & clear).any() else 1.0
        if not 1.0 / both < times < both and 1.0 / both < damped * times**2 < both:
            yield (f"in long waves the wave force on {dof} is {times:.3g} times what its stiffness says, and "
                   f"{np.sqrt(1.0 / damped):.3g} times what its damping says; X is in another unit (rho, g, 1000), or "
                   "for the height of a wave, not its amplitude (0.5 or 2)")
            continue
        if not 1.0 / apart < times < apart:
            yield (f"in long waves the wave force on {dof} is {times:.3g} times the elevation's part of its stiffness, "
                   "and must be once; X or C is in another unit (rho, g, 1000)")
            continue
        if 0.0 < damped < 1.0 / apart or (round_about and damped > apart):
            used, off = clear & (near | round_about), clear & ~((1.0 / both < ratio) & (ratio < both))
            yield f"in long waves the damping of {dof} is {damped:.3g} times what its wave force says" + (
                "; B, or both, are in another unit (rho, omega)" if _one_unit(data.omega[used], ratio[used], apart) else
                f" (Haskind's relation), {np.median(ratio[clear]):.3g} times as the median over the band, beyond "
                f"{both:.2g} times in {said(bands(data.omega, off))}; there B and X contradict each other, as those of "
                "strip theory do at low frequencies")


def _one_unit(omega: FloatArray, ratio: FloatArray, apart: float, close: float = 0.05) -> bool:
    """Whether a ratio is one number, `apart` from 1, or a power of omega, within `close` over most of a band."""
    levels = np.log(np.fmax(ratio, 1e-300)) - np.outer((0, -2, -1, 1, 2), np.log(omega))
    middle = np.median(levels, axis=1)
    steady = np.median(np.abs(levels - middle[:, None]), axis=1) < close
    return bool(steady[1:].any() or (steady[0] and abs(middle[0]) > np.log(apart)))


def is_led(lead: float | None) -> bool:
    """Return whether the horizontal force leads by about a quarter period."""
    return lead is not None and abs(lead - np.pi / 2.0) < np.pi / 4.0


def is_reversed(lead: float | None) -> bool:
    """Return whether the horizontal force lags by about a quarter period."""
    return lead is not None and is_led(-lead)
