"""Reading and writing hydrodynamic coefficients: which format, and to whom it goes."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData

FORMATS = {".nc": "capytaine"}


def read_hydro(path: str | Path, format: str | None = None, **options: float) -> HydroData:
    """Read hydrodynamic coefficients; units, signs and ordering are converted to the package's.

    Parameters
    ----------
    path : path
        A Capytaine .nc dataset.
    format : str, optional
        'capytaine'; else told from the name.
    **options : float
        rho [kg/m^3], g [m/s^2], depth [m]: for a file that does not carry them. A value that contradicts
        the file is refused.

    Returns
    -------
    HydroData
        `.notes` says what the reader assumed or left out.

    Raises
    ------
    InputError
        If the file is missing, damaged or of another form, or a value is not a number.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    known = sorted(set(FORMATS.values()))
    name = format or FORMATS.get(path.suffix.lower())
    if name not in known:
        raise InputError(f"{path}: format {format or path.suffix!r} is not known; give format= one of {known}")
    return import_module(f"radiation_ss.hydro.readers.{name}").read(path, **options)


def write_hydro(data: HydroData, path: str | Path) -> None:
    """Write `data` as a Capytaine netCDF dataset (.nc); `read_hydro` gives the same numbers back.

    Raises
    ------
    InputError
        If the name does not end in .nc or the folder does not exist.
    """
    path = Path(path)
    if path.suffix.lower() != ".nc":
        raise InputError(f"{path}: write_hydro writes Capytaine's netCDF form; the name must end in .nc")
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist")
    import_module("radiation_ss.hydro.readers.capytaine").write(data, path)
