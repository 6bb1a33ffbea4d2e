"""Plants with named uncertain parameters: anything that a function of them can build, filtered by a bank of members.

Where the force is known, the parameters learn from the whole record by Gauss-Newton steps on the innovations of the
bank's tangents, with the lognormal prior. In NumPy: some .2 ms a sample.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import logm

from radiation_ss.arrays import FloatArray
from radiation_ss.body.convert import ModelLike, as_model
from radiation_ss.body.discretisation import hold_matrices
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError, SolverError
from radiation_ss.filter.bank import bank_of, run_bank, smoothed_force
from radiation_ss.filter.estimate import Band, ParameterEstimate, band_of, parameter_table, plants_of
from radiation_ss.filter.members import exact_draws
from radiation_ss.filter.plan import start_covariance
from radiation_ss.filter.settings import FilterSettings, coloured
from radiation_ss.inference.scales import channels, scales_of
from radiation_ss.inference.subsystems import subsystems_of
from radiation_ss.records.record import Record

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
    def relative(self) -> FloatArray:
        """Relative standard deviations, shape (d,)."""
        return np.array([value for _, value in self.parameters.values()])

    def theta(self, u: FloatArray) -> FloatArray:
        """Return parameters of standardised ones, shapes (..., d)."""
        return np.asarray(self.start * np.exp(np.sqrt(np.log1p(self.relative**2)) * u))

    def model(self, theta: FloatArray) -> Model:
        """Return the plant at some parameters (d,)."""
        return model_of(self.build(dict(zip(self.parameters, (float(v) for v in theta)))))


@dataclass(frozen=True, eq=False)
class PlantEstimate:
    """What `DualEnKF.run` returns for an `UncertainPlant`.

    Parameters
    ----------
    plant : UncertainPlant
    time : ndarray, shape (nt,)
    force : Band of ndarray, shape (n, nt)
        Wave excitation force [N, N m].
    parameters : dict of str to ParameterEstimate
    members : ndarray, shape (d, n_ensemble)
    nis, used : ndarray, shape (nt,)
        Sum of squared normalised innovations, and channels used.
    warnings : tuple of str
    """

    plant: UncertainPlant
    time: FloatArray
    force: Band
    parameters: dict[str, ParameterEstimate]
    members: FloatArray
    nis: FloatArray
    used: np.ndarray
    warnings: tuple[str, ...]

    def plants(self, n: int) -> list[ct.StateSpace]:
        """Return n plants of the ensemble as ct.StateSpace with the signals of `cummins`."""
        return plants_of(self.members, n, self.plant.model)


def run_general(plant: UncertainPlant, record: Record, settings: FilterSettings, *, smooth: bool = False,
                passes: int = 10, near: float = 1e-4, settled: float = 0.1) -> PlantEstimate:
    """Filter a record on a plant with named uncertain parameters; of the settings seed, n_ensemble, gate and noise
    count.

    With `smooth` the force is that by all of the record. At most `passes` Gauss-Newton steps over the record, with the
    tangents' plants `near` prior standard deviations apart, ended by one of `settled` posterior standard deviations;
    SolverError if they do not settle.
    """
    nominal, d = plant.model(plant.start), plant.start.size
    scales = scales_of(record, nominal, subsystems_of(nominal.fit), settings.noise)
    force = coloured(scales.force, scales.omega, scales.bandwidth)
    P, y = start_covariance(nominal.fit, scales, force), channels(record, nominal.dofs).T

    def bank(u: FloatArray):  # type: ignore[no-untyped-def]
        return bank_of([plant.model(row) for row in plant.theta(u)], force, scales.noise, P)

    u, information, moved = np.zeros(d), np.zeros((d, d)), np.inf
    known = bool(np.isfinite(y[:, 3 * nominal.n:]).all(axis=1).any())
    for _ in range(passes if known else 0):
        found = run_bank(bank(np.vstack([u + near * np.eye(d), u])), record.time, y, tangents=near)
        information = found.information
        move = np.linalg.solve(np.eye(d) + information, found.gradient - u)
        u, moved = u + move, float(np.sqrt(move @ (np.eye(d) + information) @ move))
        if moved < settled:
            break
    if known and not moved < settled:
        raise SolverError(f"the parameters {', '.join(plant.parameters)} do not settle in {passes} passes; give better "
                          "medians or smaller deviations")
    root = np.linalg.cholesky(np.linalg.inv(np.eye(d) + information))
    drawn = u + exact_draws(np.random.default_rng(settings.seed), d, settings.n_ensemble).T @ root.T
    out = run_bank(bank(np.vstack([drawn, u])), record.time, y, gate=settings.gate, keep=smooth)
    members = plant.theta(drawn).T
    table = parameter_table(tuple(plant.parameters), plant.theta(u), members, plant.start,
                            plant.relative * np.abs(plant.start))
    said = () if known else ("the excitation force is unknown, so motion says nothing about the parameters: they come "
                             "from the prior alone",)
    return PlantEstimate(plant, record.time, smoothed_force(out) if smooth else band_of(out.force.T, out.force_std.T),
                         table, members, out.nis, out.used, said)


Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def model_of(plant: ModelLike) -> Model:
    """Return a plant as a Model; a sampled ct.StateSpace is made continuous first."""
    if hasattr(plant, "input_labels") and plant.dt not in (0, None):
        return as_model(continuous(plant))
    return as_model(plant)


def continuous(system: ct.StateSpace, tolerance: float = 1e-6) -> ct.StateSpace:
    """Return the continuous system behind a sampled composite one, by whichever of zoh, foh and tustin made it.

    Only by the right one is the output `<dof>_vel` the rate of `<dof>`, to a relative `tolerance`. InputError if none
    of the three fits, or dt is not known.
    """
    import control as ct

    if isinstance(system.dt, bool):
        raise InputError(f"{system.name}: discrete without a time step; give dt [s]")
    outputs = list(system.output_labels)
    stems = [label.removesuffix("_force") for label in system.input_labels]
    absent = [s for stem in stems for s in (stem, f"{stem}_vel") if s not in outputs]
    if absent:
        raise InputError(f"{system.name}: output {absent[0]!r} is missing; it has {', '.join(outputs)}")
    x, v = ([outputs.index(stem + tail) for stem in stems] for tail in ("", "_vel"))
    found = [_undo(method, (system.A, system.B, system.C, system.D), float(system.dt))
             for method in ("zoh", "foh", "tustin")]

    def off(matrices: Matrices) -> float:
        F, G, H, J = matrices
        size = [np.abs(part).max() + 1e-300 for part in (H[v], H[v] @ G, np.abs(H[x]).max() * G)]
        parts = (H[x] @ F - H[v], J[v], H[x] @ G)
        return max(float(np.abs(part).max() / one) for part, one in zip(parts, size))

    best = min(found, key=off)
    if not off(best) < tolerance:
        raise InputError(f"{system.name}: sampled, but neither by zoh nor by foh nor by tustin at dt = {system.dt:g} s "
                         f"is {stems[0]}_vel the rate of {stems[0]}; give the continuous system")
    F, G, H, J = best
    return ct.ss(F, G, H, np.where(np.abs(J) > tolerance * np.abs(J).max(), J, 0.0), inputs=list(system.input_labels),
                 outputs=outputs, name=system.name)


def _undo(method: str, system: Matrices, dt: float) -> Matrices:
    """Return the continuous (A, B, C, D) of a sampled one; the inverse of `body.discretisation.discretise`."""
    A, B, C, D = system
    one = np.eye(len(A))
    if method == "tustin":
        a = np.asarray(2.0 / dt * np.linalg.solve((A + one).T, (A - one).T).T)
        left = one - 0.5 * dt * a
        b, c = left @ B / dt, C @ left
        return a, b, c, D - 0.5 * c @ B
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its accuracy is judged by what comes out
        a = np.asarray(np.real(logm(A)) / dt, dtype=np.float64)
    _, held, after = hold_matrices(a, one, dt)
    if method == "zoh":
        return a, np.asarray(np.linalg.solve(held, B)), C, D
    b = np.asarray(np.linalg.solve(held - after + A @ after, B))
    return a, b, C, D - C @ after @ b
