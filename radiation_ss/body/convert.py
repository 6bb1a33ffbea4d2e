"""Whatever stands for a model, as a Model: a file, coefficients, a ct.StateSpace with the signals of `cummins`.

A model's own file is a Capytaine dataset, with the radiation model and the tolerances in a group of their own.
"""

from __future__ import annotations

import hashlib
import io
import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import null_space

from radiation_ss.arrays import FloatArray, listed, read_only
from radiation_ss.atomic import write_whole
from radiation_ss.body.dynamics import check_fit, from_hydro, natural_modes
from radiation_ss.body.model import Model
from radiation_ss.body.time_step import Matrices, continuous
from radiation_ss.errors import InputError, InputWarning
from radiation_ss.fit.files import from_dict, read_fit, to_dict
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import RIGID, HydroData, signal
from radiation_ss.hydro.files import read_hydro
from radiation_ss.hydro.measures import inertia_not_symmetric
from radiation_ss.hydro.readers.capytaine import netcdf
from radiation_ss.reading import decoded, named_numbers, text

if TYPE_CHECKING:
    import control as ct

PREDICTION = 0.005  # largest relative error of the radiation model where motions are predicted
GROUP, SCHEMAS = "radiation_ss", ("radiation_ss.model/2", "radiation_ss.model/1")


def read_model(path: str | Path, fit: str | Path | RadiationFit | None = None, *, dofs: Sequence[str] | None = None,
               order: int | None = None, accuracy: float | None = None) -> Model:
    """Read a whole linear model from a hydrodynamic file with inertia and hydrostatics.

    Parameters
    ----------
    path : path
        A Capytaine .nc (any file of `read_hydro` that carries M and C), or one of `Model.write`.
    fit : path or RadiationFit, optional
        The radiation model, as a file of `RadiationFit.write`, of the degrees of freedom that are kept or of more.
        Without it that of the file, if `Model.write` left one there and no order is asked for; else it is fitted.
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
    return model_of(read_hydro(path), Path(path), fit, dofs, order, accuracy)


def model_of(data: HydroData, path: Path, fit: str | Path | RadiationFit | None, dofs: Sequence[str] | None,
             order: int | None, accuracy: float | None) -> Model:
    """Return the model of a file whose coefficients are read already; see `read_model`."""
    own = _own_part(path)
    known = read_fit(fit) if isinstance(fit, str | Path) else fit
    if own is not None and own["coefficients"] != _digest(data):
        data = data.replace(notes=(*data.notes, f"{path}: its coefficients were changed since the model was written; "
                                   "name, tolerances and radiation model of the file are not used"))
        own = None
    ours = known is None and own is not None and order is None
    if own is not None and ours:
        known = own["fit"]
    if known is not None and dofs is not None and set(listed(dofs)) <= set(known.dofs):
        known = known.select(listed(dofs))
    model = from_hydro(data, known, dofs, order, accuracy, {}, own=ours)
    return model if own is None else model.replace(name=own["name"], tolerance=own["tolerance"])


def write_model(model: Model, path: str | Path) -> None:
    """Write a model as a Capytaine dataset (.nc); `read_model` gives it back.

    The coefficients are those that the model was made of, or of its radiation model where it was made of none; M, C,
    A_inf and D are the model's. The group `radiation_ss` holds name, tolerances and radiation model.
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


ModelLike = Any  # Model, HydroData, ct.StateSpace, (M, C, A_inf) with a fit, or the path of a file


def as_model(body: ModelLike, fit: RadiationFit | str | Path | None = None) -> Model:
    """Return whatever stands for a model as a Model.

    Parameters
    ----------
    body : Model, HydroData, xarray.Dataset, control.StateSpace, filter.UncertainPlant, path or (M, C, A_inf)
        Data need inertia and hydrostatics; a path is read by `read_model`, accuracy 0.005; a state space has the
        signals of `cummins`; the three matrices, shape (n, n), SI, are ordered as `fit.dofs`.
    fit : RadiationFit or path, optional
        The radiation model to use; needed with data and matrices.

    Raises
    ------
    InputError
        If the fit is missing, a file is unreadable, or a state space is not that of a Cummins model.

    Examples
    --------
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=10.0, C=4000.0, period=0.4)
    >>> rss.as_model(rss.cummins(model)).dofs
    ('Heave',)
    """
    fit = read_fit(fit) if isinstance(fit, str | Path) else fit
    if fit is not None and not isinstance(fit, RadiationFit):
        raise InputError(f"fit: a RadiationFit or its file is needed, {type(fit).__name__} found")
    body = read_hydro(body) if hasattr(body, "data_vars") else body
    if isinstance(body, str | Path):
        body = read_model(body, fit, accuracy=PREDICTION)
    body = body.nominal() if hasattr(body, "nominal") else body  # a plant with named uncertain parameters
    model = in_cummins_coordinates(body)[0] if hasattr(body, "input_labels") else body
    if isinstance(model, Model):
        if fit is None or fit is model.fit:
            return model
        if model.hydro is not None:
            check_fit(fit, model.hydro)
        return model.replace(fit=fit)
    if fit is None:
        raise InputError("fit: missing; make one with fit_radiation(data, order)")
    if isinstance(body, HydroData):
        if list(fit.dofs) == [signal(dof) for dof in body.dofs]:  # of the data as a control.FRD
            fit = fit.renamed(body.dofs)
        if left := [dof for dof in body.dofs if dof not in fit.dofs]:
            raise InputError(f"fit: it is of {', '.join(fit.dofs)}, and {body.source or 'the data'} has "
                             f"{', '.join(left)} too; take data.select({list(fit.dofs)})")
        needed = [dof for dof, column, row in zip(fit.dofs, fit.b.T, fit.c)
                  if dof in body.dofs or column.any() or row.any()]  # a file of six may enable what does not radiate
        return Model.from_hydro(body, fit if len(needed) == len(fit.dofs) else fit.select(needed))
    return _from_matrices(body, fit)


def opened(body: ModelLike) -> ModelLike:
    """Return the model of a file where its name is given, anything else as it is."""
    return read_model(body) if isinstance(body, str | Path) else body


def _from_matrices(body: Sequence[ArrayLike], fit: RadiationFit) -> Model:
    """Return the model of (M, C, A_inf)."""
    if not hasattr(body, "__len__") or len(body) != 3:
        raise InputError(f"body: a Model, a HydroData, a ct.StateSpace, a file or the three matrices (M, C, A_inf) are "
                         f"needed, {type(body).__name__} found")
    n = len(fit.dofs)
    M, C, A_inf = (read_only(np.atleast_2d(value), label, (n, n)) for value, label in zip(body, ("M", "C", "A_inf")))
    if skew := inertia_not_symmetric(A_inf, M, fit.dofs):
        warnings.warn(InputWarning(skew), stacklevel=3)
    return Model(dofs=fit.dofs, M=M, C=C, A_inf=A_inf, fit=fit)


def dof_of_signal(stem: str) -> str:
    """Return the degree of freedom of a signal's stem: 'Heave' of 'heave', 'float__Heave' of 'float_heave'."""
    head, _, tail = stem.rpartition("_")
    mode = tail.capitalize()
    if mode not in RIGID:
        raise InputError(f"signal {stem}_force: {tail!r} is not one of {', '.join(RIGID)}")
    return f"{head}__{mode}" if head else mode


def in_cummins_coordinates(system: ct.StateSpace) -> tuple[Model, Matrices, FloatArray]:
    """Return the Model of a system, the system (continuous; displacements, velocities, accelerations), its coordinates.

    The system is continuous or sampled, in any states; its inputs are `<dof>_force`, `<dof>` and `<dof>_vel` among its
    outputs. Motion alone tells M + A_inf and not its parts: all of it is returned as M, and A_inf is zero.

    In the coordinates z = (r, x, v) with displacement x, velocity v and radiation states r that neither the force
    drives nor x, the system is r' = a r + b v, v' = (M + A_inf)^-1 (f - c r - C x - D v); its own states are T z.
    """
    name = getattr(system, "name", None) or "system"
    F, G, x, v, dofs = _motion(system, name)
    n, m = len(dofs), F.shape[0] - 2 * len(dofs)
    free = null_space(G.T).T                       # coordinates that no force drives, x among them
    r = free - (free @ np.linalg.pinv(x)) @ x
    r = np.linalg.svd(r)[2][:m]
    T = np.linalg.inv(np.vstack([r, x, v]))
    rates = r @ F @ T                              # r' = a r + e x + b v
    a, e, b = rates[:, :m], rates[:, m:m + n], rates[:, m + n:]
    shift = np.linalg.lstsq(a, e, rcond=None)[0] if m else e      # r + shift x is not driven by x
    accelerations = v @ F @ T
    inertia = read_only(np.linalg.inv(v @ G), "inertia", (n, n))
    c, C, D = (-inertia @ part for part in np.split(accelerations, [m, m + n], axis=1))
    size = np.sqrt(np.abs(np.diag(inertia)))       # beside what the fastest motion feels, D may be rounding
    D[np.abs(D) < 1e-12 * np.abs(np.linalg.eigvals(F)).max() * np.outer(size, size)] = 0.0
    fit = RadiationFit(dofs, a, b + shift, c, m, method="state space")
    model = Model(dofs, M=inertia, A_inf=np.zeros((n, n)), C=C - c @ shift, fit=fit, D=D,
                  name="body" if name.startswith("sys[") else name)
    T[:, m:m + n] -= T[:, :m] @ shift
    return model, (F, G, np.vstack([x, v, v @ F]), np.vstack([0.0 * x @ G, 0.0 * v @ G, v @ G])), T


def _motion(system: ct.StateSpace, name: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Return (F, G) of the continuous system, rows of displacement and velocity, degrees of freedom; all checked."""
    if not hasattr(system, "A"):
        raise InputError(f"{name}: {type(system).__name__} found; a ct.StateSpace, signals as `cummins`, is needed")
    if strange := [label for label in system.input_labels if not label.endswith("_force")]:
        raise InputError(f"{name}: input {strange[0]!r}; inputs <dof>_force are needed, as those of `cummins`")
    stems = [label.removesuffix("_force") for label in system.input_labels]
    outputs = list(system.output_labels)
    if absent := [s for stem in stems for s in (stem, f"{stem}_vel") if s not in outputs]:
        raise InputError(f"{name}: output {absent[0]!r} is missing; it has {', '.join(outputs)}")
    at = [outputs.index(stem) for stem in stems], [outputs.index(f"{stem}_vel") for stem in stems]
    F, G, H, J = (np.asarray(part, float) for part in (system.A, system.B, system.C, system.D))
    if isinstance(system.dt, bool):
        raise InputError(f"{name}: discrete without a time step; give dt [s]")
    if system.dt:
        F, G, H, J = continuous((F, G, H, J), float(system.dt), at, name)
    x, v = (H[rows] for rows in at)
    if not system.dt and (np.abs(x @ F - v).max() > 1e-8 * (np.abs(v).max() or 1.0)
                          or np.abs(x @ G).max() > 1e-8 * np.abs(G).max()):
        raise InputError(f"{name}: output {stems[0]}_vel is not the rate of change of {stems[0]}, or the force acts on "
                         "the velocity directly; the signals of `cummins` are needed")
    if min(np.linalg.matrix_rank(v @ G), np.linalg.matrix_rank(np.vstack([x, v])) - len(stems)) < len(stems):
        raise InputError(f"{name}: no inertia can be found between {stems[0]}_force and {stems[0]}_vel; each degree of "
                         "freedom needs a displacement, a velocity and a force of its own")
    return F, G, x, v, tuple(dof_of_signal(stem) for stem in stems)
