"""Plants with named uncertain parameters, and the bank of linear plants that share one covariance, in NumPy."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import system_matrices
from radiation_ss.body.convert import ModelLike, as_model, in_cummins_coordinates
from radiation_ss.body.model import Model
from radiation_ss.body.time_step import Matrices
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.estimate import Band, Tabled
from radiation_ss.filter.settings import ForceModel
from radiation_ss.inference.kalman import Gaussian, predict, smooth


@dataclass(frozen=True, eq=False)
class UncertainPlant:
    """A plant as a function of named uncertain parameters.

    Parameters
    ----------
    build : callable
        Takes {name: value}, returns a Model or a ct.StateSpace with the signals of `cummins`, continuous or sampled.
    parameters : mapping of str to (float, float)
        Median and relative standard deviation of each, lognormal; a value keeps its sign and may not be 0.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=10.0, C=4000.0, period=0.4)
    >>> plant = UncertainPlant(lambda p: model.replace(C=[[p["stiffness"]]]), {"stiffness": (4000.0, 0.05)})
    >>> plant.model([4100.0]).C
    array([[4100.]])
    """

    build: Callable[[dict[str, float]], ModelLike]
    parameters: Mapping[str, tuple[float, float]]

    def __post_init__(self) -> None:
        if not isinstance(self.parameters, Mapping) or not self.parameters:
            raise InputError("parameters: none; name at least one, {name: (median, relative standard deviation)}, or "
                             "give the plant itself")
        for name, given in self.parameters.items():
            pair = np.asarray(given)
            if pair.shape != (2,) or pair.dtype.kind not in "if" or not (
                    np.isfinite(pair).all() and pair[0] != 0.0 and pair[1] > 0.0):
                raise InputError(f"parameters: {name} is {given}; a median that is not 0 and a positive relative "
                                 "standard deviation are needed")

    @property
    def start(self) -> FloatArray:
        """Medians, shape (d,)."""
        return np.array([value for value, _ in self.parameters.values()])

    @property
    def relative(self) -> FloatArray:
        """Relative standard deviations, shape (d,)."""
        return np.array([value for _, value in self.parameters.values()])

    def theta(self, u: FloatArray) -> FloatArray:
        """Return parameters of standardised ones, shapes (..., d)."""
        return np.asarray(self.start * np.exp(np.sqrt(np.log1p(self.relative**2)) * u))

    def model(self, theta: FloatArray) -> Model:
        """Return the plant at some parameters (d,)."""
        return as_model(self._at(theta))

    def own(self, theta: FloatArray) -> tuple[Matrices, FloatArray]:
        """Return the plant at some parameters as (F, G, H, J) in its own states, and these of a Model's states."""
        plant = self._at(theta)
        if hasattr(plant, "input_labels"):
            return in_cummins_coordinates(plant)[1:]
        model = as_model(plant)
        return system_matrices(model), np.eye(model.fit.states + 2 * model.n)

    def nominal(self) -> Model:
        """Return the plant at the medians; the parameters' deviations make its tolerances of mass and stiffness."""
        model, moved = self.model(self.start), self.theta(np.eye(self.start.size))
        squares = dict.fromkeys(("mass", "stiffness"), 0.0)
        for other in map(self.model, moved):
            for name, now, then in (("mass", model.M + model.A_inf, other.M + other.A_inf),
                                    ("stiffness", model.C, other.C)):
                size = np.diag(now)
                squares[name] += float(np.abs(np.diag(then) / np.where(size, size, np.inf) - (size != 0.0)).max()) ** 2
        return model.replace(tolerance={name: min(square**0.5, 0.9) for name, square in squares.items()
                                        if square > 1e-12})

    def _at(self, theta: FloatArray) -> ModelLike:
        try:
            return self.build(dict(zip(self.parameters, (float(v) for v in theta))))
        except KeyError as error:
            raise InputError(f"build: it asks for a parameter {error}; there are "
                             f"{', '.join(self.parameters)}") from None


@dataclass(frozen=True, eq=False, repr=False)
class PlantEstimate(Tabled):
    """What `DualEnKF.run` returns for an `UncertainPlant`."""

    plant: UncertainPlant

    def plant_at(self, theta: FloatArray) -> Model:
        """Return the plant at some parameters (d,)."""
        return self.plant.model(theta)


@dataclass(frozen=True, eq=False)
class Bank:
    """Linear plants with their force model, z' = A z + noise, y = H z; the last one, the control, gives its gains."""

    A: FloatArray
    H: FloatArray
    q: FloatArray
    r: FloatArray
    P: FloatArray

    def steps(self, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return exact transitions (columns, size, size) and the control's noise covariance (Van Loan 1978)."""
        size = self.P.shape[0]
        F, Q = np.array([expm(dt * A) for A in self.A]), np.zeros((size, size))
        Q[-self.q.size:, -self.q.size:] = np.diag(self.q)
        both = expm(dt * np.block([[-self.A[-1], Q], [np.zeros_like(Q), self.A[-1].T]]))
        Q = F[-1] @ both[:size, size:]
        return F, 0.5 * (Q + Q.T)


class BankRun(NamedTuple):
    """What a bank gives, time first."""

    force: FloatArray        # (nt, n)
    force_std: FloatArray    # (nt, n)
    nis: FloatArray          # (nt,)
    taken: np.ndarray        # (nt, 4 n): whether a sample was used
    information: FloatArray  # (d, d)
    gradient: FloatArray     # (d,)
    path: list[tuple[Gaussian, Gaussian, FloatArray]]  # before and after each sample, and the transition to it
    cost: float              # twice the negative log likelihood of the samples that were learned from

    @property
    def used(self) -> np.ndarray:
        """Number of channels used at each time, (nt,)."""
        return np.asarray(self.taken.sum(axis=1))


def bank_of(systems: Sequence[Matrices], force: ForceModel, noise: FloatArray, P: FloatArray) -> Bank:
    """Return the bank of plants (F, G, H, J) with motion as outputs; noise (4, n): the sensors', NaN for none."""
    base, n = systems[0][1].shape
    if len({F.shape for F, *_ in systems}) > 1:
        raise SolverError("plant: its number of states changes with the parameters")
    A, H = np.zeros((len(systems), base + 2 * n, base + 2 * n)), np.zeros((len(systems), 4 * n, base + 2 * n))
    for k, (F, G, out, direct) in enumerate(systems):
        A[k, :base, :base], A[k, :base, base::2] = F, G
        H[k, :3 * n, :base], H[k, :3 * n, base::2] = out, direct
    for i in range(n):
        at = base + 2 * i
        A[:, at:at + 2, at:at + 2] = force.A[i]
        H[:, 3 * n + i, at] = 1.0
    return Bank(A, H, force.q.ravel(), np.where(np.isfinite(noise), noise, 1.0).ravel() ** 2, P)


def run_bank(bank: Bank, time: FloatArray, samples: FloatArray, *, gate: float = np.inf, tangents: float = 0.0,
             keep: bool = False) -> BankRun:
    """Filter samples (nt, 4 n) with a bank; a sample beyond `gate` standard deviations is refused.

    With `tangents`, the distance of the other plants from the control along one parameter each, information and
    gradient are added up where the force is known. `keep` keeps the path, for `smoothed_force`.
    """
    columns, channels, size = bank.H.shape
    n, d, z, P, last = channels // 4, columns - 1, np.zeros((columns, size, 1)), bank.P, np.nan
    dts, path = np.diff(time, prepend=time[0]), []
    force, force_std, nis = np.zeros((len(dts), n)), np.zeros((len(dts), n)), np.zeros(len(dts))
    taken, information, gradient, cost = np.isfinite(samples), np.zeros((d, d)), np.zeros(d), 0.0
    F = np.eye(size)[None]
    for t, (y, dt) in enumerate(zip(samples, dts)):
        if dt > 0.0:
            if not abs(dt - last) <= 1e-3 * dt:
                (F, Q), last = bank.steps(dt), dt
            z, P = F @ z, predict(Gaussian(z[-1], P), F[-1], Q).cov
        before = Gaussian(z[..., 0].T, P)
        learning = tangents and np.isfinite(y[3 * n:]).all()
        for c in np.flatnonzero(np.isfinite(y)):
            innovation = y[c] - np.einsum("ki,kij->k", bank.H[:, c], z)
            gain = P @ bank.H[-1, c]
            s = bank.H[-1, c] @ gain + bank.r[c]
            spread = innovation[:-1].var() if d > 1 and not tangents else 0.0
            if abs(innovation[-1]) > gate * np.sqrt(s + spread):
                taken[t, c] = False
                continue
            if learning:
                slope = (innovation[-1] - innovation[:-1]) / tangents
                information += np.outer(slope, slope) / s
                gradient += slope * innovation[-1] / s
                cost += innovation[-1] ** 2 / s + np.log(s)
            z = z + (innovation[:, None] * (gain / s))[..., None]
            P = P - np.outer(gain, gain) / s
            nis[t] += innovation[-1] ** 2 / (s + spread)
        after = Gaussian(z[..., 0].T, P)
        force[t], force_std[t] = _force(after, n)
        if keep:
            path.append((before, after, F[-1]))
    return BankRun(force, force_std, nis, taken, information, gradient, path, float(cost))


def smoothed_force(run: BankRun) -> Band:
    """Return the force (n, nt) by all of a record (Rauch, Tung and Striebel 1965); all plants share the gains."""
    here, n = run.path[-1][1], run.force.shape[1]
    found = [_force(here, n)]
    for (ahead, _, F), (_, filtered, _) in zip(run.path[:0:-1], run.path[-2::-1]):
        here = smooth(filtered, ahead, here, F)
        found.append(_force(here, n))
    mean, std = (np.array(part[::-1]).T for part in zip(*found))
    return Band.normal(mean, std)


def _force(state: Gaussian, n: int) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of the force: spread of the plants and covariance given the parameters."""
    rows = slice(-2 * n, None, 2)
    spread = state.mean[rows, :-1].var(axis=1, ddof=1) if state.mean.shape[1] > 2 else 0.0
    return state.mean[rows, -1], np.sqrt(spread + np.maximum(np.diag(state.cov)[rows], 0.0))
