"""What each identification method is given (options, model, prior, records) and hands back."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray, check_numbers, is_number
from radiation_ss.body.model import Model, checked_tolerance
from radiation_ss.errors import InputError
from radiation_ss.fit.certificate import PASSIVE
from radiation_ss.identification.passivity import passive
from radiation_ss.inference.laplace import Climb, Likelihood, Peak, Target, find_peak
from radiation_ss.inference.parameters import Parametrisation
from radiation_ss.inference.points import PointLikelihood, Points
from radiation_ss.records.record import Record

NUMBERS: tuple[tuple[str, Callable[[Any], bool], str], ...] = (
    ("draws", lambda value: is_number(value, whole=True) and value >= 20, "a whole number, at least 20, is needed"),
    ("most_laws", lambda value: is_number(value, whole=True) and value >= 0, "a whole number, 0 or more, is needed"),
    ("beyond", lambda value: 0.0 <= value < np.inf, "a number, 0 or more, is needed"),
    ("point_tolerance", lambda value: 0.0 < value < np.inf, "a number above 0 is needed"),
    ("hopeless contradiction doubt", lambda value: value > 0.0, "a number above 0 is needed"),
    ("least_passive nonlinear nonlinear_elevation misfit", lambda value: 0.0 <= value <= 1.0,
     "a number from 0 to 1 is needed"))
TOLERANCES = {"mass": 0.02, "A_inf": 0.02, "stiffness": 0.02, "kernel": 0.01, "force": 0.05, "sensor": 0.005}


@dataclass(frozen=True)
class Settings:
    """Options of `identify` beside its arguments.

    Raises
    ------
    InputError
        On one that is not usable.
    """

    # Relative standard deviations of what the model states: one number, or by name. "mass", "A_inf", "stiffness", 0.02;
    # "force" (X): 0.05; "kernel" (what the model's order leaves out of K): 0.01 or the fit's own error if that is
    # larger; "sensor" (gain of the motion sensors): 0.005. "sensor" enters where the force is known, "force" and
    # "kernel" there and with several degrees of freedom.
    tolerance: float | Mapping[str, float] | None = None
    beyond: float = 0.3  # Error of K that no coefficients of the order make, over `prior`, where a force is measured
    point_tolerance: float = 1e-3  # Relative standard deviation of K at the points
    draws: int = 1000  # Number of draws kept of the posterior
    hopeless: float = 6.0  # Log odds below the best at which a sea of motion alone, or a mode of it, is left out
    least_passive: float = 0.02  # Share of the posterior that must be passive for the rest to be left out
    # contradiction, doubt: A warning is given where radiation parameters move farther than all of them stay within with
    # the probability of one within `contradiction` prior standard deviations, or a nominal number beyond `doubt` of its
    # own
    contradiction: float = 3.0
    doubt: float = 2.5
    # nonlinear, nonlinear_elevation, most_laws: Chance of a false warning about a nonlinear law, and where all forces
    # come from an elevation (five standard deviations: X's error is believed to be smooth); number of laws that are
    # taken into the model
    nonlinear: float = 0.04
    nonlinear_elevation: float = 6e-7
    most_laws: int = 3
    misfit: float = 1e-4  # Chance of a false warning about prediction errors that noise does not explain
    # Of the dual filter: as printed, with Q_theta, Q_state, Q_force, R and `units` as `DualEnKF` takes them
    preset: str | None = None
    filter: Mapping[str, Any] = field(default_factory=dict)  # More options of `DualEnKF`

    def __post_init__(self) -> None:
        check_numbers(self, NUMBERS)
        _ = self.tolerances     # refuses what is none

    @property
    def tolerances(self) -> dict[str, float]:
        """A tolerance for each name: one number for all, or by name, the default where not named."""
        given = {} if self.tolerance is None else self.tolerance
        return {**TOLERANCES, **checked_tolerance(given, TOLERANCES, exact=True)}


FILTER = ("Q_theta", "Q_state", "Q_force", "R", "units", "analysis", "inflation", "order", "n_ensemble")


def settings_of(options: Mapping[str, Any]) -> Settings:
    """Return the settings with some changed; those of the dual filter by their own names too."""
    known = [name for name in Settings.__dataclass_fields__ if name != "filter"]
    unknown = [name for name in options if name not in (*known, *FILTER)]
    if unknown:
        raise InputError(f"identify: option {unknown[0]!r} is unknown; there are {', '.join((*known, *FILTER))}")
    return Settings(**{name: value for name, value in options.items() if name in known},
                    filter={name: value for name, value in options.items() if name in FILTER})


def left_out(model: Model, rules: Settings) -> float:
    """Return what the model's order may leave out of K, relative."""
    return max(rules.tolerances["kernel"], float(model.fit.relative_error or 0.0))


@dataclass(frozen=True, eq=False)
class Study:
    """Model, prior, records and known points of one identification."""

    model: Model
    form: Parametrisation
    records: tuple[Record, ...]
    points: PointLikelihood | None
    given_points: Points | None
    seed: int
    rng: np.random.Generator
    rules: Settings

    @property
    def n_u(self) -> int:
        """Number of radiation parameters that may move."""
        return self.form.size

    def target(self, likelihoods: Sequence[Likelihood]) -> Target:
        """Return the posterior of these likelihoods with prior, stability, passivity and points."""
        known: list[Likelihood] = [] if self.points is None else [self.points]
        return Target(self.n_u, [*known, *likelihoods], self.allowed, self.passive)

    def allowed(self, u: FloatArray) -> np.ndarray:
        """Return which of u, shape (..., n_u), give a stable subsystem."""
        return self.form.stable(self.form.theta(u))

    def passive(self, u: FloatArray) -> np.ndarray:
        """Return which of u, shape (S, n_u), are passive but for what the model's order leaves out."""
        return passive(self.form, self.form.theta(u), max(PASSIVE, left_out(self.model, self.rules)))

    def kept(self, u: FloatArray) -> FloatArray:
        """Return the draws u, shape (S, n_u), that are stable, and passive where enough of them are."""
        stable = u[self.allowed(u)]
        stable = stable if stable.shape[0] > 20 else u
        inside = self.passive(stable)
        return stable[inside] if inside.mean() > self.rules.least_passive and inside.sum() > 20 else stable

    def draws_of_K(self, covariance: FloatArray, centre: FloatArray, omega: FloatArray,
                   rng: np.random.Generator) -> ComplexArray:
        """Return K of 2000 draws of a normal distribution of u, those that the prior allows."""
        draws = centre + rng.standard_normal((2000, self.n_u)) @ np.linalg.cholesky(covariance).T
        return self.form.K(self.form.theta(self.kept(draws)), omega)

    def draws_of_A_inf(self, u: FloatArray) -> FloatArray:
        """Return A_inf of draws u, shape (S, n, n), from what the records say of inertia.

        Motion tells M + A_inf alone: its change is shared out by the tolerances of the two, and what that leaves open
        is drawn.
        """
        form, tolerance, mass = self.form, self.rules.tolerances, np.diag(self.model.M)
        own, rng = np.diag(form.A_inf), np.random.default_rng(self.seed)
        root = np.ones((u.shape[0], own.size))
        for i, (kind, j, _, _) in enumerate(form.nominal):
            if kind == "inertia" and own[j] > 0.0:
                a, m = tolerance["A_inf"] * own[j], tolerance["mass"] * mass[j]
                moved = form.nominal_change(u)[:, i] * (own[j] + mass[j]) * a**2 / (a**2 + m**2)
                moved += a * m / np.hypot(a, m) * rng.standard_normal(u.shape[0])
                root[:, j] = np.sqrt(np.maximum(1.0 + moved / own[j], 0.05))
        return np.asarray(root[:, :, None] * form.A_inf * root[:, None, :])


def with_body_held(part: Any, u: FloatArray, start: FloatArray, steps: int) -> Peak:
    """Return the most probable nuisance parameters for the body u, or what some steps from a start come to."""
    likelihood: Any = SimpleNamespace(size=part.size, value=lambda _, v: part.value(u, v),
                                      local=lambda _, v: part.local(u, v, body=False))
    target = Target(0, [likelihood], lambda rows: np.ones(rows.shape[0], dtype=bool))
    return find_peak(target, start, Climb(steps, rough=True))


@dataclass(frozen=True, eq=False)
class ForceEstimate:
    """Exciting force of one record with its 95 % band, each (n, nt), at times (nt,) [s]."""

    time: FloatArray
    mean: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True, eq=False)
class Findings:
    """What a method found."""

    u: FloatArray  # (S, d_u): Equally weighted draws of the standardised radiation parameters
    baseline: Mapping[str, Any]  # Of the prior model
    warnings: tuple[str, ...] = ()
    sea: Mapping[str, Any] = field(default_factory=dict)
    force: Mapping[str, ForceEstimate] = field(default_factory=dict)
    # Probability that the memory is passive, before that was made a condition of the draws
    passive: float | None = None
    centre: FloatArray | None = None  # (d_u,): The estimate, where it is not the mean of the draws
    bands: tuple[tuple[float, float], ...] = ()  # Lowest and highest frequency [rad/s] at which each record has power
    # Laws of linear damping beside the model's and the waves': draws (S,) and the prior's deviation [SI]
    damping: Mapping[str, tuple[FloatArray, float]] = field(default_factory=dict)
    evidence: float = 0.0  # Log evidence of the records under the study's prior, up to what all priors share

    def with_power(self, omega: FloatArray) -> np.ndarray:
        """Return at which of the frequencies some record has power, to half a step of omega, shape (nw,)."""
        if not self.bands:
            return np.ones(omega.size, dtype=bool)
        edges = np.r_[omega[0], 0.5 * (omega[1:] + omega[:-1]), omega[-1]]
        return np.any([(edges[1:] >= low) & (edges[:-1] <= high) for low, high in self.bands], axis=0)


def most_probable(studies: Sequence[Study], found: Sequence[Findings]) -> tuple[Study, Findings]:
    """Return the study whose prior the records make most probable, with the draws of all by their evidence.

    The studies differ in their prior alone, and are as probable as each other before the records.
    """
    if len(found) == 1:
        return studies[0], found[0]
    logs = np.array([item.evidence for item in found])
    weights = np.exp(logs - np.logaddexp.reduce(logs))
    study, chosen = studies[int(np.argmax(logs))], found[int(np.argmax(logs))]
    draws = np.arange(chosen.u.shape[0])
    of = np.random.default_rng(study.seed).choice(weights.size, draws.size, p=weights)
    u = np.array([study.form.carried(item.u, other.form) for other, item in zip(studies, found)])[of, draws]
    centre = weights @ [study.form.carried(item.centre, other.form) for other, item in zip(studies, found)
                        if item.centre is not None]
    none = np.zeros(draws.size), 0.0
    damping = {name: (np.array([item.damping.get(name, none)[0] for item in found])[of, draws], size)
               for name, (_, size) in chosen.damping.items()}
    return study, replace(chosen, u=u, centre=centre, damping=damping)


def cautious(study: Study, u: FloatArray, bands: Sequence[tuple[float, float]], close: float = 0.1) -> FloatArray:
    """Return an estimate of the body, (n_u,), between the prior's mean and that of draws u (S, n_u).

    The place with the least expected ratio of its error to the model's, in K where the motion has power: the draws'
    mean makes bodies worse that the model happens to hit. One nearer than a share `close` of the usual distance counts
    as that far.
    """
    form, omega = study.form, np.linspace(min(low for low, _ in bands), max(high for _, high in bands), 20)
    mean, bodies = u.mean(axis=0), form.K(form.theta(u), omega)
    tried = np.linspace(0.0, 1.0, 21)[:, None] * mean
    K = form.K(form.theta(tried), omega)
    # Entries of different units count alike.
    size = np.maximum(np.abs(K[0]).max(axis=0), 1e-300)
    away = np.array([np.linalg.norm(((row - bodies) / size).reshape(u.shape[0], -1), axis=1) for row in K])
    before = np.maximum(away[0], close * np.sqrt(np.mean(away[0] ** 2)))
    return np.asarray(tried[np.argmin(np.mean(away / before, axis=1))])


def information_shares(study: Study, u: FloatArray, K: ComplexArray, omega: FloatArray) -> dict[str, FloatArray]:
    """Return the shares of prior, points and data in the precision of K at each frequency, each (nw,), sum 1.

    1/V0, 1/V1 - 1/V0 and 1/V2 - 1/V1, with V the variance of K under the prior, with points, and with everything;
    entries are pooled.
    """
    rng = np.random.default_rng(1)
    V0 = np.var(study.draws_of_K(np.eye(study.n_u), np.zeros(study.n_u), omega, rng), axis=0)
    V2 = np.var(K, axis=0)
    prior = _pooled(V2, V0)
    if study.points is None:
        return {"prior": prior, "points": np.zeros_like(prior), "data": 1.0 - prior}
    if not study.records:
        return {"prior": prior, "points": 1.0 - prior, "data": np.zeros_like(prior)}
    centre = u.mean(axis=0)
    jacobian = study.points.jacobian(centre)
    covariance = np.asarray(np.linalg.inv(np.eye(study.n_u) + jacobian.T @ jacobian), dtype=np.float64)
    V1 = np.var(study.draws_of_K(covariance, centre, omega, rng), axis=0)
    before_data = np.maximum(_pooled(V2, V1), prior)
    return {"prior": prior, "points": before_data - prior, "data": 1.0 - before_data}


def _pooled(small: FloatArray, large: FloatArray) -> FloatArray:
    """Return the ratio of variances (nw, n, n), averaged over entries with any, between 0 and 1."""
    used = large > 0.0
    ratio = np.divide(small, large, out=np.ones_like(large), where=used)
    return np.asarray(np.clip(np.mean(ratio, axis=(1, 2), where=used), 0.0, 1.0), dtype=np.float64)
