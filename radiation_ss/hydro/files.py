"""Reading and writing hydrodynamic coefficients: which format, and to whom it goes."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.atomic import write_whole
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers.capytaine import from_dataset, netcdf
from radiation_ss.methods import later

if TYPE_CHECKING:
    import xarray as xr

FORMATS = {".nc": "capytaine", ".h5": "bemio", ".hdf5": "bemio", ".1": "wamit", ".2": "wamit", ".3": "wamit",
           ".hst": "wamit", ".out": "wamit", ".wamit": "wamit", ".ah1": "aqwa", ".lis": "aqwa_lis", ".mat": "mss",
           ".cal": "nemoh", ".in": "hams", ".rao": "hydrostar", ".yml": "orcaflex"}
GZIPPED = ("wamit", "aqwa", "aqwa_lis", "orcaflex")  # text of one file, which may be gzipped
HAMS, HYDROSTAR = "Input/ControlFile.in", "AddedMass_11.rao"  # what tells their folders
# Whose files an option is for
OWNER = {"length": "WAMIT", "first_column": "WAMIT", "vessel": "OrcaFlex", "draught": "OrcaFlex"}


def read_hydro(path: "str | Path | xr.Dataset", format: str | None = None, *, rho: float | None = None,
               g: float | None = None, depth: float | None = None, length: float | None = None,
               first_column: str | None = None, vessel: str | None = None,
               draught: str | None = None) -> HydroData:
    """Read hydrodynamic coefficients; units, signs and ordering are converted to the package's.

    Parameters
    ----------
    path : path or xarray.Dataset
        Capytaine .nc, or a dataset of its form; BEMIO .h5; WAMIT .1, .3, .hst (those of the same stem are read
        together), .out or .out.wamit; the folder of a NEMOH, HAMS or HydroStar (.rao) run; AQWA .AH1 or .LIS;
        OrcaFlex .yml (OrcaWave exports it); MSS .mat. Those of WAMIT, AQWA and OrcaFlex may be gzipped (.gz).
    format : str, optional
        'capytaine', 'bemio', 'wamit', 'nemoh', 'hams', 'hydrostar', 'aqwa', 'aqwa_lis', 'orcaflex' or 'mss'; told
        from the name if not given.
    rho, g, depth : float, optional
        Density [kg/m^3], gravity [m/s^2], water depth [m] for a file that does not carry them. A value that
        contradicts the file is refused.
    length : float, optional
        WAMIT's length scale ULEN [m].
    first_column : {'period', 'omega', 'wavenumber', 'deep_wavenumber', 'wavelength'}, optional
        What the first column of WAMIT's .1 and .3 is. If not given a period, unless another reading satisfies the
        Kramers-Kronig relations clearly better; a note says so.
    vessel, draught : str, optional
        The vessel type of an OrcaFlex .yml that holds several, and its draught.

    Returns
    -------
    HydroData
        `.notes` says what the reader assumed or left out.

    Raises
    ------
    InputError
        If the file is missing, damaged or of another form, or a value is not a number.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 20.0, 10))
    >>> rss.write_hydro(section, "section.nc")
    >>> rss.read_hydro("section.nc").dofs
    ('Sway', 'Heave', 'Roll')
    """
    given = {key: float(value) for key, value in (("rho", rho), ("g", g), ("depth", depth)) if value is not None}
    if not isinstance(path, (str, Path)):
        if not hasattr(path, "data_vars"):
            raise InputError(f"read_hydro: a path or an xarray.Dataset is needed, found {type(path).__name__}")
        return from_dataset(path, "dataset", **given)
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.is_file() and path.stat().st_size < 1024 and path.read_bytes().startswith(b"version https://git-lfs"):
        raise InputError(f"{path}: a pointer of Git LFS in place of the file; `git lfs pull` fetches it")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty")
    known = sorted(set(FORMATS.values()))
    name = format or _told_from(path)
    if path.is_dir() and not name:
        files = sorted(file.name for file in path.iterdir() if file.is_file() and _told_from(file))
        raise InputError(f"{path}: a folder with no run of NEMOH (Nemoh.cal), HAMS ({HAMS}) or HydroStar ({HYDROSTAR})"
                         + (f"; give one of its files: {', '.join(files)}" if files else "; other programs' are files"))
    if path.name.lower().endswith((".csv", ".csv.gz", ".parquet")) and not format:
        raise InputError(f"{path}: a record by its name, and coefficients are needed; of commands the model comes "
                         "first, then the records; a table of coefficients becomes a model's file by "
                         "write_hydro(HydroData(omega, A, B, dofs=...), 'body.nc')")
    if name not in known:
        raise InputError(f"{path}: format {format or path.suffix!r} is not known; give format= one of {known}")
    if path.suffix.lower() == ".gz" and name not in GZIPPED:
        raise InputError(f"{path}: gzipped, and files of {name} are not read so; `gunzip` unpacks it")
    options = {key: value for key, value in zip(OWNER, (length, first_column, vessel, draught)) if value is not None}
    for key in options:
        if name != OWNER[key].lower():
            raise InputError(f"{path}: {key} is for {OWNER[key]} files, this one is read as {name}")
    place = "wamit:read_hams" if name == "hams" else f"{name}:read"
    return later(f"hydro.readers.{place}", path, **given, **options)


def _told_from(path: Path) -> str | None:
    """Return the format of a file by its name, of a folder by what lies in it."""
    if path.is_dir():
        found = {"hams": (path / HAMS).is_file(), "hydrostar": (path / HYDROSTAR).is_file(),
                 "nemoh": later("hydro.readers.nemoh:is_run", path)}
        return next((name for name, there in found.items() if there), None)
    name = FORMATS.get(Path(path.name.lower().removesuffix(".gz")).suffix)
    return "hams" if name == "wamit" and later("hydro.readers.wamit:is_wamit_form", path.absolute()) else name


def write_hydro(data: HydroData, path: str | Path) -> None:
    """Write `data` as a Capytaine netCDF dataset (.nc); `read_hydro` gives the same numbers back.

    Parameters
    ----------
    data : HydroData, xarray.Dataset or path
    path : path
        Its name ends in .nc.

    Raises
    ------
    InputError
        If the name does not end in .nc or the folder does not exist.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> data = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 20.0, 10))
    >>> rss.write_hydro(data, "section.nc")
    >>> bool(np.allclose(rss.read_hydro("section.nc").B, data.B))
    True
    """
    path = Path(path)
    if path.suffix.lower() != ".nc":
        raise InputError(f"{path}: write_hydro writes Capytaine's netCDF form; the name must end in .nc")
    data = data if isinstance(data, HydroData) else read_hydro(data)
    write_whole(path, netcdf(data))


def as_data(data: Any) -> HydroData:
    """Return HydroData as they are, frequency response data as HydroData with A_inf = 0, a file or dataset read."""
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
    if getattr(data, "dt", None):
        raise InputError(f"data: a discrete response (dt = {data.dt:g} s); one of continuous time is needed")
    omega = np.asarray(omega, dtype=float)
    if (omega <= 0.0).any():
        raise InputError(f"data: omega = {omega.min():g} rad/s found; frequencies above zero are needed "
                         "(K(0) is set by at_zero)")
    K = np.moveaxis(np.asarray(response), -1, 0)
    dofs = tuple(label.removesuffix("_vel").replace("[", "").replace("]", "") for label in data.input_labels)
    return HydroData(omega, K.imag / omega[:, None, None], K.real, np.zeros(K.shape[1:]), dofs=dofs,
                     source=str(getattr(data, "name", "")))
