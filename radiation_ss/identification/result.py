"""Result of `identify`: coefficients, force and sea with bands, and where each number came from; made of draws."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtr, ndtri

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.filter.estimate import Band, by_parts, plants_of
from radiation_ss.fit.result import RadiationFit
from radiation_ss.identification.laws import direction, taken_apart
from radiation_ss.identification.passivity import nearest_passive
from radiation_ss.identification.study import Findings, ForceEstimate, Study, information_shares
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.methods import Shown, later

if TYPE_CHECKING:
    import control as ct
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Shown):
    """What the records say of a body's radiation, and how surely.

    Parameters
    ----------
    method : str
    dofs : tuple of str
    omega : ndarray, shape (nw,)
        Frequencies [rad/s] of A, B, K and the information shares.
    A, B, K : Band of (nw, n, n)
        Added mass, damping, K(iw) = B + i w (A - A_inf). A holds the doubt about A_inf, and what the records say of it,
        by its tolerance beside the mass's; K does not need it.
    K_zero : Band of (n, n)
        K(0) = B(0).
    A_inf : ndarray, shape (n, n)
        Added mass at infinite frequency of the model.
    fit : RadiationFit
        The subsystem of the mean parameters.
    parameters : dict
        name -> mean, std, prior_mean, prior_std, moved (change of the mean over the prior's standard deviation) and
        resolved (1 - posterior variance / prior variance); prior_std, moved and resolved are 0 where K(0) = 0 makes a
        number of the others. `inertia [dof]`, `stiffness [dof]`, `sensor [dof]`,
        `force [dof]`: relative changes of the model's nominal numbers. `damping [dof]`: linear damping [SI] beside the
        model's and the waves', where the records ask for it; `damping [dof,dof]` between two bodies.
    sea : dict
        Record -> Hs [m], Tp [s], gamma, each with mean, lower, upper; and tests of the sea model. Empty without one.
    information : dict
        "omega" and, per frequency, the shares "prior", "points", "data" of the estimate's precision: they add up to 1;
        "power": whether a record has power there. Without power the band is at least the prior's and "data" is zero.
    force : dict
        Record -> ForceEstimate; empty where the force was known.
    baseline : dict
        What the prior model gives, beside the estimate.
    warnings : tuple of str
    draws : ndarray, shape (S, d)
        Draws of the parameters from the posterior.
    prior : dict
        "A", "B", "K": the model's own coefficients, (nw, n, n).
    model : Model
        The model that was given.
    form : Parametrisation
        How draws become bodies.
    u : ndarray, shape (S, d_u)
        The draws, standardised; with the model's nominal numbers.
    damping : dict
        Name as in `parameters` -> draws (S,) of linear damping [SI] beside the model's and the waves'.

    Examples
    --------
    The band of the damping, which a known value at 6 rad/s narrows there.

    >>> import radiation_ss as rss
    >>> fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    >>> model = rss.Model(("Heave",), [[50.0]], [[30.0]], [[3000.0]], fit)
    >>> found = rss.identify(model, [], "points", points=[6.0], omega=[3.0, 6.0])
    >>> width = (found.B.upper - found.B.lower)[:, 0, 0]
    >>> bool(width[1] < 0.2 * width[0]), found.force
    (True, {})
    """

    method: str
    dofs: tuple[str, ...]
    omega: FloatArray
    A: Band
    B: Band
    K: Band
    K_zero: Band
    A_inf: FloatArray
    fit: RadiationFit
    parameters: Mapping[str, Mapping[str, float]]
    sea: Mapping[str, Any]
    information: Mapping[str, FloatArray]
    force: Mapping[str, ForceEstimate]
    baseline: Mapping[str, Any]
    warnings: tuple[str, ...]
    draws: FloatArray
    prior: Mapping[str, np.ndarray]
    model: Model
    form: Parametrisation
    u: FloatArray
    damping: Mapping[str, FloatArray]

    def plants(self, n: int) -> "list[ct.StateSpace]":
        """Return n plants of the posterior as ct.StateSpace with the signals of `cummins`, for robust LQR or MPC.

        The radiation of each is passive: that of a draw, with what the fit's order leaves out, or the nearest to it.
        `A` and `B` are the bands of these; where the records have no power they are at least the prior's.

        Raises
        ------
        InputError
            If there are not that many draws.

        >>> [plant.input_labels for plant in found.plants(2)]
        [['heave_force'], ['heave_force']]
        """
        def build(member: FloatArray) -> Model:
            u, D = member[:self.u.shape[1]], self.model.D
            for name, damping in zip(self.damping, member[u.size:]):
                along = direction(self.dofs, taken_apart(name)[1])
                D = D + damping * np.outer(along, along)
            inertia, stiffness = self.form.rigid(u, self.model.M + self.A_inf, self.model.C)
            fit = self.form.realise(nearest_passive(self.form, self.form.theta(u), self.draws)[0])
            return self.model.replace(M=inertia - self.A_inf, C=stiffness, D=D, fit=fit, hydro=None)

        return plants_of(np.vstack([self.u.T, *self.damping.values()]), n, build, "the draws of the posterior")

    def to_dict(self, force_files: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Return the JSON form of the interface.

        >>> found.to_dict()["schema"]
        'radiation_ss.identification/1'
        """
        return later("report.identification_files:to_dict", self, force_files)

    def save(self, folder: str | Path) -> Path:
        """Write identify.json, force_<record>.csv for each estimated force, and pictures; return the folder.

        >>> sorted(path.name for path in found.save("found").iterdir())
        ['coefficients.png', 'identify.json']
        """
        return later("report.identification_files:save", self, folder)

    def plot(self) -> "Figure":
        """Return a figure of A, B and the information shares of each diagonal entry.

        >>> len(found.plot().axes)
        3
        """
        return later("report.identification_files:coefficients", self)

    def __str__(self) -> str:
        return later("report.identification_files:text", self)


def assemble(study: Study, method: str, omega: FloatArray, findings: Findings) -> Identification:
    """Return the Identification of a method's findings at the frequencies omega [rad/s]."""
    form = study.form
    theta = form.theta(findings.u)
    K = form.K(theta, omega)
    A_inf = study.draws_of_A_inf(findings.u)
    A_draws = A_inf[:, None] + K.imag / omega[:, None, None]
    power = findings.with_power(omega)
    shares = information_shares(study, findings.u, K, omega)
    shares |= {"data": np.where(power, shares["data"], 0.0), "prior": shares["prior"] + ~power * shares["data"]}
    prior_K = form.K(form.mean, omega)
    prior = {"K": prior_K, "B": prior_K.real, "A": form.A_inf + prior_K.imag / omega[:, None, None]}
    estimate = theta.mean(axis=0) if findings.centre is None else form.theta(findings.centre)
    centre, mended = nearest_passive(form.own, form.tied(estimate), theta)
    parameters = _parameters(study, theta, estimate)
    nominal = _nominal(study, findings.u)
    damping = {f"damping [{taken_apart(law)[1]}]": _row(values, values.mean(), 0.0, size)
               for law, (values, size) in findings.damping.items()}
    said = warnings_of(study, findings, parameters, nominal, shares | {"power": power}, mended)
    warnings = (*findings.warnings, *said)
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
        fit=form.own.realise(centre, method=f"identified by {method}"), parameters=parameters | nominal | damping,
        sea=findings.sea, information={"omega": omega, "power": power, **shares}, force=findings.force,
        baseline=baseline, warnings=warnings, draws=theta, prior=prior, model=study.model, form=form, u=findings.u,
        damping=dict(zip(damping, (values for values, _ in findings.damping.values()))))


def widened(study: Study, bands: dict[str, Band], A_inf: FloatArray, omega: FloatArray,
            where: np.ndarray) -> dict[str, Band]:
    """Return the bands of A, B and K made at least the prior's at some frequencies; draws of A_inf (S, n, n)."""
    K = study.draws_of_K(np.eye(study.n_u), np.zeros(study.n_u), omega[where], np.random.default_rng(3))
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


def warnings_of(study: Study, findings: Findings, parameters: dict[str, dict[str, float]],
                nominal: dict[str, dict[str, float]], shares: dict[str, FloatArray], mended: str) -> Iterator[str]:
    """Yield what the user must know about where the numbers came from; `mended`: what made the memory passive."""
    rules, what = study.rules, {"inertia": "mass or A_inf", "stiffness": "hydrostatics or mooring",
                                "sensor": "gain of the motion sensor",
                                "force": "X, or the gain of the wave probe"}
    if study.records and all(record.kind == "decay" for record in study.records):
        for kind, other in (("inertia", "stiffness"), ("stiffness", "inertia")):
            what[kind] += f", or the {other}: decays tell their ratio alone"
    by_elevation = any(kind == "force" for kind, *_ in study.form.nominal) and all(
        record.kind != "decay" and record.get("force", study.model.dofs) is None for record in study.records)
    tied = ", or X with the damping that it is tied to" if by_elevation else ""
    for name, row in nominal.items():
        kind = name.split()[0]
        if abs(row["mean"]) > rules.doubt * row["std"]:
            yield (f"the records ask for {name} {row['mean']:+.1%} +- {row['std']:.1%} off the model's "
                   f"({what[kind]}{tied if kind != 'force' else ''}; tolerance {row['prior_std']:.1%}): check it")
    moved = {name: row["moved"] for name, row in parameters.items() if row["prior_std"] > 0.0}
    limit = -ndtri(ndtr(-rules.contradiction) / max(len(moved), 1))
    far = sorted((name for name in moved if abs(moved[name]) > limit), key=lambda name: -abs(moved[name]))
    if far:
        yield (f"prior and records contradict each other: {len(far)} of {len(moved)} radiation parameters move beyond "
               f"{limit:.2g} prior standard deviations, {far[0]} by {moved[far[0]]:+.2g}; the prior is too narrow for "
               "this body, or something the model lacks (viscous damping, timing, calibration) went into "
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
    powered = shares["power"] if shares["power"].any() else slice(None)
    data, points = float(shares["data"][powered].mean()), float(shares["points"][powered].mean())
    if study.points is not None and points > 0.5 and data < 0.1:
        yield (f"the known points do the work: they give {100 * points:.0f} % of the precision of K on average, the "
               f"records {100 * data:.0f} %")
    if study.records and data < 0.05:
        yield (f"the records add next to nothing: {100 * data:.1f} % of the precision of K on average where they have "
               "power; the answer is hardly surer than the prior" + (" and the points" if study.points is not None else
                                                                     ""))
