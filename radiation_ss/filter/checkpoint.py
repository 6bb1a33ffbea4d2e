"""Save a running filter and take it up again, bit for bit: one .npz of plain arrays, nothing pickled.

The file appears whole or not at all, and carries a digest of its contents.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss import reading
from radiation_ss.atomic import written_whole
from radiation_ss.body.model import Model
from radiation_ss.errors import InputError
from radiation_ss.filter.settings import FilterSettings, ForceModel
from radiation_ss.fit.result import RadiationFit
from radiation_ss.inference.scales import SignalScales
from radiation_ss.reading import decoded

SCHEMA = "radiation_ss.filter/3"
# Settings that are arrays: they are written as what the filter makes of them
ARRAYS = ("points", "prior", "noise", "entries", "omega", "force_model", "units")


def write_arrays(path: str | Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays with their digest, whole or not at all."""
    content: dict[str, Any] = {**arrays, "digest": np.array(_digest(arrays))}
    with written_whole(path) as beside, open(beside, "wb") as file:
        np.savez(file, **content)


def read_arrays(path: str | Path, what: str) -> dict[str, np.ndarray]:
    """Read what `write_arrays` wrote; InputError says whether the file is missing, cut or changed."""
    if not Path(path).exists():
        raise InputError(f"{path}: no such file; {what} is needed")
    content = decoded(path, what, lambda: reading.read_arrays(path))
    digest = content.pop("digest", None)
    if digest is None:
        raise InputError(f"{path}: not {what}: it has no digest")
    if str(digest) != _digest(content):
        raise InputError(f"{path}: damaged: the digest of its arrays is not the one that was written; write it again")
    return content


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    total = hashlib.sha256()
    for name in sorted(arrays):
        values = np.asarray(arrays[name])
        total.update(f"{name} {values.dtype.str} {values.shape}".encode())
        total.update(values.tobytes())
    return total.hexdigest()


def write(path: str | Path, settings: FilterSettings, model: Model, scales: SignalScales, force: ForceModel,
          state: Mapping[str, ArrayLike]) -> None:
    """Write settings (those that JSON can hold), the model's matrices, and the filter's arrays with the others."""
    plain = {f.name: getattr(settings, f.name) for f in fields(FilterSettings) if f.name not in ARRAYS}
    header = {"schema": SCHEMA, "settings": plain, "dofs": list(model.dofs), "order": model.fit.order,
              "fit_method": model.fit.method, "name": model.name}
    plant = {"M": model.M, "A_inf": model.A_inf, "C": model.C, "D": model.D, "a": model.fit.a, "b": model.fit.b,
             "c": model.fit.c}
    arrays = {**state, **{f"scales_{f.name}": getattr(scales, f.name) for f in fields(SignalScales)},
              **{f"force_{f.name}": getattr(force, f.name) for f in fields(ForceModel)}}
    write_arrays(path, {f"model_{k}": v for k, v in plant.items()} | {f"state_{k}": np.asarray(v)
                                                                      for k, v in arrays.items()}
                 | {"header": np.array(json.dumps(header))})


def read(path: str | Path) -> tuple[dict[str, Any], Model, SignalScales, dict[str, np.ndarray]]:
    """Read the filter's options, its model, its scales and its arrays; InputError if that is not what `write` wrote."""
    content = read_arrays(path, "saved filter")

    def taken_apart() -> tuple[dict[str, Any], Model, SignalScales, dict[str, np.ndarray]]:
        header = json.loads(str(content["header"]))
        if header["schema"] != SCHEMA:
            raise InputError(f"{path}: schema {header['schema']!r} found, {SCHEMA!r} needed")
        part, state = ({key.removeprefix(mark): value for key, value in content.items() if key.startswith(mark)}
                       for mark in ("model_", "state_"))
        dofs, A_inf = tuple(header["dofs"]), part["A_inf"]
        fit = RadiationFit(dofs, part["a"], part["b"], part["c"], header["order"], A_inf=A_inf,
                           method=header["fit_method"])
        model = Model(dofs, part["M"], A_inf, part["C"], fit, D=part["D"], name=header["name"])
        options = {**header["settings"], "entries": [(dofs[j], dofs[k]) for j, k in state["entries"]],
                   "points": dict(zip(state["points"].tolist(), state["points_K"])) or None,
                   "force_model": ForceModel(state["force_A"], state["force_q"], state["force_start"],
                                             str(state["force_name"])),
                   "units": tuple(state["units"].tolist()), "omega": state["omega"]}
        return options, model, SignalScales(*(state[f"scales_{f.name}"] for f in fields(SignalScales))), state

    return decoded(path, "saved filter", taken_apart)
