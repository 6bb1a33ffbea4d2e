"""The body and the tank of Hanaki, Takaoka & Minoura (2022), built from nothing but their dimensions."""

from __future__ import annotations

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.fit.radiation import fit_radiation
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.section import Section, lewis_section, section_2d

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
