"""Settings of the dual filter, their checks, and the defaults that follow from the model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import ComplexArray, FloatArray, check_numbers, generator, is_number
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.inference.points import Points, point_values
from radiation_ss.inference.scales import channel_names

CHOICES = {"preset": (None, "paper"), "learn": ("known-force", "always", "never"), "draws": ("gaussian", "three-point"),
           "analysis": ("stochastic", "square-root"), "order": ("force-first", "motion-first"),
           "force_model": ("coloured", "persistence")}
NUMBERS: tuple[tuple[str, Callable[[Any], bool], str], ...] = (
    ("inflation R gate larger point_noise", lambda value: value > 0.0, "a number above 0 is needed"),
    ("Q_theta Q_state Q_force", lambda value: 0.0 <= value < np.inf, "a number, zero or more, is needed: a variance"),
    ("n_ensemble", lambda value: is_number(value, whole=True) and value >= 4,
     "a whole number, at least 4 members for a covariance, is needed"),
    ("pace", lambda value: value >= 1, "a number, at least 1, is needed"))


@dataclass(frozen=True, eq=False)
class FilterSettings:
    """Settings of `DualEnKF`.

    Raises
    ------
    InputError
        On settings that are not usable.
    """

    seed: int = 0  # Of all randomness
    # {None, "paper"}: None: noise levels scaled to the record, noise carried by a covariance given the parameters.
    # "paper": as printed, with motion in units of its standard deviation.
    preset: str | None = None
    # mapping {omega: K} or sequence of omega, optional: Frequencies [rad/s] at which K is known (25)-(27); from the
    # model's data where only frequencies are given
    points: Points | None = None
    point_noise: float = 1e-3  # Relative error of the known K
    # (n_theta,): Relative standard deviation of the parameters; 0 keeps one fixed. Lognormal with the model's values as
    # median (the paper's: normal).
    prior: ArrayLike = 0.15
    n_ensemble: int = 100  # Number of members
    # Sensor noise by channel (`Heave_acceleration`: m/s^2, ...), standard deviation; from the record if absent
    noise: Mapping[str, float] | None = None
    # {"coloured", "persistence"} or ForceModel: How the unknown force moves (default filter only; the paper's is
    # persistence (19))
    force_model: "str | ForceModel" = "coloured"
    # {"known-force", "always", "never"}: When motion may move the parameters. Under an unknown force it tells nothing
    # about them, and a filter that thinks otherwise takes its force model for knowledge; "always" lets it.
    learn: str = "known-force"
    entries: Sequence[tuple[str, str]] | None = None  # Entries of the radiation matrix to estimate; all by default
    gate: float = 6.0  # Samples farther off than this many standard deviations are refused as spikes (default filter)
    larger: float = 5.0  # The sea may be so many times that of `prepare` before live samples contradict it
    # Pieces of work, of some .3 ms each, that an iterated update may take from one live sample (default filter)
    pace: int = 4
    omega: ArrayLike | None = None  # Frequencies [rad/s] of the answer
    # {"stochastic", "square-root"}: Of the paper's ensembles: perturbed observations (34) or none
    analysis: str = "stochastic"
    # {"gaussian", "three-point"}: Noise of the paper's ensembles: Gaussian, or three points that match five of its
    # moments
    draws: str = "gaussian"
    inflation: float = 1.0  # Factor on the spread of the paper's state and parameters after each analysis; 1 is none
    # {"force-first", "motion-first"}: Which of the paper's analyses comes first at a sample; section 3.2 has the
    # force's first
    order: str = "force-first"
    # Q_theta, Q_state, Q_force, R: Variances of the paper's noise on parameters, state and force at each step, and of
    # its observations, in non-dimensional units. Section 5.1 has one number for all.
    Q_theta: float = 8.0739e-5
    Q_state: float = 8.0739e-5
    Q_force: float = 8.0739e-5
    R: float = 8.0739e-5
    # Mass [kg] and time [s] units of the paper's preset: rho b^2 times the length, and sqrt(b/g), for a section of
    # half-breadth b (A.4)-(A.6). By default those that give the first degree of freedom's M + A_inf, and the stiffest
    # one's frequency, the size they have in the paper.
    units: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name, allowed in CHOICES.items():
            if getattr(self, name) not in allowed and not isinstance(getattr(self, name), ForceModel):
                raise InputError(f"{name}: {getattr(self, name)!r} is unknown; use one of "
                                 + ", ".join(map(repr, allowed)))
        generator(self.seed)
        check_numbers(self, NUMBERS)
        if np.any(np.asarray(self.prior, dtype=float) < 0.0):
            raise InputError("prior: a relative standard deviation cannot be negative")

    def check_noise(self, dofs: Sequence[str]) -> None:
        """Refuse noise that is none, or of a channel that there is not: the record's would be taken instead."""
        channels = channel_names(dofs)
        for name, level in (self.noise or {}).items():
            plain = level.item() if isinstance(level, np.ndarray) and level.ndim == 0 else level
            if not isinstance(plain, int | float | np.integer | np.floating) or not 0.0 < plain < np.inf:
                raise InputError(f"noise of {name}: {level!r}; one standard deviation above 0 is needed")
            if name not in channels:
                raise InputError(f"noise: channel {name!r} is unknown; use any of {', '.join(channels)}")

    def prior_std(self, theta: FloatArray, names: Sequence[str]) -> FloatArray:
        """Return the standard deviations of the parameters, shape (n_theta,)."""
        try:
            return np.asarray(np.broadcast_to(np.asarray(self.prior, dtype=float), theta.shape) * np.abs(theta))
        except ValueError:
            raise InputError(f"prior: shape {np.shape(self.prior)} found; one number, or one for each of "
                             f"{', '.join(names)}") from None

    def known_points(self, model: Model) -> tuple[FloatArray, ComplexArray]:
        """Return (omega, K) of the known points, empty where there are none."""
        if self.points is None or len(self.points) == 0:
            return np.zeros(0), np.zeros((0, model.n, model.n), dtype=complex)
        return point_values(model, self.points)

    def frequencies(self, model: Model) -> FloatArray:
        """Return those of the answer: given, of the model's data, or 60 from a fifth to five times its natural ones."""
        if self.omega is not None:
            return np.array(self.omega, dtype=float)
        if model.hydro is not None:
            return model.hydro.omega
        natural = natural_frequencies(model)
        return np.geomspace(0.2 * natural.min(), 5.0 * natural.max(), 60)

    def mass_and_time(self, model: Model, inertia: float = 3.74, stiffness: float = 2.0) -> tuple[float, float]:
        """Return the paper's units: given, or those in which the body has its (m + a(inf))' and c' by (A.4)-(A.6)."""
        if self.units is not None:
            return self.units
        time = np.sqrt(stiffness / inertia) / natural_frequencies(model).max()
        return float(model.M[0, 0] + model.A_inf[0, 0]) / inertia, float(time)


PAPER = ("analysis", "draws", "inflation", "order", "Q_theta", "Q_state", "Q_force", "R")


def settings_of(options: Mapping[str, object]) -> FilterSettings:
    """Return the settings with some of them changed, and name an option that there is not."""
    unknown = [name for name in options if name not in FilterSettings.__dataclass_fields__]
    if unknown:
        raise InputError(f"DualEnKF: option {unknown[0]!r} is unknown; there are "
                         + ", ".join(FilterSettings.__dataclass_fields__))
    settings = FilterSettings(**options)  # type: ignore[arg-type]
    default = FilterSettings()
    idle = [name for name in PAPER if getattr(settings, name) != getattr(default, name)]
    if settings.preset is None and idle:
        raise InputError(f"{idle[0]}: an option of the paper's filter; use preset='paper' with it")
    return settings


def natural_frequencies(model: Model, least: float = 1e-6) -> FloatArray:
    """Return the undamped natural frequencies [rad/s] of the motions that something restores, ascending.

    A frequency below `least` of the highest one is rounding. Where nothing is restored, it is that of the radiation's
    fastest state; 1 without such.
    """
    squares = np.abs(np.linalg.eigvals(np.linalg.solve(model.M + model.A_inf, model.C)))
    found = np.sqrt(np.sort(squares[squares > least**2 * squares.max()]))
    if found.size:
        return found
    fastest = float(np.abs(np.linalg.eigvals(model.fit.a)).max(initial=0.0))
    return np.array([fastest or 1.0])


@dataclass(frozen=True, eq=False)
class ForceModel:
    """Force of each degree of freedom as the first of two states, s' = A s + white noise."""

    A: FloatArray
    q: FloatArray
    start: FloatArray
    name: str


def force_model_of(given: str | ForceModel, std: ArrayLike, omega: ArrayLike, bandwidth: ArrayLike) -> ForceModel:
    """Return the force model that was asked for, by its name scaled to a force, for each degree of freedom.

    std [N, N m], mean frequency omega [rad/s]. "coloured": stationary and narrow-band, f'' + 2 bandwidth omega f' +
    omega^2 f = white noise; in a gap its spread opens to `std` and no further. "persistence": the random walk of (19),
    which moves over a twentieth of a period as far as a smooth force.
    """
    if isinstance(given, ForceModel):
        return given
    sigma, w, zeta = (np.atleast_1d(np.asarray(value, dtype=float)) for value in (std, omega, bandwidth))
    for name, value in (("std", sigma), ("omega", w), ("bandwidth", zeta)):
        if not np.all(value > 0.0) and (name != "bandwidth" or given == "coloured"):
            raise InputError(f"force model: {name} must be positive, found {value}")
    A, zero = np.zeros((sigma.size, 2, 2)), np.zeros_like(w)
    if given == "persistence":
        q = np.stack([(w * sigma) ** 2 * (2.0 * np.pi / w / 20.0), zero], axis=1)
        return ForceModel(A, q, np.stack([sigma**2, zero], axis=1), given)
    A[:, 0, 1], A[:, 1, 0], A[:, 1, 1] = 1.0, -w**2, -2.0 * zeta * w
    q = np.stack([zero, 4.0 * zeta * w**3 * sigma**2], axis=1)
    return ForceModel(A, q, np.stack([sigma**2, (w * sigma) ** 2], axis=1), given)
