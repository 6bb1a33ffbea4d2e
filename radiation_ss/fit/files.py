"""Fits on disk: the package's own .json; the forms of other tools are handed to `radiation_ss.export`."""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import write_whole
from radiation_ss.errors import InputError
from radiation_ss.fit.result import RadiationFit
from radiation_ss.reading import decoded, listed, number, numbers, read_json, text, texts, whole_number

SCHEMA = "radiation_ss.fit/1"
FORMS = {".ss": "openfast", ".h5": "bemio", ".mat": "matlab", ".npz": "matlab"}  # of radiation_ss.export.models


def foreign(action: str, suffix: str) -> Callable[..., Any]:
    """Return the reader ("read") or writer ("write") of another tool's form."""
    return getattr(import_module("radiation_ss.export.models"), f"{action}_{FORMS[suffix]}")  # type: ignore[no-any-return]


def write_fit(fit: RadiationFit, path: str | Path) -> Path:
    """Write a fit as the suffix says: .json (own form), .ss (OpenFAST's, the force -K v), .h5 (BEMIO's state_space; an
    existing file keeps all else and must have the density of the fit's data) or .mat (A, B, C).
    """
    target = Path(path)
    if target.suffix == ".json":
        write_whole(target, json.dumps(to_dict(fit), indent=1))
    elif target.suffix in (".ss", ".h5", ".mat"):
        foreign("write", target.suffix)(fit, target)
    else:
        raise InputError(f"{target.name}: unknown form {target.suffix!r} of a fit; use .json, .ss, .h5 or .mat")
    return target


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
        return decoded(source, "radiation model", lambda: foreign("read", source.suffix)(source))
    return read_json(source, "radiation model", from_dict, SCHEMA)


def to_dict(fit: RadiationFit) -> dict[str, Any]:
    """Return a fit as plain numbers and text, ready for JSON."""
    return {"schema": SCHEMA, "dofs": list(fit.dofs), "order": fit.order, "method": fit.method,
            "a": fit.a.tolist(), "b": fit.b.tolist(), "c": fit.c.tolist(),
            "A_inf": None if fit.A_inf is None else fit.A_inf.tolist(),
            "at_zero": fit.at_zero, "points": list(fit.points), "blocks": [list(block) for block in fit.blocks],
            "rho": fit.density, **{name: None if np.isnan(value) else value for name, value in (
                ("relative_error", fit.relative_error), ("whole_error", fit.whole_error))}}


def from_dict(content: dict[str, Any]) -> RadiationFit:
    """Return the fit of `to_dict`; KeyError if a field is missing, InputError if one is of another type."""
    dofs, states = texts(content["dofs"], "dofs"), len(listed(content["a"], "a"))
    n, A_inf = len(dofs), content.get("A_inf")
    relative, whole = (np.nan if content.get(name) is None else number(content[name], name)
                       for name in ("relative_error", "whole_error"))
    at_zero, rho = content.get("at_zero", "free"), content.get("rho")
    return RadiationFit(
        dofs=dofs, order=whole_number(content["order"], "order"), method=text(content["method"], "method"),
        a=numbers(content["a"], "a", (states, states)), b=numbers(content["b"], "b", (states, n)),
        c=numbers(content["c"], "c", (n, states)), A_inf=None if A_inf is None else numbers(A_inf, "A_inf", (n, n)),
        at_zero=at_zero if at_zero in ("free", "zero") else number(at_zero, "at_zero"),
        points=tuple(number(w, "points") for w in listed(content.get("points", []), "points")),
        blocks=tuple(texts(block, "blocks") for block in listed(content.get("blocks", []), "blocks")),
        relative_error=relative, whole_error=whole, rho=None if rho is None else number(rho, "rho"))
