"""Frequency response data as hydrodynamic data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.files import read_hydro


def as_data(data: Any) -> HydroData:
    """Return HydroData as they are, frequency response data as HydroData with A_inf = 0, a file or dataset read.

    Raises
    ------
    InputError
        If `data` is something else, not square, or has frequencies that are not above zero and ascending.
    """
    if isinstance(data, HydroData):
        return data
    if isinstance(data, str | Path) or hasattr(data, "data_vars"):
        return read_hydro(data)
    response = getattr(data, "frdata" if hasattr(data, "frdata") else "fresp", None)
    omega = getattr(data, "omega", None)
    if response is None or omega is None:
        raise InputError(f"data: {type(data).__name__} found; HydroData, xarray.Dataset, ct.FrequencyResponseData "
                         "or the name of a file needed")
    if response.shape[0] != response.shape[1]:
        raise InputError(f"data: {response.shape[0]} outputs and {response.shape[1]} inputs found; "
                         "as many of both needed")
    omega = np.asarray(omega, dtype=float)
    if (omega <= 0.0).any():
        raise InputError(f"data: omega = {omega.min():g} rad/s found; frequencies above zero are needed "
                         "(K(0) is set by at_zero)")
    K = np.moveaxis(np.asarray(response), -1, 0)
    dofs = tuple(label.removesuffix("_vel").replace("[", "").replace("]", "") for label in data.input_labels)
    return HydroData(omega, K.imag / omega[:, None, None], K.real, np.zeros(K.shape[1:]), dofs=dofs,
                     source=str(getattr(data, "name", "")))
