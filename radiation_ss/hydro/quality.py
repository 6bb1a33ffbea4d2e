"""Is a set of coefficients one of a linear, passive, causal body? Measures for each frequency, and findings.

Energy: the symmetric part of B has no negative eigenvalue. Reciprocity: A and B are symmetric. Causality: A - A_inf and
B satisfy Kramers-Kronig. Panels: no features narrower than a body can radiate (irregular frequencies, gap modes).
Haskind: the forces of waves from all headings give the damping, B_ij = k / (8 pi rho g v_g) int Re(X_i X_j*) dbeta,
v_g the group speed (Newman 1977, Marine Hydrodynamics, chapter 6); a wrong unit, column, heading or depth breaks it.
"""

from collections.abc import Iterator

import numpy as np

from radiation_ss.arrays import FloatArray, frequencies
from radiation_ss.errors import InputError
from radiation_ss.hydro.band_end import above
from radiation_ss.hydro.data import HydroData, body, mode
from radiation_ss.hydro.findings import KINDS, Finding, QualityReport
from radiation_ss.hydro.linear_waves import group_velocity, wave_number
from radiation_ss.hydro.measures import (
    REVERSED,
    bands,
    damping_scale,
    horizontal_lead,
    inertia_not_positive,
    is_reversed,
    mass_scale,
    named,
    off_scale,
    pair,
    percent,
    said,
    scaled,
    statically_unstable,
    unstable_text,
    worst,
)
from radiation_ss.hydro.narrow import narrow, roughness
from radiation_ss.hydro.transforms import Tail, added_mass_from_damping, beside_implied, estimate_A_inf, fit_tail


def check(data: HydroData, tolerance: float = 0.03) -> QualityReport:
    """Measure the quality of coefficients and list what is wrong with them; nothing is changed.

    `tolerance`: relative size from which a finding is named; negative damping of this size is a problem, a spike of
    twice and asymmetry, Kramers-Kronig residual or offset of A_inf of three times this size. The measures that need a
    band (Kramers-Kronig, spikes, tail) take at least 8 frequencies. InputError if the tolerance is not between 0 and 1.
    """
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"tolerance: a share between 0 and 1 needed, found {tolerance:g}")
    scale, silent = damping_scale(data)
    S = scaled(0.5 * (data.B + data.B.transpose(0, 2, 1)), scale)
    values, vectors = np.linalg.eigh(S)
    smallest, other = values[:, 0], mass_scale(data, silent)
    if data.omega.size >= 8:  # of an added mass that hardly varies what the damping implies
        own = np.einsum("kii->ki", data.B)[:, :, None]
        implied = np.abs(added_mass_from_damping(data.omega, own)).max(axis=(0, 2))
        other = np.where(silent, np.inf, np.fmax(np.where(np.isinf(other), 0.0, other), np.sqrt(implied)))
    B, A = scaled(data.B, scale), scaled(data.A, other)
    skew = np.stack([np.abs(part - part.transpose(0, 2, 1)) for part in (B, A)])
    residual, tail, more = _causality(data, other, tolerance, silent)
    rough = roughness(data)
    findings = [*_negative(data, smallest, vectors[:, :, 0], S, tolerance), *more,
                *_asymmetric(data, skew, tolerance), *_limit_asymmetric(data, other, tolerance),
                *narrow(data, rough, residual, smallest, tolerance), *above(data, silent, tolerance),
                *haskind(data, tolerance), *_band(data, tail, silent, B, rough.max(axis=(1, 2)) > tolerance)]
    lead = horizontal_lead(data.X, data.C, data.dofs, data.directions)
    if lead is not None and is_reversed(lead):
        findings.append(Finding("wave phase", True, abs(lead), (), (), REVERSED))
    if data.M is not None and (wrong := inertia_not_positive(data.M, data.A_inf, data.dofs))[0]:
        findings.append(Finding("inertia", True, 1.0, (), *wrong))
    findings += [Finding("scale", True, 1.0, (), (), text) for text in off_scale(data)]
    if data.M is not None and data.C is not None and (loose := statically_unstable(data.M, data.C, data.dofs)):
        findings.append(Finding("negative stiffness", False, 0.0, (), loose, f"{unstable_text(loose)}; check the "
                                "centre of gravity, or add what restores it (mooring, hinge)"))
    findings.sort(key=lambda f: (not f.problem, KINDS.index(f.kind), -f.value))
    return QualityReport(data, tolerance, smallest, skew.max(axis=(0, 2, 3)), residual, rough.max(axis=(1, 2)),
                         tail, tuple(findings))


def _causality(data: HydroData, scale: FloatArray, tolerance: float,
               silent: np.ndarray) -> tuple[FloatArray, Tail, list[Finding]]:
    """Compare A with what B implies; a constant difference is A_inf's, the rest breaks Kramers-Kronig."""
    w = data.omega
    zero = np.zeros((data.n, data.n))
    if w.size < 8:
        few = Finding("coarse band", True, 1.0, ((w[0], w[-1]),), (), f"only {frequencies(w.size)}; 8 are needed for "
                      "Kramers-Kronig, spikes and tail")
        missing = Finding("A_inf missing", False, 0.0, (), data.dofs, "and too few frequencies to estimate it")
        return (np.zeros_like(data.A), Tail(float(w[-1]), data.B[-1], zero + 3.0, zero > 0.0, zero),
                [few] if data.A_inf is not None else [few, missing])
    beside, level = beside_implied(w, data.A, data.B)
    residual, tail, middle = scaled(beside, scale), fit_tail(w, data.B), (w > w[0]) & (w < 0.9 * w[-1])
    found: list[Finding] = []
    inside = np.where(middle[:, None, None], np.abs(residual), 0.0)
    if where := bands(w, inside.max(axis=(1, 2)) > tolerance):
        size, (k, i, j) = worst(inside)
        faster, _ = beside_implied(2.0 * np.pi * w, data.A, data.B)
        left = float(np.abs(scaled(faster, scale))[middle].max())
        hertz = f"; were the frequencies in Hz, by {percent(left)}: they may be" if left < 0.05 * size else ""
        found.append(Finding("Kramers-Kronig", size > 3.0 * tolerance, size, where, pair(data, i, j),
                             f"added mass and damping violate the Kramers-Kronig relations by {percent(size)} of the "
                             "largest A - A_inf, "
                             f"worst at {w[k]:.3g} rad/s in {named(data, i, j)}; beyond {percent(tolerance)} in "
                             f"{said(where)}{hertz}"))
    if data.A_inf is None:
        estimate = estimate_A_inf(w, data.A, data.B)
        each = ", ".join(f"{dof} {estimate.value[i, i]:.4g} +- {estimate.std[i, i]:.2g}"
                         for i, dof in enumerate(data.dofs) if not silent[i])
        found.append(Finding("A_inf missing", False, 0.0, (), data.dofs, f"Kramers-Kronig gives {each} (SI); "
                             "data.with_A_inf() takes it"))
        return residual, tail, found
    offset = np.diagonal(scaled(level - data.A_inf, scale))
    off = np.abs(offset)
    if off.max() > tolerance:
        each = ", ".join(f"{data.dofs[i]} {percent(offset[i])}" for i in np.argsort(-off) if off[i] > tolerance)
        found.append(Finding("A_inf offset", bool(off.max() > 3.0 * tolerance), float(off.max()), (),
                             tuple(data.dofs[i] for i in np.flatnonzero(off > tolerance)),
                             f"A and B imply another A_inf than the one given, by (of the largest A - A_inf) {each}"))
    return residual, tail, found


def _negative(data: HydroData, smallest: FloatArray, vectors: FloatArray, S: FloatArray,
              tolerance: float) -> Iterator[Finding]:
    """Name negative damping: where, how large, in which motion."""
    faint = max(1e-3, 0.05 * tolerance)
    if smallest.min() >= -faint:
        return
    k = int(smallest.argmin())
    weight = np.abs(vectors[k])
    involved = [i for i in np.argsort(-weight) if weight[i] > 0.3]
    motion = " and ".join(data.dofs[i] for i in involved)
    where = bands(data.omega, smallest < -faint)
    diagonal = np.einsum("kii->ki", S)
    alone = [f"{dof} ({percent(diagonal[:, i].min())} at {data.omega[diagonal[:, i].argmin()]:.3g} rad/s)"
             for i, dof in enumerate(data.dofs) if diagonal[:, i].min() < -faint]
    text = (f"smallest eigenvalue {percent(smallest[k])} of the largest damping, at {data.omega[k]:.3g} rad/s in "
            f"{motion}; negative in {said(where)}")
    if diagonal[k].min() >= -faint:
        text += "; there the diagonal is positive and the couplings are too large"
    if alone:
        text += f"; on the diagonal: {', '.join(alone)}"
    yield Finding("negative damping", bool(-smallest[k] > tolerance), float(-smallest[k]), where,
                  tuple(data.dofs[i] for i in involved), text)


def _asymmetric(data: HydroData, skew: FloatArray, tolerance: float) -> Iterator[Finding]:
    """Name the entry of B or A that differs most from its transpose."""
    if skew.max() <= tolerance:
        return
    size, (which, k, i, j) = worst(skew)
    where = bands(data.omega, skew.max(axis=(0, 2, 3)) > tolerance)
    scaled = "the largest damping" if which == 0 else "the largest A - A_inf"
    yield Finding("asymmetry", size > 3.0 * tolerance, size, where, pair(data, i, j),
                  f"{'BA'[which]} of {named(data, i, j)} and of its transpose differ by {percent(size)} of {scaled} at "
                  f"{data.omega[k]:.3g} rad/s; beyond {percent(tolerance)} in {said(where)}")


def _limit_asymmetric(data: HydroData, scale: FloatArray, tolerance: float) -> Iterator[Finding]:
    """Name the entry of A_inf that differs most from its transpose."""
    if data.A_inf is None:
        return
    size, (_, i, j) = worst(np.abs(scaled(data.A_inf - data.A_inf.T, scale))[None])
    if size > tolerance:
        yield Finding("asymmetry", size > 3.0 * tolerance, size, (), pair(data, i, j),
                      f"A_inf of {named(data, i, j)} and of its transpose differ by {percent(size)} of the largest "
                      "A - A_inf")


def _band(data: HydroData, tail: Tail, silent: np.ndarray, B: FloatArray, spike: np.ndarray) -> Iterator[Finding]:
    """Say where the band is too short, starts too late or is too coarse for a kernel."""
    w = data.omega
    scaled = np.einsum("kii->ki", B)
    active = np.flatnonzero(~silent)
    if silent.any():
        names = tuple(data.dofs[i] for i in np.flatnonzero(silent))
        yield Finding("non-radiating mode", False, 0.0, (), names,
                      f"{', '.join(names)}: damping is numerical noise; left out of these measures")
    if active.size == 0 or w.size < 8:
        return
    share = np.diagonal(tail.share)
    if long := [i for i in active if share[i] > 0.05]:
        i = max(long, key=lambda i: share[i])
        each = ", ".join(f"{data.dofs[a]} {percent(share[a])}" for a in long)
        yield Finding("short band", bool(share[i] > 0.2 and abs(scaled[-1, i]) > 0.1), float(share[i]),
                      ((float(w[-1]), float(w[-1])),), tuple(data.dofs[a] for a in long),
                      f"the file ends at {w[-1]:.3g} rad/s; by the fitted tail {each} of the damping lie above")
    # Damping need not vanish at zero frequency (it does not in two dimensions): what counts is the area left out.
    area = np.trapezoid(np.abs(scaled[:, active]), w, axis=0)
    before = w[0] * np.abs(scaled[0, active])
    missing = before / np.maximum(area + before, 1e-300)
    if missing.max() > 0.05:
        i = active[missing.argmax()]
        yield Finding("late band", bool(missing.max() > 0.15), float(missing.max()), ((0.0, float(w[0])),),
                      (data.dofs[i],), f"the file begins at {w[0]:.3g} rad/s; up to {percent(missing.max())} of the "
                      f"damping of {data.dofs[i]} lie below")
    step = np.abs(np.diff(scaled[:, active], axis=0)).max(axis=1)
    step[spike[1:] | spike[:-1]] = 0.0  # a spike is its own finding
    if step.max() > 0.2:
        k = int(step.argmax())
        where = bands(w, np.append(step > 0.2, False) | np.append(False, step > 0.2))
        yield Finding("coarse band", bool(step.max() > 0.4), float(step.max()), where, (),
                      f"damping changes by {percent(step.max())} of its largest from {w[k]:.3g} to {w[k + 1]:.3g} "
                      f"rad/s; more than 20 % a step in {said(where)}")


def haskind(data: HydroData, tolerance: float) -> Iterator[Finding]:
    """Name forces and damping that contradict each other, or that belong to another depth than the one given.

    Nothing is said where the headings do not go round. Entries count relative to sqrt(B_ii B_jj), the median over
    frequency; five times the tolerance is a problem.
    """
    force = over_headings(data)
    scale, silent = damping_scale(data)
    own = np.einsum("wii->wi", data.B) / scale**2
    if force is None or silent.all():
        return
    use = np.isfinite(force).any(axis=(1, 2)) & (own[:, ~silent] > 0.02).any(axis=1)
    if not use.any():
        return
    w, loud = data.omega[use], np.flatnonzero(~silent)
    total = np.einsum("wii,i->w", force[use], scale**-2.0) / np.maximum(own[use].sum(axis=1), 1e-300)

    def spread(depth: float) -> float:
        return float(np.sqrt(np.mean(np.log(np.maximum(factor(w, depth, data.g) * total, 1e-6)) ** 2)))

    longest = 2.0 * np.pi / float(wave_number(w[:1] ** 2 / data.g, data.depth)[0])
    best = min(np.geomspace(0.005, 1.0, 200) * longest, key=spread)
    given, found = spread(data.depth), spread(best)
    if given > 5.0 * tolerance and found < min(0.3 * given, 2.0 * tolerance):
        yield Finding("depth", True, given, (), (), f"forces and damping agree in water of {best:.3g} m (within "
                      f"{percent(found)}), not of {data.depth:g} m ({percent(given)}); data.replace(depth=...) sets it")
        return
    size = np.sqrt(np.maximum(own[use], 0.02 * own.max(axis=0)))[:, loud]
    off = force[use] * factor(w, data.depth, data.g)[:, None, None] - data.B[use]
    off = scaled(np.abs(off), scale)[:, loud][:, :, loud] / size[:, :, None] / size[:, None, :]
    off = np.nan_to_num(np.median(off, axis=0))
    if off.max() > 5.0 * tolerance:
        i, j = (int(loud[k]) for k in np.unravel_index(off.argmax(), off.shape))
        yield Finding("Haskind", True, float(off.max()), (), pair(data, i, j), "wave excitation forces and damping "
                      f"contradict each other (Haskind's relation) by {percent(off.max())} of sqrt(B_ii B_jj) in "
                      f"{named(data, i, j)}")


def factor(omega: FloatArray, depth: float, g: float) -> FloatArray:
    """Return the part of the relation that depends on the depth, k / v_g."""
    k = wave_number(omega**2 / g, depth)
    return np.asarray(k / group_velocity(omega, k, depth))


def over_headings(data: HydroData, widest: float = np.pi / 4.0, sure: float = 0.05) -> FloatArray | None:
    """Return int Re(X_i X_j*) dbeta / (8 pi rho g), shape (nw, n, n); NaN where it is not known.

    Headings are enough at a frequency where every second of them gives the same diagonal within `sure`; None where they
    are more than `widest` apart. Half a circle of them is mirrored for one body with port like starboard: sway, roll
    and yaw change sign; their products with the others are not known then.
    """
    if data.X is None or data.directions is None:
        return None
    angle, first = np.unique(np.round(np.mod(data.directions, 2.0 * np.pi), 6), return_index=True)
    X, unknown = data.X[:, first], np.zeros((data.n, data.n), dtype=bool)
    if angle[-1] < np.pi + 1e-3:
        odd = np.array([-1.0 if mode(dof) in ("Sway", "Roll", "Yaw") else 1.0 for dof in data.dofs])
        scale, _ = damping_scale(data)
        unknown = odd[:, None] * odd < 0.0
        if len({body(dof) for dof in data.dofs}) > 1 or scaled(np.abs(data.B), scale)[
                :, unknown].max(initial=0.0) > 2.0 * sure:
            return None
        inner = (angle > 1e-3) & (angle < np.pi - 1e-3)
        angle = np.concatenate([angle, 2.0 * np.pi - angle[inner][::-1]])
        X = np.concatenate([X, (odd * X[:, inner])[:, ::-1]], axis=1)
    if angle.size % 2 or np.diff(np.append(angle, angle[0] + 2.0 * np.pi)).max() > widest + 1e-6:
        return None

    def integral(every: int) -> FloatArray:
        some, forces = angle[::every], X[:, ::every]
        step = np.diff(np.append(some, some[0] + 2.0 * np.pi))
        weight = (step + np.roll(step, 1)) / (16.0 * np.pi * data.rho * data.g)
        return np.asarray(np.einsum("b,wbi,wbj->wij", weight, forces, forces.conj()).real)

    found, rough = integral(1), integral(2)
    own = np.einsum("wii->wi", found)
    known = (np.abs(np.einsum("wii->wi", rough) - own) <= sure * own).all(axis=1)
    return np.where(known[:, None, None] & ~unknown, found, np.nan)
