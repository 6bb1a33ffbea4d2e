"""OpenFAST .ss: HydroDyn's state-space radiation (RdtnMod = 2).

HydroDyn integrates x' = A x + B v with the body velocities v and adds y = C x to the loads on the body
(SS_Radiation.f90). The file therefore holds the radiation force itself, y = -K v, the opposite of this package's sign:
C changes sign on the way in and out. All six degrees of freedom of a body must be enabled in the file, because
HydroDyn asks for all of them; one without radiation has zero columns.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.atomic import write_whole
from radiation_ss.errors import InputError
from radiation_ss.export.places import six_names, six_places
from radiation_ss.fit.result import RadiationFit
from radiation_ss.hydro.readers.text import head_and_rows, index, leading, row


def write_openfast(fit: RadiationFit, path: Path) -> None:
    """Write HydroDyn's state-space radiation: six columns for each body, and the force -K v as output."""
    places, bodies = six_places(fit.dofs, path)
    N, n = fit.states, 6 * len(bodies)
    b, c = np.zeros((N, n)), np.zeros((n, N))
    b[:, places], c[places] = fit.b, -fit.c
    owned = np.bincount(np.abs(c).argmax(axis=0), minlength=n)
    lines = ["radiation_ss: state-space radiation model, y = C x is the force on the body",
             f"{_row(np.ones(n))}    %Enabled DoFs", f"{N}    %Radiation states",
             f"{_row(owned)}    %Radiation states per DoF"]
    lines += [" ".join(f"{value:.16e}" for value in row) for matrix in (fit.a, b, c) for row in matrix]
    write_whole(path, "\n".join(lines) + "\n")


def _row(values: ArrayLike) -> str:
    return " ".join(str(int(value)) for value in np.asarray(values))


def read_openfast(path: Path) -> RadiationFit:
    """Read HydroDyn's .ss as K = -C (s I - A)^-1 B.

    Degrees of freedom that are not enabled, or whose column of B and row of C are zero, are left out.

    Raises
    ------
    InputError
        If the numbers of rows or columns do not fit the header, or all of B or C is zero.
    """
    head, rows = head_and_rows(path, 4, "an OpenFAST .ss file")
    enabled = row(path, 1, head[1].split("%")[0], None, "enabled degrees of freedom")
    N = index(path, 2, leading(path, 2, head[2].split("%")[0], 1, "radiation states")[0], 10_000, "number of states")
    n = len(enabled)
    shape = [len(row) for row in rows]
    if n % 6 or n == 0 or shape != [N] * N + [n] * N + [N] * n:
        raise InputError(f"{path.name}: {len(rows)} rows of numbers; {N} states and {n} degrees of freedom need "
                         f"{N} rows of {N}, {N} rows of {n}, {n} rows of {N}")
    names = six_names([f"body{k + 1}" for k in range(n // 6)])
    b, c = np.reshape(rows[N:2 * N], (N, n)), np.reshape(rows[2 * N:], (n, N))
    keep = [k for k in range(n) if enabled[k] and (b[:, k].any() or c[k].any())]
    if not keep:
        raise InputError(f"{path.name}: no enabled degree of freedom has a column of B or a row of C other than zero")
    return RadiationFit(tuple(names[k] for k in keep), np.reshape(rows[:N], (N, N)), b[:, keep], -c[keep], order=N,
                        method=f"read from {path.name}")
