"""The `vessel` structure of the MSS toolbox (.mat).

Axes forward-starboard-down become forward-port-up: A -> T A T with T = diag(1, -1, -1, 1, -1, -1), a direction beta
becomes -beta. Its frequency 10 rad/s without damping stands for infinity, as MSS's converter from WAMIT writes it.
"""

from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, HydroData
from radiation_ss.hydro.readers.assemble import MSS_AXES, USUAL, assemble, constants
from radiation_ss.reading import decoded, read_mat


def read(path: Path, **given: float) -> HydroData:
    """Read a vessel structure at zero speed."""
    content = decoded(path, "MATLAB file", lambda: read_mat(path))
    vessel = content.get("vessel")
    if not isinstance(vessel, dict):
        raise InputError(f"{path}: no structure 'vessel' of the MSS toolbox in it; it holds {list(content)[:8]}")
    main = vessel["main"] if isinstance(vessel.get("main"), dict) else {}
    notes: list[str] = []
    speed = _numbers(path, vessel, "velocities").ravel() if "velocities" in vessel else np.zeros(1)
    if not (speed == 0.0).any():
        raise InputError(f"{path}: vessel.velocities = {speed[:6]} has no zero speed; only zero speed is supported")
    still = int(np.flatnonzero(speed == 0.0)[0])
    if others := ", ".join(f"{v:.4g}" for v in np.delete(speed, still)):
        notes.append(f"{path}: coefficients at zero speed are read, those at {others} m/s left out")
    stated = constants(path, {name: _scalar(path, main, name) for name in USUAL}, given, notes)
    omega = _numbers(path, vessel, "freqs").ravel()
    A, B = (_matrices(path, vessel, name, omega.size, still) for name in ("A", "B"))
    rows = omega.copy()
    if omega.size > 1 and omega[-1] == 10.0 and not B[-1].any():
        rows[-1] = np.inf
        notes.append(f"{path}: the row at 10 rad/s has no damping; taken as the limit of infinite frequency")
    fields: dict[str, Any] = {field: _turned(_matrices(path, vessel, name, None, still)[0])
                              for field, name in (("M", "MRB"), ("C", "C"))
                              if name in vessel}
    if "Bv" in vessel:
        notes.append(f"{path}: viscous damping Bv is left out")
    forces = _forces(path, vessel, rows, still, notes)
    point = (0.0, 0.0, 0.0)
    if str(vessel.get("hydrodynamic_reference", "")).strip().upper() == "CG" and "CG" in main:
        x, y, z = _numbers(path, main, "CG").ravel()[:3]
        point = (float(x), -float(y), -float(z))
    else:
        notes.append(f"{path}: rotations taken about MSS's origin CO (midships, centreline, waterline)")
    return assemble(path, rows, _turned(A), _turned(B), RIGID, reference_point=point, notes=notes,
                    **stated, **fields, **forces)


def _numbers(path: Path, owner: Any, name: str) -> Any:
    value = owner.get(name)
    if not isinstance(value, np.ndarray) or value.dtype.kind != "f" or value.size == 0:
        raise InputError(f"{path}: vessel.{name} is missing or holds no numbers")
    return value


def _scalar(path: Path, owner: Any, name: str) -> float | None:
    if name not in owner:
        return None
    value = _numbers(path, owner, name)
    if value.size != 1:
        raise InputError(f"{path}: vessel.main.{name} has {value.size} values; one is needed")
    return float(value.ravel()[0])


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
    return MSS_AXES[:, None] * matrix * MSS_AXES


def _forces(path: Path, vessel: Any, omega: FloatArray, still: int, notes: list[str]) -> dict[str, Any]:
    """Return X and directions of vessel.forceRAO where its frequencies are those of A and B."""
    rao = vessel.get("forceRAO")
    if not isinstance(rao, dict) or "headings" not in vessel:
        return {}
    heading, w = _numbers(path, vessel, "headings").ravel(), _numbers(path, rao, "w").ravel()
    X = np.full((omega.size, heading.size, 6), complex(np.nan, np.nan))
    for name in ("amp", "phase"):
        if not isinstance(rao.get(name), list) or len(rao[name]) != 6 or any(
                np.shape(cell)[:2] != (w.size, heading.size) or np.ndim(cell) > 3 for cell in rao[name]):
            raise InputError(f"{path}: vessel.forceRAO.{name} must be a cell of 6 arrays, ({w.size}, {heading.size}) "
                             "for each speed")
    same = np.isclose(w, omega[:, None], rtol=1e-6, atol=0.0)
    known, row = same.any(axis=1), same.argmax(axis=1)
    for i in range(6):
        a, p = (rao[name][i].reshape(w.size, heading.size, -1)[..., still] for name in ("amp", "phase"))
        X[known, :, i] = (MSS_AXES[i] * a * np.exp(1j * p))[row[known]]
    notes.append(f"{path}: forceRAO phases taken as leads over the wave (as MSS has them from WAMIT)")
    return {"X": X, "directions": -heading}
