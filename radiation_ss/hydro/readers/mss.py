"""The `vessel` structure of the MSS toolbox (.mat).

Axes forward-starboard-down become forward-port-up: A -> T A T with T = diag(1, -1, -1, 1, -1, -1), a direction beta
becomes -beta. Its frequency 10 rad/s without damping stands for infinity, as MSS's converter from WAMIT writes it.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers.assemble import SIX, assemble, constant

TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
INFINITE = 10.0


def read(path: Path, **given: float) -> HydroData:
    """Read a vessel structure at zero speed.

    Raises
    ------
    InputError
        If the file is not a MATLAB file up to v7, or holds no vessel with freqs, A and B.
    """
    vessel = _vessel(path)
    main = getattr(vessel, "main", None)
    notes: list[str] = []
    rho = constant(path, "rho", _scalar(path, main, "rho"), given, 1000.0, notes)
    g = constant(path, "g", _scalar(path, main, "g"), given, 9.81, notes)
    depth = constant(path, "depth", _scalar(path, main, "depth"), given, np.inf, notes)
    omega = _numbers(path, vessel, "freqs").ravel()
    still = _zero_speed(path, vessel)
    A, B = (_matrices(path, vessel, name, omega.size, still) for name in ("A", "B"))
    rows = omega.copy()
    if omega.size > 1 and omega[-1] == INFINITE and not B[-1].any():
        rows[-1] = np.inf
        notes.append(f"{path}: the row at 10 rad/s has no damping; taken as the limit of infinite frequency")
    fields: dict[str, Any] = {}
    if hasattr(vessel, "MRB"):
        fields["M"] = _turned(_square(path, vessel, "MRB"))
    if hasattr(vessel, "C"):
        fields["C"] = _turned(_matrices(path, vessel, "C", None, still)[0])
    if hasattr(vessel, "Bv"):
        notes.append(f"{path}: viscous damping Bv is left out")
    forces = _forces(path, vessel, rows, still, notes)
    point = _reference(path, vessel, main, notes)
    return assemble(path, rows, _turned(A), _turned(B), SIX, rho=rho, g=g, depth=depth, reference_point=point,
                    notes=notes, **fields, **forces)


def _vessel(path: Path) -> Any:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path, struct_as_record=False, squeeze_me=True)
    except NotImplementedError:
        raise InputError(f"{path}: a MATLAB v7.3 file; save it with save(..., '-v7')") from None
    # What scipy raises for damaged or foreign files.
    except (OSError, ValueError, TypeError, KeyError, IndexError, EOFError, OverflowError, MemoryError,
            MatReadError, zlib.error) as error:
        raise InputError(f"{path}: not a readable MATLAB file ({error})") from None
    vessel = content.get("vessel")
    if not hasattr(vessel, "_fieldnames"):
        names = [name for name in content if not name.startswith("__")]
        raise InputError(f"{path}: no structure 'vessel' of the MSS toolbox in it; it holds {names[:8]}")
    return vessel


def _numbers(path: Path, owner: Any, name: str) -> Any:
    value = np.asarray(getattr(owner, name, None))
    if value.dtype.kind not in "fiu" or value.size == 0:
        raise InputError(f"{path}: vessel.{name} is missing or holds no numbers")
    return value.astype(float)


def _scalar(path: Path, owner: Any, name: str) -> float | None:
    if not hasattr(owner, name):
        return None
    value = _numbers(path, owner, name)
    if value.size != 1:
        raise InputError(f"{path}: vessel.main.{name} has {value.size} values; one is needed")
    return float(value.ravel()[0])


def _square(path: Path, vessel: Any, name: str) -> FloatArray:
    value = _numbers(path, vessel, name)
    if value.shape != (6, 6):
        raise InputError(f"{path}: vessel.{name} has shape {value.shape}; (6, 6) needed")
    return value


def _zero_speed(path: Path, vessel: Any) -> int:
    """Return the index of zero speed among vessel.velocities."""
    if not hasattr(vessel, "velocities"):
        return 0
    speed = _numbers(path, vessel, "velocities").ravel()
    if not (speed == 0.0).any():
        raise InputError(f"{path}: vessel.velocities = {speed[:6]} has no zero speed; only zero speed is supported")
    return int(np.flatnonzero(speed == 0.0)[0])


def _matrices(path: Path, vessel: Any, name: str, frequencies: int | None, still: int) -> FloatArray:
    """Return [frequency, i, j] at zero speed of an array (6, 6, frequency[, speed])."""
    value = _numbers(path, vessel, name)
    if value.ndim == 2:
        value = value[:, :, None]
    if value.ndim == 4:
        if still >= value.shape[3]:
            raise InputError(f"{path}: vessel.{name} has {value.shape[3]} speeds; index {still} is needed")
        value = value[..., still]
    if value.shape[:2] != (6, 6) or value.ndim != 3 or (frequencies is not None and value.shape[2] != frequencies):
        raise InputError(f"{path}: vessel.{name} has shape {value.shape}; (6, 6, {frequencies or 'any'}) needed")
    return np.moveaxis(value, 2, 0)


def _turned(matrix: FloatArray) -> FloatArray:
    return TURN[:, None] * matrix * TURN


def _forces(path: Path, vessel: Any, omega: FloatArray, still: int, notes: list[str]) -> dict[str, Any]:
    """Return X and directions of vessel.forceRAO where its frequencies are those of A and B."""
    rao = getattr(vessel, "forceRAO", None)
    if rao is None or not hasattr(vessel, "headings"):
        return {}
    heading, w = _numbers(path, vessel, "headings").ravel(), _numbers(path, rao, "w").ravel()
    X = np.full((omega.size, heading.size, 6), complex(np.nan, np.nan))
    amplitude, phase = np.atleast_1d(rao.amp), np.atleast_1d(rao.phase)
    if amplitude.shape != (6,) or phase.shape != (6,):
        raise InputError(f"{path}: vessel.forceRAO.amp and .phase must be cells of 6 arrays")
    for i in range(6):
        a, p = (np.asarray(cell[i], dtype=float).reshape(w.size, heading.size, -1)[..., still]
                for cell in (amplitude, phase))
        values = TURN[i] * a * np.exp(1j * p)
        for k, at in enumerate(omega):
            same = np.flatnonzero(np.isclose(w, at, rtol=1e-6, atol=0.0))
            if same.size:
                X[k, :, i] = values[same[0]]
    notes.append(f"{path}: forceRAO phases taken as leads over the wave (as MSS has them from WAMIT)")
    return {"X": X, "directions": -heading}


def _reference(path: Path, vessel: Any, main: Any, notes: list[str]) -> tuple[float, float, float]:
    """Return the point of the rotations: the origin CO on the waterline, or the centre of gravity where it says so."""
    if str(getattr(vessel, "hydrodynamic_reference", "")).strip().upper() == "CG" and hasattr(main, "CG"):
        x, y, z = _numbers(path, main, "CG").ravel()[:3]
        return float(x), -float(y), -float(z)
    notes.append(f"{path}: rotations taken about MSS's origin CO (midships, centreline, waterline)")
    return (0.0, 0.0, 0.0)
