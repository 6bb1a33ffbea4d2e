"""Parameters of a fitted radiation subsystem with their prior: denominators that entries share, smooth errors."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.inference.parameters import ParameterBlock, Parametrisation
from radiation_ss.inference.remainder import Remainder


def parametrise(fit: RadiationFit, A_inf: FloatArray, prior: float, rest: float = 0.0,
                smooth: bool = True, beyond: float = 0.0) -> Parametrisation:
    """Return the parametrisation of a fitted subsystem, symmetric in its entries.

    Entries with the same poles share a denominator. A denominator keeps the paper's polynomial form (23) where at least
    nine tenths of the prior's draws are stable; else it is written in sections, stable for positive coefficients.
    `prior`: relative standard deviation of K, root mean square over frequency up to twice the poles' own (to first
    order). All coefficients of a block get one relative standard deviation, as large as makes that of its K so. `rest`:
    what the model's order may leave out of K, over each entry's largest |K|: damped sections with small numerators
    about zero. `beyond`: what a body's error has that no coefficients of this order make, over the damping there, by
    the same sections: a high order follows its data closely, but not a hump of another body's damping. A K(0) that is
    less than the fit leaves out is zero. `smooth`: whether the relative error of the damping is smooth in frequency
    (`with_smooth_error`), or each coefficient has an error of its own.
    InputError if the fit has no states, makes no force, or is unstable.
    """
    if fit.states == 0 or not np.any(fit.b) or not np.any(fit.c):
        raise InputError("fit: it has no states, or no force by them, so there is nothing to identify")
    poles, residues = _poles_and_residues(fit)
    if poles.real.max() >= 0.0:
        raise InputError("fit: it is unstable; start from a stable subsystem")
    zero = fit.certificate.K_zero < max(1e-8, fit.relative_error or 0.0)
    blocks: list[ParameterBlock] = []
    mean: list[float] = []
    std: list[float] = []
    names: list[str] = []
    for members, entries in _groups(poles, residues).items():
        p = poles[list(members)]
        R = np.array([residues[list(members), j, k] for j, k in entries])
        block, values, spread, labels = _block(p, R, entries, prior, len(mean), fit.dofs)
        if zero and block.order > 1:
            block = replace(block, zero=True)
            for number in range(len(entries)):
                spread[block.numerator(number).start - len(mean)] = 0.0
        blocks.append(block)
        mean += values
        std += spread
        names += labels
    if max(rest, beyond) > 0.0:
        entries = [entry for block in blocks for entry in block.entries]
        block, values, spread, labels = _rest(fit, poles, entries, (rest, beyond), zero, len(mean))
        blocks, mean, std, names = [*blocks, block], [*mean, *values], [*std, *spread], [*names, *labels]
    form = Parametrisation(fit.dofs, np.array(A_inf), tuple(blocks), np.array(mean), np.array(std), tuple(names))
    form = replace(form, mean=form.tied(form.mean))
    return with_smooth_error(form, poles, prior) if smooth else form


def with_table(form: Parametrisation, model: Model) -> Parametrisation:
    """Return the parametrisation with what the model's fit leaves out of its data: as its sections can follow in their
    prior mean, where also motions feel it that are not measured, and the rest beside.
    """
    data, block = model.hydro, next((block for block in form.blocks if block.rest), None)
    if data is None or data.A_inf is None or data.omega.size < 2:
        return form
    omega, mean = np.array(data.omega), form.mean.copy()
    missing = data.B + 1j * omega[:, None, None] * (data.A - model.A_inf) - form.K(form.mean, omega)
    missing = 0.5 * (missing + missing.swapaxes(1, 2))
    if block is not None:
        basis = form.basis(form.mean, omega, block)
        for number, (j, k) in enumerate(block.entries):
            at = np.arange(mean.size)[block.numerator(number)]
            used = form.std[at] > 0.0
            columns = np.vstack([basis[used].T.real, basis[used].T.imag]) * form.std[at[used]]
            # What the data hardly see, as beyond their band, stays zero.
            right = np.r_[missing[:, j, k].real, missing[:, j, k].imag]
            mean[at[used]] = form.std[at[used]] * np.linalg.lstsq(columns, right, rcond=0.01)[0]
    left = missing + form.K(form.mean, omega) - form.K(mean, omega)
    return replace(form, mean=mean, beside=Remainder(omega, np.asarray(left, dtype=np.complex128)))


def with_smooth_error(form: Parametrisation, poles: ComplexArray, prior: float, length: float = 0.5,
                      rough: float = 0.1, wide: float = 3.0, floor: float = 0.1, count: int = 40) -> Parametrisation:
    """Return the parametrisation with a prior under which the relative error of the damping is smooth in frequency.

    The error of B_jk is half the sum of the errors of j and k, each a normal process in log omega; A follows by
    causality, because theta gives both. Independent coefficients would let B change sign, and A be off where no B
    causes it. `form`: with independent parameters. `prior`: relative standard deviation of K, as in `parametrise`.
    `length`: correlation length of the error in log omega. `rough`: white part of the error of each entry, over the
    smooth part. `wide`: largest deviation of what the damping does not show, over that of independent parameters.
    `floor`: share of the largest damping below which errors are relative to it. `count`: of frequencies, from a tenth
    to ten times the poles' own.
    """
    blocks = [block for block in form.blocks if not block.rest]
    entries = [entry for block in blocks for entry in block.entries]
    j, k = np.array(entries).T
    used = {i for block in blocks for i in range(block.start, block.numerator(len(block.entries) - 1).stop)}
    kernel = np.array([i for i in form.active if i in used])
    middle = np.exp(np.mean(np.log(np.abs(poles))))
    omega, low = np.geomspace(0.1, 10.0, count) * middle, np.linspace(0.0, 2.0, count) * middle
    B = form.K(form.mean, omega).real
    own = np.abs(np.einsum("wii->iw", B))
    own = np.maximum(own, floor * own.max(axis=1, keepdims=True))
    size = np.sqrt(own[j] * own[k])                                                 # (entries, nw)
    slopes = _slopes(form, kernel, omega)[..., j, k].real / size.T                  # (parameters, nw, entries)
    x = np.log(omega)
    smooth = np.exp(-0.5 * ((x[:, None] - x) / length) ** 2)
    shared = 0.25 * sum(1.0 * (a[:, None] == b) for a in (j, k) for b in (j, k))
    weight = (B[:, j, k].T / size)
    C = np.einsum("ew,wv,ef,fv->ewfv", weight, smooth, shared, weight).reshape(2 * (len(entries) * count,))
    J = slopes.transpose(2, 1, 0).reshape(len(entries) * count, kernel.size)
    precision = J.T @ np.linalg.solve(prior**2 * (C + rough**2 * np.eye(C.shape[0])), J)
    precision += np.diag((wide * form.std[kernel]) ** -2.0)
    root = np.diag(form.std[form.active])
    at = np.searchsorted(form.active, kernel)
    root[np.ix_(at, at)] = np.linalg.cholesky(np.linalg.inv(precision))
    spread = np.einsum("awjk,ab->bwjk", _slopes(form, kernel, low),
                       root[np.ix_(at, at)])
    K = form.K(form.mean, low)
    scale = np.maximum(np.sqrt(np.mean(np.abs(K) ** 2, axis=0)), 1e-300)
    root[np.ix_(at, at)] *= prior * np.sqrt(np.sum(np.abs(K / scale) ** 2) / np.sum(np.abs(spread / scale) ** 2))
    std = form.std.copy()
    std[form.active] = np.sqrt(np.sum(root**2, axis=1))
    return replace(form, std=std, root=root)


def _slopes(form: Parametrisation, which: NDArray[np.int64], omega: FloatArray) -> ComplexArray:
    """Return d K / d theta of some parameters, shape (parameters, nw, n, n)."""
    steps = 1e-6 * form.std[which]
    moved = form.mean + np.zeros((which.size, 1))
    moved[range(which.size), which] += steps
    return (form.K(form.tied(moved), omega) - form.K(form.mean, omega)) / steps[:, None, None, None]


def _rest(fit: RadiationFit, poles: ComplexArray, entries: list[tuple[int, int]], sizes: tuple[float, float],
          zero: bool, start: int, spacing: float = 0.6, damping: float = 0.4,
          floor: float = 0.1) -> tuple[ParameterBlock, list[float], list[float], list[str]]:
    """Return a block of damped sections over the band of the damping, numerators zero with a small spread.

    `sizes`: spread of each section at its own frequency, over the entry's largest |K|, and over the damping there (at
    least `floor` of its largest). `spacing` of the sections in log omega: a fit alternates about its data, over all of
    its band, and wide or few sections cannot follow that; the parameters of the fit would be sure of a compromise. An
    error as large everywhere as the damping is at its largest would be a damper, which it is to be told from.
    """
    w = _band(fit, poles, floor, spacing)
    order = 2 * w.size
    gain = np.abs(fit.frequency_response(np.r_[w, np.abs(poles)])).max(axis=0)
    own = np.abs(np.einsum("wjj->wj", fit.frequency_response(w).real))
    own = np.maximum(own, floor * own.max(axis=0))
    values, spread = [v for x in w for v in (x**2, 2.0 * damping * x)], [0.0] * order
    for j, k in entries:
        top = 2.0 * damping * w * np.hypot(sizes[0] * gain[j, k], sizes[1] * np.sqrt(own[:, j] * own[:, k]))
        spread += [v for x, size in zip(w, top) for v in (0.0 if zero else 0.7 * size * x, size)]
    names = [f"rest_{i}" for i in range(len(spread))]
    values += [0.0] * (len(spread) - order)
    block = ParameterBlock(tuple(entries), order, "sections", w.size, start, tuple(range(len(entries))), rest=True)
    return block, [float(v) for v in values], [float(v) for v in spread], names


def _band(fit: RadiationFit, poles: ComplexArray, share: float, spacing: float) -> FloatArray:
    """Return frequencies about `spacing` apart in log omega, from the first to the last with a share of the damping."""
    size = np.abs(poles)
    omega = np.geomspace(0.05 * size.min(), 20.0 * size.max(), 600)
    B = np.abs(np.einsum("wjj->wj", fit.frequency_response(omega).real))
    first, *_, last = omega[(B > share * B.max(axis=0)).any(axis=1)]
    return np.geomspace(first, last, 1 + int(np.ceil(np.log(last / first) / spacing)))


def _poles_and_residues(fit: RadiationFit, same_pole: float = 1e-6) -> tuple[ComplexArray, ComplexArray]:
    """Return poles (N,) a relative `same_pole` apart, and their residue matrices (N, n, n), symmetric part.

    A double pole of one entry is two poles a relative 1e-4 apart: one alone would lose what falls as t exp(pt).
    """
    values, vectors = np.linalg.eig(fit.a)
    left = np.linalg.solve(vectors, fit.b)
    residues = np.einsum("jk,kl->kjl", fit.c @ vectors, left)
    residues = 0.5 * (residues + residues.transpose(0, 2, 1))
    poles: list[complex] = []
    sums: list[ComplexArray] = []
    for value, residue in zip(values, residues):
        same = next((i for i, p in enumerate(poles) if abs(p - value) < same_pole * abs(value)), None)
        if same is None:
            poles.append(value)
            sums.append(residue)
        else:
            sums[same] = sums[same] + residue
    found, w = np.array(poles), np.r_[np.abs(values), 0.3 * np.abs(values), 3.0 * np.abs(values)]
    K = fit.frequency_response(w)
    K = 0.5 * (K + K.transpose(0, 2, 1))
    simple = np.einsum("wp,pjk->wjk", 1.0 / (1j * w[:, None] - found), np.array(sums))
    if np.abs(simple - K).max() <= 1e-6 * np.abs(K).max():
        return found, np.array(sums)
    number = np.array([np.sum(np.abs(values[:i] - p) < same_pole * abs(p)) for i, p in enumerate(values)])
    apart = values * (1.0 + 1e-4 * number)
    basis = 1.0 / (1j * np.r_[w, -w][:, None] - apart)
    R = np.linalg.lstsq(basis, np.concatenate([K, K.conj()]).reshape(2 * w.size, -1), rcond=None)[0]
    return np.asarray(apart, dtype=np.complex128), np.asarray(R.reshape(-1, *K.shape[1:]), dtype=np.complex128)


def _groups(poles: ComplexArray, residues: ComplexArray,
            negligible: float = 1e-8) -> dict[tuple[int, ...], list[tuple[int, int]]]:
    """Return the entries (j, k), j <= k, by the set of poles that have more than a share `negligible` of them."""
    size = np.abs(residues) / np.abs(poles)[:, None, None]
    entry_size = size.max(axis=0)
    diagonal = np.sqrt(np.diag(entry_size))
    groups: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for j in range(len(diagonal)):
        for k in range(j, len(diagonal)):
            if entry_size[j, k] <= negligible * diagonal[j] * diagonal[k]:
                continue
            members = tuple(int(i) for i in np.flatnonzero(size[:, j, k] > negligible * entry_size[j, k]))
            groups.setdefault(members, []).append((j, k))
    return groups


def _block(p: ComplexArray, R: ComplexArray, entries: list[tuple[int, int]], prior: float, start: int,
           dofs: tuple[str, ...], negligible: float = 1e-8,
           ) -> tuple[ParameterBlock, list[float], list[float], list[str]]:
    """Return a block with its prior means, standard deviations and names.

    Coefficients of a numerator that are `negligible` beside its largest, each at the poles' own frequency, are zero.
    """
    label = [f"[{dofs[j]},{dofs[k]}]" if len(dofs) > 1 else "" for j, k in entries]
    shared = label[0] if len(entries) == 1 else f"[{'+'.join(item.strip('[]') for item in label)}]"
    r, places = p.size, tuple(range(len(entries)))
    a = np.asarray(np.poly(p).real[:0:-1], dtype=float)
    others = np.array([np.atleast_1d(np.poly(np.delete(p, i))) for i in range(r)])
    numerators = (R @ others).real[:, ::-1]
    size = np.abs(numerators) * np.exp(np.mean(np.log(np.abs(p)))) ** np.arange(r)
    numerators[size < negligible * size.max(axis=1, keepdims=True)] = 0.0
    values = np.concatenate([a, *numerators])
    spread = np.abs(values)
    block = ParameterBlock(tuple(entries), r, "polynomial", 0, 0, places)
    spread = spread * prior / relative_spread(block, values, spread, p)
    if _mostly_stable(a, prior):
        names = [f"a{i + 1}{shared}" for i in range(r)]
        names += [f"b{i + 1}{label[e]}" for e in range(len(R)) for i in range(r)]
        return replace(block, start=start), list(values), list(spread), names
    upper = np.flatnonzero(p.imag > 1e-12 * np.abs(p))
    real = np.flatnonzero(np.abs(p.imag) <= 1e-12 * np.abs(p))
    den = [v for i in upper for v in (abs(p[i]) ** 2, -2.0 * p[i].real)] + [-p[i].real for i in real]
    coefficients, sizes = list(den), list(den)
    for e in range(len(R)):
        for i in upper:
            r1, r0 = 2.0 * R[e, i].real, -2.0 * (R[e, i] * p[i].conj()).real
            size = float(np.hypot(r0, abs(p[i]) * r1))
            coefficients += [r0, r1]
            sizes += [size, size / abs(p[i])]
        coefficients += [R[e, i].real for i in real]
        sizes += [abs(R[e, i].real) for i in real]
    kinds = [f"{x}_{i + 1}" for i in range(len(upper)) for x in ("c0", "c1")] + [f"c_{i + 1}" for i in range(len(real))]
    names = [kind + shared for kind in kinds]
    names += [kind.replace("c", "r", 1) + label[e] for e in range(len(R)) for kind in kinds]
    block = ParameterBlock(tuple(entries), r, "sections", len(upper), 0, places)
    factor = prior / relative_spread(block, np.array(coefficients), np.array(sizes), p)
    return replace(block, start=start), [float(v) for v in coefficients], [factor * float(v) for v in sizes], names


def relative_spread(block: ParameterBlock, mean: FloatArray, std: FloatArray, poles: ComplexArray) -> float:
    """Return the relative standard deviation of a block's K, rms over frequency and entries, to first order."""
    n = 1 + max(k for _, k in block.entries)
    form = Parametrisation(("",) * n, np.zeros((n, n)), (block,), mean, std, ())
    omega = np.linspace(0.0, 2.0 * np.exp(np.mean(np.log(np.abs(poles)))), 40)
    steps = 1e-6 * std * np.eye(mean.size)
    K = form.K(mean, omega)
    # Entries of different units count alike.
    size = np.maximum(np.sqrt(np.mean(np.abs(K) ** 2, axis=0)), 1e-300)
    slopes = (form.K(mean + steps, omega) - form.K(mean - steps, omega)) / 2e-6
    return float(np.sqrt(np.sum(np.abs(slopes / size) ** 2) / np.sum(np.abs(K / size) ** 2)))


def _mostly_stable(a: FloatArray, prior: float, share: float = 0.9) -> bool:
    """Return whether a share of denominators with coefficients off by a relative `prior` are stable."""
    draws = a * (1.0 + prior * np.random.default_rng(0).standard_normal((200, a.size)))
    stable = [(row > 0.0).all() and np.roots([1.0, *row[::-1]]).real.max() < 0.0 for row in draws]
    return bool(np.mean(stable) >= share)
