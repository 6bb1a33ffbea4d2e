"""Models on disk: a Capytaine dataset, with the radiation model and the tolerances in a group of their own."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import write_whole
from radiation_ss.body.model import Model
from radiation_ss.body.modes import natural_modes
from radiation_ss.errors import InputError
from radiation_ss.fit.files import from_dict, read_fit, to_dict
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.files import read_hydro
from radiation_ss.hydro.readers.capytaine import netcdf
from radiation_ss.reading import decoded, named_numbers, text

GROUP, SCHEMAS = "radiation_ss", ("radiation_ss.model/2", "radiation_ss.model/1")


def read_model(path: str | Path, fit: str | Path | RadiationFit | None = None, *, dofs: Sequence[str] | None = None,
               order: int | None = None, accuracy: float | None = None) -> Model:
    """Read a whole linear model from a hydrodynamic file with inertia and hydrostatics.

    Parameters
    ----------
    path : path
        A Capytaine .nc (any file of `read_hydro` that carries M and C), or one of `Model.write`.
    fit : path or RadiationFit, optional
        The radiation model, as a file of `RadiationFit.write`. Without it that of the file, if `Model.write` left one
        there and no order is asked for; else it is fitted.
    dofs : sequence of str, optional
        Degrees of freedom to keep; all if absent.
    order : int, optional
        Order of the fit.
    accuracy : float, optional
        Largest relative error of the fit, see `Model.from_hydro`.

    Raises
    ------
    InputError
        If a file is unreadable or inertia or hydrostatics are missing.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545).write("ship.nc")
    >>> rss.read_model("ship.nc").dofs
    ('Roll',)
    """
    data = read_hydro(path)
    own = _own_part(Path(path))
    if isinstance(fit, str | Path):
        fit = read_fit(fit)
    if own is not None and own["coefficients"] != _digest(data):
        data = data.replace(notes=(*data.notes, f"{path}: its coefficients were changed since the model was written; "
                                   "name, tolerances and radiation model of the file are not used"))
        own = None
    if fit is None and own is not None and order is None:
        fit = own["fit"] if dofs is None else part_of_fit(own["fit"], dofs)
    model = Model.from_hydro(data, fit, dofs=dofs, order=order, accuracy=accuracy)
    return model if own is None else model.replace(name=own["name"], tolerance=own["tolerance"])


def write_model(model: Model, path: str | Path) -> None:
    """Write a model as a Capytaine dataset (.nc); `read_model` gives it back.

    The coefficients are those that the model was made of, or of its radiation model where it was made of none; M, C,
    A_inf and D are the model's. The group `radiation_ss` holds name, tolerances and radiation model.

    Parameters
    ----------
    model : Model
    path : path
        Its name ends in .nc.

    Raises
    ------
    InputError
        If the name does not end in .nc or the folder does not exist.
    """
    import h5py

    if Path(path).suffix.lower() != ".nc":
        raise InputError(f"{path}: a model is written in Capytaine's netCDF form; the name must end in .nc")

    data = coefficients(model)
    own = {"schema": SCHEMAS[0], "name": model.name, "tolerance": dict(model.tolerance), "fit": to_dict(model.fit),
           "coefficients": _digest(data)}
    own["digest"] = _text_digest(own)
    raw = io.BytesIO(netcdf(data))
    with h5py.File(raw, "r+") as file:
        file[f"{GROUP}/model"] = json.dumps(own)
        file.attrs[GROUP] = "holds a model in a group of its own"
    write_whole(path, raw.getvalue())


def coefficients(model: Model) -> HydroData:
    """Return the frequency-domain coefficients that stand for a model."""
    data = model.hydro
    changes = {"M": model.M, "C": model.C, "D": model.D, "A_inf": model.A_inf}
    if data is not None and data.A_inf is not None:
        return data.replace(A=data.A + (model.A_inf - data.A_inf), **changes)
    fastest = [1.0, *(np.abs(np.linalg.eigvals(model.fit.a))), *(2.0 * np.pi / natural_modes(model).period)]
    used = [w for w in fastest if w > 0.0]
    omega = np.geomspace(0.1 * min(used), 10.0 * max(used), 80)
    K = model.fit.frequency_response(omega)
    K = 0.5 * (K + np.swapaxes(K, 1, 2))
    return HydroData(omega, model.A_inf + K.imag / omega[:, None, None], K.real, dofs=model.dofs, source=model.name,
                     reference_point=(np.nan,) * 3, **changes)  # type: ignore[arg-type]


def part_of_fit(fit: RadiationFit, dofs: Sequence[str]) -> RadiationFit:
    """Return the radiation model of some degrees of freedom, without the states that they do not reach.

    Raises
    ------
    InputError
        If a degree of freedom is not among the fit's.
    """
    absent = [dof for dof in dofs if dof not in fit.dofs]
    if absent:
        raise InputError(f"degree of freedom {absent[0]!r} is not among {list(fit.dofs)}")
    pick = [fit.dofs.index(dof) for dof in dofs]
    reached = np.any(fit.b[:, pick] != 0.0, axis=1)
    for _ in range(fit.states):
        reached = reached | ((fit.a != 0.0) @ reached)
    A_inf = None if fit.A_inf is None else fit.A_inf[np.ix_(pick, pick)]
    return fit.replace(dofs=tuple(dofs), a=fit.a[np.ix_(reached, reached)], b=fit.b[reached][:, pick],
                       c=fit.c[pick][:, reached], A_inf=A_inf, entry_error=None, data=None, blocks=(), path=(),
                       suspects=())


def _digest(data: HydroData) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in (data.omega, data.A, data.B))
                          ).hexdigest()


def _text_digest(own: dict[str, Any]) -> str:
    content = {name: value for name, value in own.items() if name != "digest"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _own_part(path: Path) -> dict[str, Any] | None:
    """Return name, tolerances, radiation model and digest of the coefficients that `write_model` left, if it did."""
    if path.suffix.lower() != ".nc":
        return None
    import h5py

    def whole() -> dict[str, Any] | None:
        if not h5py.is_hdf5(path):
            return None
        with h5py.File(path, "r") as file:
            if GROUP not in file and GROUP not in file.attrs:
                return None
            own = json.loads(file[GROUP]["model"][()])
        if own["schema"] not in SCHEMAS:
            raise InputError(f"{path}: field 'schema' of group {GROUP} is {own['schema']!r}, {SCHEMAS[0]!r} needed")
        if (own["schema"] == SCHEMAS[0] or "digest" in own) and own["digest"] != _text_digest(own):
            raise InputError(f"{path}: group {GROUP} is not what was written; write the model again")
        return {"name": text(own["name"], "name"), "tolerance": named_numbers(own["tolerance"], "tolerance"),
                "fit": from_dict(own["fit"]), "coefficients": own["coefficients"]}

    return decoded(path, f"group {GROUP} of a model; write the model again", whole)
