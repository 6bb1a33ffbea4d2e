"""Save a running filter and take it up again, bit for bit: one .npz of plain arrays, nothing pickled."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit

SCHEMA = "radiation_ss.filter/2"


def write(path: str | Path, settings: dict[str, object], model: Model, arrays: dict[str, np.ndarray]) -> None:
    """Write settings (anything JSON can hold), the model's matrices and the filter's arrays."""
    header = {"schema": SCHEMA, "settings": settings, "dofs": list(model.dofs), "order": model.fit.order,
              "fit_method": model.fit.method, "name": model.name}
    plant = {"M": model.M, "A_inf": model.A_inf, "C": model.C, "D": model.D, "a": model.fit.a, "b": model.fit.b,
             "c": model.fit.c}
    content: dict[str, Any] = {f"model_{k}": v for k, v in plant.items()}
    content |= {f"state_{k}": np.asarray(v) for k, v in arrays.items()}
    with open(path, "wb") as file:
        np.savez(file, header=np.array(json.dumps(header)), **content)


def read(path: str | Path) -> tuple[dict, Model, dict[str, np.ndarray]]:
    """Read what `write` wrote.

    Raises
    ------
    InputError
        If the file is not a saved filter.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            content = {key: file[key] for key in file.files}
        header = json.loads(str(content["header"]))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not a saved filter ({error})") from None
    if header.get("schema") != SCHEMA:
        raise InputError(f"{path}: schema {header.get('schema')!r} found, {SCHEMA!r} needed")
    part = {key.removeprefix("model_"): value for key, value in content.items() if key.startswith("model_")}
    dofs = tuple(header["dofs"])
    fit = RadiationFit(dofs=dofs, a=part["a"], b=part["b"], c=part["c"], order=header["order"], A_inf=part["A_inf"],
                       method=header["fit_method"])
    model = Model(dofs=dofs, M=part["M"], A_inf=part["A_inf"], C=part["C"], D=part["D"], fit=fit, name=header["name"])
    state = {key.removeprefix("state_"): value for key, value in content.items() if key.startswith("state_")}
    return header["settings"], model, state
