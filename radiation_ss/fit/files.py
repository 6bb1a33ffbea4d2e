"""Fits on disk: the package's own .json; the forms of other tools are handed to `radiation_ss.export`."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit

SCHEMA = "radiation_ss.fit/1"
FORMS = {".ss": "openfast", ".h5": "bemio", ".mat": "matlab", ".npz": "matlab"}
"""Suffix -> module of radiation_ss.export with read_<module> and write_<module>; loaded where it is asked for."""


def foreign(action: str, suffix: str) -> Callable[..., Any]:
    """Return the reader ("read") or writer ("write") of another tool's form."""
    module = import_module(f"radiation_ss.export.{FORMS[suffix]}")
    return getattr(module, f"{action}_{FORMS[suffix]}")  # type: ignore[no-any-return]


def write_fit(fit: RadiationFit, path: str | Path) -> Path:
    """Write a fit; the suffix says how.

    Parameters
    ----------
    fit : RadiationFit
    path : path
        .json (this package's own form), .ss (OpenFAST, HydroDyn's state-space radiation: the force -K v), .h5 (BEMIO's
        state_space groups; an existing file keeps all else, and must have the density of the fit's data) or .mat (A,
        B, C).

    Raises
    ------
    InputError
        If the suffix is unknown.
    """
    target = Path(path)
    if target.suffix == ".json":
        write_json(fit, target)
    elif target.suffix in (".ss", ".h5", ".mat"):
        foreign("write", target.suffix)(fit, target)
    else:
        raise InputError(f"{target.name}: unknown form {target.suffix!r} of a fit; use .json, .ss, .h5 or .mat")
    return target


def write_json(fit: RadiationFit, path: Path) -> None:
    """Write the package's own form."""
    path.write_text(json.dumps(to_dict(fit), indent=1), encoding="utf-8")


def read_fit(path: str | Path) -> RadiationFit:
    """Read a radiation model: .json, OpenFAST .ss, BEMIO .h5, .mat or .npz (this package's, or MSS's Ar, Br, Cr).

    Parameters
    ----------
    path : path

    Raises
    ------
    InputError
        If the file is absent, of another form, or lacks a field.

    Examples
    --------
    >>> import numpy as np, radiation_ss as rss
    >>> fit = rss.RadiationFit(("Heave",), [[-8.0, -60.0], [1.0, 0.0]], [[400.0], [0.0]], [[1.0, 0.0]], 2)
    >>> path = fit.write("heave.json")
    >>> bool(np.array_equal(rss.read_fit(path).a, fit.a))
    True
    """
    source = Path(path)
    if source.suffix != ".json":
        if source.suffix not in FORMS:
            raise InputError(f"{source.name}: unknown form {source.suffix!r} of a radiation model; "
                             f"use .json, {', '.join(FORMS)}")
        if not source.is_file():
            raise InputError(f"{source}: cannot be read (no such file)")
        found: RadiationFit = foreign("read", source.suffix)(source)
        return found
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
