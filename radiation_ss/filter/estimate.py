"""What a run of the filter returns: parameters, coefficients, force, and how far they can be believed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import force_unit
from radiation_ss.inference.scales import channel_names
from radiation_ss.inference.subsystems import Subsystems
from radiation_ss.methods import Shown
from radiation_ss.records.columns import channel_unit
from radiation_ss.records.record import Record

if TYPE_CHECKING:
    import control as ct

LEVEL, Z95 = 0.95, 1.959964


class StepResult(NamedTuple):
    """What `DualEnKF.step` returns for one sample."""

    time: float
    force: FloatArray       # (n,) [N, N m]
    force_std: FloatArray   # (n,)
    theta: FloatArray       # (n_theta,)
    theta_std: FloatArray   # (n_theta,)
    nis: float              # sum of squared normalised innovations
    used: int               # channels used


def by_parts(function: Callable[..., np.ndarray], *values: np.ndarray) -> np.ndarray:
    """Return a function of arrays, of complex ones that of their real and of their imaginary parts."""
    if not np.iscomplexobj(values[0]):
        return function(*values)
    return function(*map(np.real, values)) + 1j * function(*map(np.imag, values))


class Band(NamedTuple):
    """An estimate with the limits of its central 95 % band (of complex values: of each part)."""

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @classmethod
    def normal(cls, mean: FloatArray, std: FloatArray) -> Band:
        """Return the band of a normal estimate."""
        return cls(mean, mean - Z95 * std, mean + Z95 * std)

    @classmethod
    def of(cls, draws: np.ndarray) -> Band:
        """Return the band of equally weighted draws along the first axis."""
        tail = [50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)]
        return cls(draws.mean(axis=0), *by_parts(lambda part: np.percentile(part, tail, axis=0), draws))

    def about(self, estimate: np.ndarray) -> Band:
        """Return the band with another estimate in place of the mean, widened to hold it."""
        return Band(estimate, by_parts(np.minimum, self.lower, estimate), by_parts(np.maximum, self.upper, estimate))


class ParameterEstimate(NamedTuple):
    """One parameter: how far it moved from its prior, and how far the record (and the points) could move it."""

    mean: float
    std: float
    prior_mean: float
    prior_std: float
    moved: float       # |mean - prior mean|
    could_move: float  # sqrt(prior variance - variance): expected size of the move
    lower: float       # of the 95 % band, symmetric in the logarithm as the prior is
    upper: float


@dataclass(frozen=True, eq=False, repr=False)
class Tabled(Shown):
    """What every run of the filter gives, printed as its force, its parameters and its warnings."""

    dofs: tuple[str, ...]
    time: FloatArray  # (nt,) [s]
    force: Band  # (n, nt): Wave excitation force [N, N m]
    parameters: dict[str, ParameterEstimate]
    members: FloatArray  # (n_theta, n_ensemble): The ensemble at the end
    nis: FloatArray  # (nt,): Sum of squared normalised innovations
    used: np.ndarray  # (nt,): Channels used
    counts: dict[str, int]  # Refused samples, repaired members, ...
    warnings: tuple[str, ...]

    @abstractmethod
    def plant_at(self, theta: FloatArray) -> Model:
        """Return the plant at some parameters (n_theta,)."""

    def plants(self, n: int) -> list[ct.StateSpace]:
        """Return n plants of the ensemble as ct.StateSpace with the signals of `cummins`, for robust LQR or MPC.

        InputError if the ensemble has not that many members.
        """
        return plants_of(self.members, n, self.plant_at)

    def __str__(self) -> str:
        mean, half = self.force.mean, 0.5 * (self.force.upper - self.force.lower)
        lines = [f"dual filter: {', '.join(self.dofs)}; {self.time.size} samples from {self.time[0]:g} to "
                 f"{self.time[-1]:g} s, {self.members.shape[1]} members"]
        lines += [f"  {dof}_force: rms {np.sqrt(np.mean(f**2)):.3g} {force_unit(dof)}, 95 % band +- {h.mean():.2g} on "
                  "average" for dof, f, h in zip(self.dofs, mean, half)]
        lines += [f"  {name} {p.mean:.5g} +- {p.std:.2g} (prior {p.prior_mean:.5g} +- {p.prior_std:.2g})"
                  for name, p in self.parameters.items()]
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Tabled):
    """Result of a run."""

    model: Model  # The filter's start
    names: tuple[str, ...]  # Of the parameters
    # theta, theta_std: Path of the parameters' mean and standard deviation, (n_theta, nt)
    theta: FloatArray
    theta_std: FloatArray
    subsystems: Subsystems
    omega: FloatArray  # (nw,) [rad/s]
    K: ComplexArray  # (nw, n, n): At the parameters' mean
    A: Band  # (nw, n, n): Added mass
    B: Band  # (nw, n, n): Damping
    baseline: dict[str, np.ndarray]  # The prior model: theta (n_theta,), K (nw, n, n), force (n, nt)

    def plant_at(self, theta: FloatArray) -> Model:
        """Return the plant at some parameters (n_theta,)."""
        return self.model.replace(fit=self.subsystems.fit(theta, self.model.A_inf))


def plants_of(members: FloatArray, n: int, build: Callable[[FloatArray], Model],
              what: str = "the members of the ensemble") -> list[ct.StateSpace]:
    """Return the plants of n members (columns) as ct.StateSpace; `what` they are, for the message."""
    count = members.shape[1]
    if not isinstance(n, int | np.integer) or not 1 <= n <= count:
        raise InputError(f"plants: {n} asked for; from 1 to {count}, {what}")
    return [build(theta).to_ss() for theta in members[:, np.linspace(0, count - 1, n).astype(int)].T]


def coefficients(parts: Subsystems, A_inf: FloatArray, theta: FloatArray, drawn: FloatArray,
                 omega: FloatArray) -> tuple[ComplexArray, Band, Band]:
    """Return K at some parameters, and A and B there with the bands of those that are drawn, (draws, n_theta)."""
    K, spread, w = parts.K(theta, omega), parts.K(drawn, omega), omega[:, None, None]
    return K, Band.of(A_inf + spread.imag / w).about(A_inf + K.imag / w), Band.of(spread.real).about(K.real)


def parameter_table(names: tuple[str, ...], mean: FloatArray, drawn: FloatArray, prior: FloatArray,
                    prior_std: FloatArray) -> dict[str, ParameterEstimate]:
    """Return the table of parameters; drawn (n_theta, members) are draws about the mean."""
    std = drawn.std(axis=1, ddof=1)
    could = np.sqrt(np.maximum(prior_std**2 - std**2, 0.0))
    rows = zip(names, mean, std, prior, prior_std, np.abs(mean - prior), could, *_band(mean, drawn))
    return {name: ParameterEstimate(*(float(v) for v in row)) for name, *row in rows}


def _band(mean: FloatArray, drawn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the limits of the parameters' 95 % band: of the logarithm where all have one sign, else of the value."""
    one_sign = np.all(drawn * mean[:, None] > 0.0, axis=1)
    ratio = np.divide(drawn, mean[:, None], out=np.ones_like(drawn), where=one_sign[:, None])
    reach = np.exp(Z95 * np.log(ratio).std(axis=1, ddof=1))
    plain = Z95 * drawn.std(axis=1, ddof=1)
    edges = np.where(one_sign, [mean / reach, mean * reach], [mean - plain, mean + plain])
    return edges.min(axis=0), edges.max(axis=0)


def contradiction(far: FloatArray, dofs: tuple[str, ...], larger: float, most: float = 0.5) -> Iterator[str]:
    """Yield which channels contradict the prediction; far (4 n,): share of their recent samples that are far off.

    A sample is far off beyond `larger` times the 95 % limit of its innovation: by the chi-square law one in twenty
    honest ones is, in a sea that many times as high as that of `prepare`; `most` of them are only if they are wrong.
    """
    if far.max() > most:
        names = [f"{name} [{channel_unit(name)}]" for name, share in zip(channel_names(dofs), far) if share > most]
        yield (f"live samples of {', '.join(names)}: most of the last periods are more than {larger:g} times as far "
               "from the prediction as noise and sea of the record given to prepare allow; check that units and signs "
               "are those of that record, and that the body is the same; in a sea so much higher call prepare again")


def information_share(nis: FloatArray, used: np.ndarray, unsure: float = 1.5) -> tuple[float, tuple[str, ...]]:
    """Return the share of a record's information that its misfit leaves to the parameters, and what to say of it.

    Squared normalised innovations that sum to s over n channels are (s - n) / 2 of log-likelihood off: the likelihood
    is raised to 1 / (1 + (s - n) / 2), a coarsened posterior (Miller and Dunson 2019, J. Am. Stat. Assoc. 114, 1113).
    `unsure`: factor that the noise's variance may be off by.
    """
    excess = max(0.0, float(nis.sum()) - unsure * int(used.sum()))
    if not excess:
        return 1.0, ()
    return 1.0 / (1.0 + 0.5 * excess), (
        f"the mean squared normalised innovation is {nis.sum() / used.sum():.3g}, where 1 is expected: the plant does "
        f"not explain the record; the parameters' bands are up to {(1.0 + 0.5 * excess) ** 0.5:.3g} times wider for "
        "it, and what the plant lacks may have gone into the parameters: run diagnose",)


def taken_as_exact(model: Model, A: Band, usual: float = 0.02) -> Iterator[str]:
    """Yield what the bands of parameters that a known force taught do not hold.

    A mass that is off by its tolerance (`usual` where the model states none) is a change of A by as much: told where
    that is more than the half band of A, the median over frequency.
    """
    inertia = np.diag(model.M + model.A_inf)
    half = np.median(0.5 * np.einsum("wii->wi", A.upper - A.lower), axis=0) / inertia
    if half.min() < model.tolerance.get("mass", usual):
        dof = model.dofs[int(half.argmin())]
        yield ("mass, A_inf, stiffness and the radiation's order are taken as exact, and the body as linear: the band "
               f"of A in {dof} is +-{100.0 * half.min():.2g} % of its inertia, so a mass that is off by more, or drag, "
               "puts A and B outside their bands; identify with method 'prediction-error' has these numbers free")


def warnings_of(table: dict[str, ParameterEstimate], counts: dict[str, int], record: Record, dofs: tuple[str, ...],
                points: bool, preset: str | None) -> Iterator[str]:
    """Yield what a reader of the estimate has to know."""
    if preset == "paper":
        yield ("preset 'paper': the printed noise levels make parameters worse than their start and the force band far "
               "too narrow (docs/validation/dual_filter.md)")
    elif (force := record.get("force", dofs)) is None or not np.isfinite(force).all(axis=0).any():
        yield ("the wave excitation force is unknown, so motion says nothing about the parameters: they come from the "
               + ("known points and the prior" if points else "prior alone"))
    share = [p.std / p.prior_std for p in table.values() if p.prior_std > 0.0]
    if share and max(share) < 1e-3:
        yield f"collapsed ensemble: the spread is below {max(share):.1e} of the prior's"
    channels = max(1, sum(int(np.isfinite(v).sum()) for v in record.channels.values()))
    if counts.get("refused", 0) > 0.02 * channels:
        yield f"{counts['refused']} of {channels} samples were refused as too far from the prediction"
    for key, what in (("repaired", "members were unstable and pulled to the mean until stable"),
                      ("made_passive", "times a member with negative damping was moved to the nearest passive one"),
                      ("not_stable", "members are unstable at the end"),
                      ("not_passive", "members have negative damping at some frequency of the answer")):
        if counts.get(key, 0):
            yield f"{counts[key]} {what}"
