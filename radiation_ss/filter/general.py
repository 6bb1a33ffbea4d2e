"""Plants with named uncertain parameters: anything that a function of them can build, filtered by a bank of members.

Each member is the linear plant at its own parameters; all share one covariance, as in `marginal`. Where the force is
known, the parameters learn from the whole record by Gauss-Newton steps on the innovations of the bank's tangents, with
the lognormal prior, as `iterated_update` does it. In NumPy: some .2 ms a sample. Bands of the parameters are those of
the information; on simulated tanks 11 of 18 held the truth (docs/guide/filter.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import expm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import system_matrices
from radiation_ss.body.convert import ModelLike
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.ensemble import exact_draws
from radiation_ss.filter.estimate import Z95, Band, Parameter, parameter_table
from radiation_ss.filter.force_model import coloured
from radiation_ss.filter.plants import model_of
from radiation_ss.inference.kalman import Gaussian, predict
from radiation_ss.inference.scales import channels, scales_of
from radiation_ss.inference.subsystems import subsystems
from radiation_ss.records.convert import RecordLike, as_record

if TYPE_CHECKING:
    import control as ct


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
        for name, (value, relative) in self.parameters.items():
            if not (np.isfinite(value) and value != 0.0 and relative > 0.0):
                raise InputError(f"parameters: {name} is ({value:g}, {relative:g}); a median that is not 0 and a "
                                 "positive relative standard deviation are needed")
        if not self.parameters:
            raise InputError("parameters: none; name at least one, or give the filter the plant itself")

    @property
    def start(self) -> FloatArray:
        """Medians, shape (d,)."""
        return np.array([value for value, _ in self.parameters.values()])

    @property
    def spread(self) -> FloatArray:
        """Standard deviations of the logarithms, shape (d,)."""
        return np.sqrt(np.log1p(np.array([relative for _, relative in self.parameters.values()]) ** 2))

    def theta(self, u: FloatArray) -> FloatArray:
        """Return parameters of standardised ones, shapes (..., d)."""
        return np.asarray(self.start * np.exp(self.spread * u))

    def model(self, theta: FloatArray) -> Model:
        """Return the plant at some parameters (d,)."""
        return model_of(self.build(dict(zip(self.parameters, (float(v) for v in theta)))))


class Bank(NamedTuple):
    """Linear plants with their force model, one a column: z' = A z + noise, y = H z."""

    A: FloatArray  # (columns, size, size)
    H: FloatArray  # (columns, 4 n, size)


@dataclass(frozen=True, eq=False)
class PlantEstimate:
    """What `run_general` returns.

    Parameters
    ----------
    plant : UncertainPlant
    time : ndarray, shape (nt,)
    force : Band of ndarray, shape (n, nt)
        Wave excitation force [N, N m].
    parameters : dict of str to Parameter
    members : ndarray, shape (d, n_ensemble)
    nis, used : ndarray, shape (nt,)
        Sum of squared normalised innovations, and channels used.
    warnings : tuple of str
    """

    plant: UncertainPlant
    time: FloatArray
    force: Band
    parameters: dict[str, Parameter]
    members: FloatArray
    nis: FloatArray
    used: np.ndarray
    warnings: tuple[str, ...]

    def plants(self, n: int) -> list[ct.StateSpace]:
        """Return n plants of the ensemble as ct.StateSpace with the signals of `cummins`."""
        count = self.members.shape[1]
        if not 1 <= n <= count:
            raise InputError(f"plants: {n} asked for; from 1 to {count}, the members of the ensemble")
        chosen = self.members[:, np.linspace(0, count - 1, n).astype(int)]
        return [self.plant.model(theta).to_ss() for theta in chosen.T]


class GeneralFilter:
    """The filter of one record on an uncertain plant."""

    def __init__(self, plant: UncertainPlant, record: RecordLike, noise: Mapping[str, float] | None = None) -> None:
        self.plant, self.record = plant, as_record(record)
        nominal = plant.model(plant.start)
        scales = scales_of(self.record, nominal, subsystems(nominal.fit), noise)
        self.n, self.force = nominal.n, coloured(scales.force, scales.omega, scales.bandwidth)
        self.y = channels(self.record, nominal.dofs).T
        self.r = np.where(np.isfinite(scales.noise), scales.noise, 1.0).ravel() ** 2
        m = nominal.fit.states
        # Radiation states: as large as the motion leaves them in the nominal plant.
        motion = np.r_[3.0 * scales.motion, 3.0 * scales.motion * scales.omega]
        response = np.linalg.solve(1j * scales.omega.mean() * np.eye(m) - nominal.fit.a, nominal.fit.b)
        radiation = 2.0 * np.abs(response) @ (scales.motion * scales.omega)
        self.P = np.diag(np.r_[radiation, motion, np.sqrt(self.force.start.ravel())] ** 2)

    def bank(self, theta: FloatArray) -> Bank:
        """Return the plants at parameters (columns, d).

        Raises
        ------
        SolverError
            If two of them have different numbers of states.
        """
        found, n = [system_matrices(self.plant.model(row)) for row in theta], self.n
        if len({F.shape for F, *_ in found}) > 1:
            raise SolverError("plant: its number of states changes with the parameters")
        base = len(found[0][0])
        A, H = np.zeros((len(found), base + 2 * n, base + 2 * n)), np.zeros((len(found), 4 * n, base + 2 * n))
        for k, (F, G, out, direct) in enumerate(found):
            A[k, :base, :base], A[k, :base, base::2] = F, G
            H[k, :3 * n, :base], H[k, :3 * n, base::2] = out, direct
        for i in range(n):
            at = base + 2 * i
            A[:, at:at + 2, at:at + 2] = self.force.A[i]
            H[:, 3 * n + i, at] = 1.0
        return Bank(A, H)

    def steps(self, bank: Bank, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return exact transitions (columns, size, size) and the last column's noise covariance (Van Loan 1978)."""
        size = bank.A.shape[1]
        F = np.array([expm(dt * A) for A in bank.A])
        Q = np.zeros((size, size))
        Q[-2 * self.n:, -2 * self.n:] = np.diag(self.force.q.ravel())
        both = expm(dt * np.block([[-bank.A[-1], Q], [np.zeros_like(Q), bank.A[-1].T]]))
        Q = F[-1] @ both[:size, size:]
        return F, 0.5 * (Q + Q.T)

    def run(self, bank: Bank, gate: float = np.inf, tangents: float = 0.0) -> Run:
        """Filter the record with a bank; its last column is the control, whose gains all share.

        Parameters
        ----------
        gate : float
            Standard deviations beyond which a sample is refused.
        tangents : float
            Distance of the other columns from the control along one parameter each; then information and gradient are
            added up where the force is known.
        """
        columns, _, size = bank.H.shape
        z, P, last = np.zeros((columns, size, 1)), self.P, np.nan
        dts, d = np.diff(self.record.time, prepend=self.record.time[0]), columns - 1
        result = Run(np.zeros((len(dts), self.n)), np.zeros((len(dts), self.n)), np.zeros(len(dts)),
                     np.zeros(len(dts), dtype=np.int64), np.zeros((d, d)), np.zeros(d))
        for t, (y, dt) in enumerate(zip(self.y, dts)):
            if dt > 0.0:
                if not abs(dt - last) <= 1e-3 * dt:
                    (F, Q), last = self.steps(bank, dt), dt
                z, P = F @ z, predict(Gaussian(z[-1], P), F[-1], Q).cov
            learning = np.isfinite(y[3 * self.n:]).all()
            for c in np.flatnonzero(np.isfinite(y)):
                h = bank.H[:, c]
                innovation = y[c] - np.einsum("ki,kij->k", h, z)
                gain = P @ h[-1]
                s = h[-1] @ gain + self.r[c]
                spread = innovation[:-1].var() if d > 1 and not tangents else 0.0
                if abs(innovation[-1]) > gate * np.sqrt(s + spread):
                    continue
                if tangents and learning:
                    slope = (innovation[-1] - innovation[:-1]) / tangents
                    result.information[:] += np.outer(slope, slope) / s
                    result.gradient[:] += slope * innovation[-1] / s
                z = z + (innovation[:, None] * (gain / s))[..., None]
                P = P - np.outer(gain, gain) / s
                result.nis[t] += innovation[-1] ** 2 / (s + spread)
                result.used[t] += 1
            force = z[:, -2 * self.n::2, 0]
            result.force[t] = force[-1]
            result.force_std[t] = np.sqrt(force[:-1].var(axis=0) + np.diag(P)[-2 * self.n::2])
        return result


class Run(NamedTuple):
    """What a bank gives, time first."""

    force: FloatArray
    force_std: FloatArray
    nis: FloatArray
    used: np.ndarray
    information: FloatArray  # (d, d)
    gradient: FloatArray     # (d,)


def run_general(plant: UncertainPlant, record: RecordLike, *, seed: int = 0, n_ensemble: int = 100, gate: float = 6.0,
                noise: Mapping[str, float] | None = None, passes: int = 10, near: float = 1e-4) -> PlantEstimate:
    """Filter a record on a plant with named uncertain parameters.

    Parameters
    ----------
    passes : int
        Most Gauss-Newton steps over the record.
    near : float
        Distance of the tangents' plants, in prior standard deviations.

    Raises
    ------
    SolverError
        If the steps do not settle.
    """
    filter_, d = GeneralFilter(plant, record, noise), plant.start.size
    u, information = np.zeros(d), np.zeros((d, d))
    known = bool(np.isfinite(filter_.y[:, 3 * filter_.n:]).all(axis=1).any())
    for _ in range(passes if known else 0):
        bank = filter_.bank(plant.theta(np.vstack([u + near * np.eye(d), u])))
        found = filter_.run(bank, tangents=near)
        information = found.information
        move = np.linalg.solve(np.eye(d) + information, found.gradient - u)
        u = u + move
        if move @ (np.eye(d) + information) @ move < 0.01:
            break
    else:
        if known:
            raise SolverError(f"the parameters {', '.join(plant.parameters)} do not settle in {passes} passes; give "
                              "better medians or smaller deviations")
    root = np.linalg.cholesky(np.linalg.inv(np.eye(d) + information))
    members = plant.theta(u + exact_draws(np.random.default_rng(seed), d, n_ensemble).T @ root.T)
    out = filter_.run(filter_.bank(np.vstack([members, plant.theta(u)])), gate)
    relative = np.array([value for _, value in plant.parameters.values()])
    table = parameter_table(tuple(plant.parameters), plant.theta(u), members.T, plant.start,
                            relative * np.abs(plant.start))
    reach = Z95 * out.force_std.T
    said = () if known else ("the excitation force is unknown, so motion says nothing about the parameters: they come "
                             "from the prior alone",)
    return PlantEstimate(plant, filter_.record.time, Band(out.force.T, out.force.T - reach, out.force.T + reach), table,
                         members.T, out.nis, out.used, said)
