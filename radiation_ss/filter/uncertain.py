"""A plant as a function of named uncertain parameters, and what the filter says of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.body.composite import system_matrices
from radiation_ss.body.convert import ModelLike, as_model, in_cummins_coordinates
from radiation_ss.body.model import Model
from radiation_ss.body.steps import Matrices
from radiation_ss.errors import InputError
from radiation_ss.filter.estimate import Band, ParameterEstimate, plants_of

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
        return self.build(dict(zip(self.parameters, (float(v) for v in theta))))


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
    counts : dict of str to int
        Samples refused.
    warnings : tuple of str
    """

    plant: UncertainPlant
    time: FloatArray
    force: Band
    parameters: dict[str, ParameterEstimate]
    members: FloatArray
    nis: FloatArray
    used: np.ndarray
    counts: dict[str, int]
    warnings: tuple[str, ...]

    def plants(self, n: int) -> list[ct.StateSpace]:
        """Return n plants of the ensemble as ct.StateSpace with the signals of `cummins`."""
        return plants_of(self.members, n, self.plant.model)
