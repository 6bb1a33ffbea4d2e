"""Whatever stands for a model, as a Model: a file, coefficients, a ct.StateSpace with the signals of `cummins`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import null_space

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.body.files import read_model
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.data import ROTATIONS, TRANSLATIONS, HydroData

if TYPE_CHECKING:
    import control as ct

ModelLike = Any  # Model, HydroData, ct.StateSpace, (M, C, A_inf) with a fit, or the path of a file


def as_model(body: ModelLike, fit: RadiationFit | None = None) -> Model:
    """Return whatever stands for a model as a Model.

    Parameters
    ----------
    body : Model, HydroData, control.StateSpace, path or (M, C, A_inf)
        Data need inertia and hydrostatics; a path is read by `read_model`; a state space has the signals of `cummins`;
        the three matrices, shape (n, n), SI, are ordered as `fit.dofs`.
    fit : RadiationFit, optional
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
    if isinstance(body, str | Path):
        body = read_model(body) if fit is None else read_model(body).replace(fit=fit)
    if isinstance(body, Model):
        return body if fit is None else body.replace(fit=fit)
    if hasattr(body, "input_labels"):
        model = from_state_space(body)
        return model if fit is None else model.replace(fit=fit)
    if fit is None:
        raise InputError("fit: missing; make one with fit_radiation(data, order)")
    if isinstance(body, HydroData):
        return Model.from_hydro(body, fit)
    return _from_matrices(body, fit)


def opened(body: ModelLike) -> ModelLike:
    """Return the model of a file where its name is given, anything else as it is."""
    return read_model(body) if isinstance(body, str | Path) else body


def _from_matrices(body: Sequence[ArrayLike], fit: RadiationFit) -> Model:
    """Return the model of (M, C, A_inf)."""
    try:
        count = len(body)
    except TypeError:
        count = 0
    if count != 3:
        raise InputError(f"body: a Model, a HydroData, a ct.StateSpace, a file or the three matrices (M, C, A_inf) are "
                         f"needed, {type(body).__name__} found")
    n = len(fit.dofs)
    M, C, A_inf = (read_only(np.atleast_2d(np.asarray(value, dtype=float)), label, (n, n))
                   for value, label in zip(body, ("M", "C", "A_inf")))
    return Model(dofs=fit.dofs, M=M, C=C, A_inf=A_inf, fit=fit)


def dof_of_signal(stem: str) -> str:
    """Return the degree of freedom of a signal's stem: 'Heave' of 'heave', 'float__Heave' of 'float_heave'."""
    head, _, tail = stem.rpartition("_")
    mode = tail.capitalize()
    if mode not in TRANSLATIONS + ROTATIONS:
        raise InputError(f"signal {stem}_force: {tail!r} is not one of {', '.join(TRANSLATIONS + ROTATIONS)}")
    return f"{head}__{mode}" if head else mode


def from_state_space(system: ct.StateSpace) -> Model:
    """Return the Model of a composite system with the signals of `cummins`, in any state coordinates.

    Motion alone tells M + A_inf and not its parts: all of it is returned as M, and A_inf is zero. In the coordinates
    (r, x, v) with displacement x, velocity v and radiation states r that neither the force drives nor x, the system is
    r' = a r + b v, v' = (M + A_inf)^-1 (f - c r - C x - D v).

    Parameters
    ----------
    system : control.StateSpace
        Continuous; inputs `<dof>_force`, outputs with `<dof>` and `<dof>_vel`.

    Raises
    ------
    InputError
        If the system is discrete, a signal is missing, or its velocity is not the rate of its displacement.
    """
    name = getattr(system, "name", None) or "system"
    if system.dt not in (0, None):
        raise InputError(f"{name}: sampled at dt = {system.dt} s; a continuous system is needed")
    strange = [label for label in system.input_labels if not label.endswith("_force")]
    if strange:
        raise InputError(f"{name}: input {strange[0]!r}; inputs <dof>_force are needed, as those of `cummins`")
    stems = [label.removesuffix("_force") for label in system.input_labels]
    outputs = list(system.output_labels)
    absent = [s for stem in stems for s in (stem, f"{stem}_vel") if s not in outputs]
    if absent:
        raise InputError(f"{name}: output {absent[0]!r} is missing; it has {', '.join(outputs)}")
    F, G = np.asarray(system.A, float), np.asarray(system.B, float)
    x = np.asarray(system.C, float)[[outputs.index(stem) for stem in stems]]
    v = np.asarray(system.C, float)[[outputs.index(f"{stem}_vel") for stem in stems]]
    scale = np.abs(v).max() or 1.0
    if np.abs(x @ F - v).max() > 1e-8 * scale or np.abs(x @ G).max() > 1e-8 * np.abs(G).max():
        raise InputError(f"{name}: output {stems[0]}_vel is not the rate of change of {stems[0]}, or the force acts on "
                         "the velocity directly; the signals of `cummins` are needed")
    if min(np.linalg.matrix_rank(v @ G), np.linalg.matrix_rank(np.vstack([x, v])) - len(stems)) < len(stems):
        raise InputError(f"{name}: no inertia can be found between {stems[0]}_force and {stems[0]}_vel; each degree of "
                         "freedom needs a displacement, a velocity and a force of its own")
    dofs = tuple(dof_of_signal(stem) for stem in stems)
    return _in_cummins_coordinates(F, G, x, v, dofs, "body" if name.startswith("sys[") else name)


def _in_cummins_coordinates(F: FloatArray, G: FloatArray, x: FloatArray, v: FloatArray, dofs: tuple[str, ...],
                            name: str) -> Model:
    n, m = len(dofs), F.shape[0] - 2 * len(dofs)
    free = null_space(G.T).T                       # coordinates that no force drives, x among them
    r = free - (free @ np.linalg.pinv(x)) @ x
    r = np.linalg.svd(r)[2][:m]
    back = np.linalg.inv(np.vstack([r, x, v]))
    rates = r @ F @ back                           # r' = a r + e x + b v
    a, e, b = rates[:, :m], rates[:, m:m + n], rates[:, m + n:]
    shift = np.linalg.lstsq(a, e, rcond=None)[0] if m else e      # r + shift x is not driven by x
    accelerations = v @ F @ back
    inertia = read_only(np.linalg.inv(v @ G), "inertia", (n, n))
    c, C, D = (-inertia @ part for part in np.split(accelerations, [m, m + n], axis=1))
    fit = RadiationFit(dofs, a, b + shift, c, m, method="state space")
    return Model(dofs, M=inertia, A_inf=np.zeros((n, n)), C=C - c @ shift, fit=fit, D=D, name=name)

