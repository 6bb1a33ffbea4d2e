"""From a method's draws to the result: bands, parameters, and the shares of prior, points and data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.filter.estimate import Band, by_parts
from radiation_ss.identification.result import Identification, nearest_passive
from radiation_ss.identification.study import Findings, Study


def assemble(study: Study, method: str, omega: FloatArray, findings: Findings) -> Identification:
    """Return the Identification of a method's findings at the frequencies omega [rad/s]."""
    form = study.form
    theta = form.theta(findings.u)
    K = form.K(theta, omega)
    A_inf = draws_of_A_inf(study, findings.u)
    A_draws = A_inf[:, None] + K.imag / omega[:, None, None]
    power = with_power(findings.bands, omega)
    shares = information_shares(study, findings.u, K, omega)
    shares |= {"data": np.where(power, shares["data"], 0.0), "prior": shares["prior"] + ~power * shares["data"]}
    prior_K = form.K(form.mean, omega)
    prior = {"K": prior_K, "B": prior_K.real, "A": form.A_inf + prior_K.imag / omega[:, None, None]}
    estimate = theta.mean(axis=0) if findings.centre is None else form.theta(findings.centre)
    centre, mended = nearest_passive(form.own, form.tied(estimate), theta)
    parameters = _parameters(study, theta, estimate)
    nominal = _nominal(study, findings.u)
    warnings = (*findings.warnings, *warnings_of(study, findings, parameters, nominal, shares, mended))
    zero = form.K(theta, [0.0])[:, 0].real
    bands = {"A": Band.of(A_draws), "B": Band.of(K.real), "K": Band.of(K), "K_zero": Band.of(zero)}
    if findings.centre is not None:
        at = form.K(estimate, omega)
        values = {"A": A_inf.mean(axis=0) + at.imag / omega[:, None, None], "B": at.real, "K": at,
                  "K_zero": form.K(estimate, [0.0])[0].real}
        bands = {name: band.about(values[name]) for name, band in bands.items()}
    if not power.all():
        bands = widened(study, bands, A_inf, omega, ~power)
    baseline = {"what": "parameters left at the prior mean", "A": prior["A"], "B": prior["B"],
                "distance_of_K": float(np.linalg.norm(prior_K - bands["K"].mean) / np.linalg.norm(bands["K"].mean)),
                **({} if findings.passive is None else {"passive_share": findings.passive}), **findings.baseline}
    return Identification(
        method=method, dofs=form.dofs, omega=omega, **bands, A_inf=form.A_inf,
        fit=form.own.realise(centre, method=f"identified by {method}"), parameters=parameters | nominal,
        sea=findings.sea, information={"omega": omega, "power": power, **shares}, force=findings.force,
        baseline=baseline, warnings=warnings, draws=theta, prior=prior, model=study.model, form=form, u=findings.u)


def draws_of_A_inf(study: Study, u: FloatArray) -> FloatArray:
    """Return the added mass at infinite frequency of draws u, shape (S, n, n), from what the records say of inertia.

    Motion tells M + A_inf alone: its change is shared out by the tolerances of the two, and what that leaves open is
    drawn.
    """
    form, tolerance, mass = study.form, study.rules.tolerances, np.diag(study.model.M)
    own, rng = np.diag(form.A_inf), np.random.default_rng(study.seed)
    root = np.ones((u.shape[0], own.size))
    for i, (kind, j, _, _) in enumerate(form.nominal):
        if kind == "inertia" and own[j] > 0.0:
            a, m = tolerance["A_inf"] * own[j], tolerance["mass"] * mass[j]
            moved = form.nominal_change(u)[:, i] * (own[j] + mass[j]) * a**2 / (a**2 + m**2)
            moved += a * m / np.hypot(a, m) * rng.standard_normal(u.shape[0])
            root[:, j] = np.sqrt(np.maximum(1.0 + moved / own[j], 0.05))
    return np.asarray(root[:, :, None] * form.A_inf * root[:, None, :])


def with_power(bands: Sequence[tuple[float, float]], omega: FloatArray) -> np.ndarray:
    """Return at which of the frequencies some record has power, to half a step of omega, shape (nw,)."""
    if not bands:
        return np.ones(omega.size, dtype=bool)
    edges = np.r_[omega[0], 0.5 * (omega[1:] + omega[:-1]), omega[-1]]
    return np.any([(edges[1:] >= low) & (edges[:-1] <= high) for low, high in bands], axis=0)


def widened(study: Study, bands: dict[str, Band], A_inf: FloatArray, omega: FloatArray,
            where: np.ndarray) -> dict[str, Band]:
    """Return the bands of A, B and K made at least the prior's at some frequencies; draws of A_inf (S, n, n)."""
    K = _draws_of_K(study, np.eye(study.n_u), np.zeros(study.n_u), omega[where], np.random.default_rng(3))
    any_A_inf = A_inf[np.arange(K.shape[0]) % A_inf.shape[0]][:, None]
    priors = {"A": any_A_inf + K.imag / omega[where][:, None, None], "B": K.real, "K": K}
    out = dict(bands)
    for name, draws in priors.items():
        wide, band = Band.of(draws), bands[name]
        lower, upper = band.lower.copy(), band.upper.copy()
        lower[where] = by_parts(np.minimum, lower[where], wide.lower)
        upper[where] = by_parts(np.maximum, upper[where], wide.upper)
        out[name] = Band(band.mean, lower, upper)
    return out


def _row(values: FloatArray, mean: float, prior_mean: float, prior_std: float) -> dict[str, float]:
    std = float(values.std())
    known = prior_std > 0.0
    return {"mean": float(mean), "std": std, "prior_mean": float(prior_mean), "prior_std": float(prior_std),
            "moved": float((mean - prior_mean) / prior_std) if known else 0.0,
            "resolved": float(max(0.0, 1.0 - (std / prior_std) ** 2)) if known else 0.0}


def _parameters(study: Study, theta: FloatArray, estimate: FloatArray) -> dict[str, dict[str, float]]:
    form = study.form
    kept = {i for block in form.own.blocks for entry in range(len(block.entries))
            for i in (*range(form.mean.size)[block.denominator], *range(form.mean.size)[block.numerator(entry)])}
    return {name: _row(theta[:, i], estimate[i], form.mean[i], form.std[i]) for i, name in enumerate(form.names)
            if i in kept}


def _nominal(study: Study, u: FloatArray) -> dict[str, dict[str, float]]:
    """Return the relative changes of the model's nominal numbers."""
    form = study.form
    change = form.nominal_change(u) if form.nominal else np.empty((1, 0))
    return {f"{kind} [{form.dofs[dof]}]": _row(values, values.mean(), 0.0, tolerance)
            for (kind, dof, tolerance, _), values in zip(form.nominal, change.T)}


def information_shares(study: Study, u: FloatArray, K: ComplexArray, omega: FloatArray) -> dict[str, FloatArray]:
    """Return the shares of prior, points and data in the precision of K at each frequency, each (nw,), sum 1.

    1/V0, 1/V1 - 1/V0 and 1/V2 - 1/V1, with V the variance of K under the prior, with points, and with everything;
    entries are pooled.
    """
    rng = np.random.default_rng(1)
    V0 = _variance(_draws_of_K(study, np.eye(study.n_u), np.zeros(study.n_u), omega, rng))
    V2 = _variance(K)
    prior = _pooled(V2, V0)
    if study.points is None:
        return {"prior": prior, "points": np.zeros_like(prior), "data": 1.0 - prior}
    if not study.records:
        return {"prior": prior, "points": 1.0 - prior, "data": np.zeros_like(prior)}
    centre = u.mean(axis=0)
    jacobian = study.points.jacobian(centre)
    covariance = np.asarray(np.linalg.inv(np.eye(study.n_u) + jacobian.T @ jacobian), dtype=np.float64)
    before_data = np.maximum(_pooled(V2, _variance(_draws_of_K(study, covariance, centre, omega, rng))), prior)
    return {"prior": prior, "points": before_data - prior, "data": 1.0 - before_data}


def _pooled(small: FloatArray, large: FloatArray) -> FloatArray:
    """Return the ratio of variances (nw, n, n), averaged over entries with any, between 0 and 1."""
    used = large > 0.0
    ratio = np.divide(small, large, out=np.ones_like(large), where=used)
    return np.asarray(np.clip(np.mean(ratio, axis=(1, 2), where=used), 0.0, 1.0), dtype=np.float64)


def _variance(K: ComplexArray) -> FloatArray:
    return np.asarray(np.var(K.real, axis=0) + np.var(K.imag, axis=0), dtype=np.float64)


def _draws_of_K(study: Study, covariance: FloatArray, centre: FloatArray, omega: FloatArray,
                rng: np.random.Generator) -> ComplexArray:
    """Return K of 2000 draws of a normal distribution of u, those that the prior allows."""
    root = np.linalg.cholesky(covariance)
    draws = centre + rng.standard_normal((2000, study.n_u)) @ root.T
    return study.form.K(study.form.theta(study.kept(draws)), omega)


def warnings_of(study: Study, findings: Findings, parameters: dict[str, dict[str, float]],
                nominal: dict[str, dict[str, float]], shares: dict[str, FloatArray], mended: str) -> Iterator[str]:
    """Yield what the user must know about where the numbers came from; `mended`: what made the memory passive."""
    rules, what = study.rules, {"inertia": "mass or A_inf", "stiffness": "hydrostatics or mooring",
                                "sensor": "gain of the motion sensor"}
    by_elevation = any(kind == "sensor" for kind, *_ in study.form.nominal) and all(
        record.kind != "decay" and record.get("force", study.model.dofs) is None for record in study.records)
    tied = ", or X with the damping that it is tied to" if by_elevation else ""
    for name, row in nominal.items():
        if abs(row["mean"]) > rules.doubt * row["std"]:
            yield (f"the records ask for {name} {row['mean']:+.1%} +- {row['std']:.1%} off the model's "
                   f"({what[name.split()[0]]}{tied}; tolerance {row['prior_std']:.1%}): check it")
    far = [f"{name} by {row['moved']:+.2g}" for name, row in parameters.items()
           if abs(row["moved"]) > rules.contradiction]
    if far:
        yield (f"prior and records contradict each other: {', '.join(far)} prior standard deviations; the prior is too "
               "narrow for this body, or something the model lacks (viscous damping, timing, calibration) went into "
               "the parameters, which the bands do not cover")
    if mended:
        yield mended
    if findings.passive is not None and findings.passive <= rules.least_passive:
        before = study.passive(np.random.default_rng(2).standard_normal((200, study.n_u))).mean()
        yield ("passivity is no condition of the bands: hardly any draw of the prior is passive, because the "
               "radiation model itself is close to the limit" if before <= rules.least_passive else
               "the records ask for a radiation kernel that gives energy to the body (passive with a probability of "
               f"{findings.passive:.1g}), so passivity was not made a condition of the bands; look for an error of "
               "phase, scale or A_inf")
    data, points = float(shares["data"].mean()), float(shares["points"].mean())
    if study.points is not None and points > 0.5 and data < 0.1:
        yield (f"the known points do the work: they give {100 * points:.0f} % of the precision of K on average, the "
               f"records {100 * data:.0f} %")
    if study.records and data < 0.05:
        yield (f"the records add next to nothing: {100 * data:.1f} % of the precision of K on average; the result is "
               "the prior" + (" and the points" if study.points is not None else ""))
