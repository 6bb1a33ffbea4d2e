"""The body and the tank of Hanaki, Takaoka & Minoura (2022), built from their dimensions, and what the demo finds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.diagnosis.result import Diagnosis
from radiation_ss.fit.radiation import fit_radiation
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.section.shapes import Section, lewis_section
from radiation_ss.hydro.section.solver import section_2d
from radiation_ss.identification.result import Identification
from radiation_ss.page import number
from radiation_ss.records.record import Record

LENGTH, HALF_BREADTH, DRAFT, AREA_RATIO, DEPTH = 0.297, 0.1, 0.1, 0.90, 0.45

# What the simulated experiments on it suffer from.
ERROR = 0.15  # relative standard deviation of the parameters that identification starts from
NOISE = 0.01  # of the sensors, relative to the motion


def tank_section() -> Section:
    """Return the Lewis section of the paper's body (section 4 of the paper)."""
    return lewis_section(HALF_BREADTH, DRAFT, AREA_RATIO)


def tank_hydro(frequencies: int = 100) -> HydroData:
    """Return heave coefficients of the body in the tank, 0.3 to 30 rad/s, from the section solver."""
    omega = np.geomspace(0.3, 30.0, frequencies)
    data = section_2d(tank_section(), omega, DEPTH, gyradius=0.7 * HALF_BREADTH)
    return data.times(LENGTH).select("Heave").replace(source="tank of Hanaki et al. (2022)")


def tank_model(hydro: HydroData, order: int = 3) -> Model:
    """Return the Cummins model of the body with a passive radiation model of the paper's order."""
    return Model.from_hydro(hydro, fit_radiation(hydro, order))


@dataclass(frozen=True, eq=False)
class DemoEstimate:
    """One way to identify the radiation model, scored against the known truth.

    Parameters
    ----------
    name : str
    error_of_K : float
        Norm of the error of K(iw) in the band of the waves over the norm of K.
    error_of_force : float
        Root mean square of the force's error over that of the force; NaN where it gives none.
    result : Identification
    """

    name: str
    error_of_K: float
    error_of_force: float
    result: Identification


@dataclass(frozen=True, eq=False)
class Demo:
    """What the demo found."""

    hydro: HydroData
    model: Model
    record: Record
    start: RadiationFit
    estimates: tuple[DemoEstimate, ...]
    error_at_start: float
    diagnosis: Diagnosis
    seconds: dict[str, float]

    @property
    def summary(self) -> dict[str, Any]:
        """The numbers, ready for JSON."""
        return {"fit": {"order": self.model.fit.order, "passive": self.model.fit.passive,
                        "relative_error": self.model.fit.relative_error},
                "identification": {"start": {"error_of_K": self.error_at_start},
                                   **{e.name: {"error_of_K": e.error_of_K, "error_of_force": e.error_of_force}
                                      for e in self.estimates}},
                "diagnosis": self.diagnosis.to_dict(), "seconds": self.seconds}

    @property
    def text(self) -> str:
        """The result in a few lines."""
        lines = [f"Radiation model: {self.model.fit!r}",
                 f"Error of K(iw) in the band of the waves: {self.error_at_start:.3f} of the prior model"]
        lines += [f"  {e.name}: {e.error_of_K:.3f}, force error {number(e.error_of_force)}" for e in self.estimates]
        return "\n".join([*lines, str(self.diagnosis)])
