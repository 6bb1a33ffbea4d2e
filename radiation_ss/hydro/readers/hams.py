"""A HAMS run's folder: Input/ControlFile.in and Hydrostatic.in, and the coefficients in Output/Wamit_format.

HAMS writes the same numbers three times; its WAMIT form has the most digits, and only the control file tells what the
first column there is. SI; HAMS computes with 1025 kg/m^3 and 9.80665 m/s^2.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.readers import text, wamit
from radiation_ss.hydro.readers.assemble import SIX
from radiation_ss.hydro.readers.wamit_tables import READINGS

COLUMN = dict(zip((4, 3, 2, 1, 5), READINGS))  # Output_frequency_type
RHO, G = 1025.0, 9.80665


def read(path: Path, **given: float) -> HydroData:
    """Read the folder of a run, or any file within its folders Input and Output.

    Raises
    ------
    InputError
        If the control file or the coefficients are missing, or the reference length is not 1 m.
    """
    root = next((p for p in (path, *path.parents) if (p / "Input" / "ControlFile.in").is_file()), None)
    if root is None:
        raise InputError(f"{path}: no Input/ControlFile.in; a HAMS run's folder is needed")
    control = root / "Input" / "ControlFile.in"
    lines = text.lines(control)
    depth = _entry(control, lines, "Waterdepth", 1)[0]
    kind = int(_entry(control, lines, "Output_frequency_type", 1)[0])
    if kind not in COLUMN or _entry(control, lines, "Reference_body_length", 1)[0] != 1.0:
        raise InputError(f"{control}: Output_frequency_type {kind} must be 1 to 5 and Reference_body_length 1 m")
    found = [path] if is_wamit_form(path) else sorted((root / "Output" / "Wamit_format").glob("*.1"))
    if len(found) != 1:
        raise InputError(f"{root}: {len(found)} files Output/Wamit_format/*.1; one is needed")
    known = {"rho": RHO, "g": G, "depth": depth if depth > 0.0 else np.inf}
    data = wamit.read(found[0], first_column=COLUMN[kind], **{**known, **given})
    point = tuple(_entry(control, lines, "Reference_body_center", 3))
    notes = [note for note in data.notes if "not say about which point" not in note and "not in the file" not in note]
    return data.replace(reference_point=point, source=str(root), notes=tuple(notes), **_matrices(root, data))


def is_wamit_form(path: Path) -> bool:
    """Whether the file is the WAMIT form of a HAMS run, whose control file tells what WAMIT's own does not."""
    return path.parent.name == "Wamit_format" and (path.parents[2] / "Input" / "ControlFile.in").is_file()


def _entry(path: Path, lines: list[str], name: str, count: int) -> list[float]:
    for k, line in enumerate(lines):
        if line.split()[:1] == [name]:
            return text.leading(path, k, line.split(maxsplit=1)[-1], count, name)
    raise InputError(f"{path}: no line {name}")


def _matrices(root: Path, data: HydroData) -> dict[str, FloatArray]:
    """Return M and D of Hydrostatic.in, zero where HAMS computed no motion, and what is added to the stiffness."""
    path = root / "Input" / "Hydrostatic.in"
    if not path.is_file() or data.dofs != SIX:
        return {}
    lines = text.lines(path)
    found = {}
    for k, line in enumerate(lines):
        if line.strip().endswith("Matrix:"):
            rows = [lines[row] if row < len(lines) else "" for row in range(k + 1, k + 8)]
            if rows[6].split() and text.number(rows[6].split()[0]) is not None:
                raise InputError(f"{path}, line {k + 8}: a seventh row of {line.strip()[:40]!r}; 6 are needed")
            name = " ".join(line.split()).replace("External Damping", "External Linear Damping")  # of older versions
            found[name] = np.array([text.row(path, k + 1 + n, row, 6, "6 values") for n, row in enumerate(rows[:6])])
    names = ("Body Mass Matrix:", "External Linear Damping Matrix:", "External Restoring Matrix:")
    lost = [name for name in names if name not in found]
    if lost:
        raise InputError(f"{path}: no heading {lost[0]!r}")
    mass, damping, more = (found[name] for name in names)
    fields = {"M": mass, "D": damping, "C": None if data.C is None else data.C + more}
    return {name: value for name, value in fields.items() if value is not None and value.any()}
