"""Fits on disk: the package's own .json, and what other tools read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.fit import exchange
from radiation_ss.fit.result import RadiationFit

SCHEMA = "radiation_ss.fit/1"


def write_fit(fit: RadiationFit, path: str | Path) -> Path:
    """Write a fit; the suffix says how.

    Parameters
    ----------
    fit : RadiationFit
    path : path
        .json (this package's own form), .ss (OpenFAST, HydroDyn's state-space radiation), .h5 (BEMIO's state_space
        groups; an existing file keeps all else, and must have the density of the fit's data) or .mat (A, B, C).

    Raises
    ------
    InputError
        If the suffix is unknown.
    """
    target = Path(path)
    writers = {".json": write_json, ".ss": exchange.write_openfast, ".h5": exchange.write_bemio,
               ".mat": exchange.write_matlab}
    if target.suffix not in writers:
        raise InputError(f"{target.name}: unknown form {target.suffix!r} of a fit; use one of {', '.join(writers)}")
    writers[target.suffix](fit, target)
    return target


def write_json(fit: RadiationFit, path: Path) -> None:
    """Write the package's own form."""
    path.write_text(json.dumps(to_dict(fit), indent=1), encoding="utf-8")


def read_fit(path: str | Path) -> RadiationFit:
    """Read a radiation model: .json, OpenFAST .ss, BEMIO .h5, .mat or .npz (this package's, or MSS's Ar, Br, Cr).

    Parameters
    ----------
    path : path
        A .json of the package.

    Raises
    ------
    InputError
        If the file is absent, of another form, or lacks a field.
    """
    source = Path(path)
    if source.suffix != ".json":
        readers = {".ss": exchange.read_openfast, ".h5": exchange.read_bemio, ".mat": exchange.read_matlab,
                   ".npz": exchange.read_matlab}
        if source.suffix not in readers:
            raise InputError(f"{source.name}: unknown form {source.suffix!r} of a radiation model; "
                             f"use .json, {', '.join(readers)}")
        if not source.is_file():
            raise InputError(f"{source}: cannot be read (no such file)")
        return readers[source.suffix](source)
    try:
        content = json.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{source}: cannot be read ({error.strerror})") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{source.name}: not a JSON file ({error})") from None
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(f"{source.name}: field 'schema' must be {SCHEMA!r}")
    try:
        return from_dict(content)
    except KeyError as error:
        raise InputError(f"{source.name}: field {error} is missing") from None


def to_dict(fit: RadiationFit) -> dict[str, Any]:
    """Return a fit as plain numbers and text, ready for JSON."""
    return {"schema": SCHEMA, "dofs": list(fit.dofs), "order": fit.order, "method": fit.method,
            "a": fit.a.tolist(), "b": fit.b.tolist(), "c": fit.c.tolist(),
            "A_inf": None if fit.A_inf is None else fit.A_inf.tolist(),
            "at_zero": fit.at_zero, "points": list(fit.points), "blocks": [list(block) for block in fit.blocks],
            "relative_error": None if np.isnan(fit.relative_error) else fit.relative_error}


def from_dict(content: dict[str, Any]) -> RadiationFit:
    """Return the fit of `to_dict`; KeyError if a field is missing."""
    n, states, error = len(content["dofs"]), len(content["a"]), content.get("relative_error")
    return RadiationFit(
        dofs=tuple(content["dofs"]), order=int(content["order"]), method=str(content["method"]),
        a=np.reshape(content["a"], (states, states)), b=np.reshape(content["b"], (states, n)),
        c=np.reshape(content["c"], (n, states)), A_inf=content.get("A_inf"),
        at_zero=content.get("at_zero", "free"), points=tuple(content.get("points", ())),
        blocks=tuple(tuple(block) for block in content.get("blocks", ())),
        relative_error=np.nan if error is None else float(error))
