"""HydroStar's .rao files in one folder: AddedMass_ij, WaveDamping_ij, Excitation_i, each with its own head. SI.

Phases are taken as leads over the wave at the reference point of the head, as HAMS writes this form.
"""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import assemble, constants, delay

CONSTANTS = {"rho": "Water density (rho)", "g": "Gravity acceleration", "depth": "Waterdepth"}  # in the head


class RaoTable(NamedTuple):
    """One file: head by names, frequencies [rad/s] (-1 is infinity), headings [deg], values [frequency, heading]."""

    head: dict[str, str]
    omega: FloatArray
    heading: FloatArray
    values: ComplexArray


def read(path: Path, **given: float) -> HydroData:
    """Read all .rao files of a folder, which is named itself or by one of them."""
    folder = path if path.is_dir() else path.parent
    first = _table(folder / "AddedMass_11.rao")
    A, B = (np.stack([[_same(folder, first, f"{name}_{i}{j}.rao").values[:, 0].real for j in range(1, 7)]
                      for i in range(1, 7)]) for name in ("AddedMass", "WaveDamping"))
    notes = [f"{folder}: phases of the exciting force taken as leads (as HAMS writes this form)"]
    endless = first.head.get("Waterdepth", "").lower().startswith("inf")
    stated = constants(folder, {field: np.inf if field == "depth" and endless else
                                _numbers(folder, first.head, name, 1)[0] for field, name in CONSTANTS.items()},
                       given, notes)
    point = _numbers(folder, first.head, "Reference point of body 1", 3)
    omega = np.where(first.omega < 0.0, np.inf, first.omega)
    fields: dict[str, Any] = {}
    if (folder / "Excitation_1.rao").is_file():
        tables = [_same(folder, first, f"Excitation_{i}.rao") for i in range(1, 7)]
        fields["directions"] = angle = np.deg2rad(tables[0].heading)
        lag = delay(omega, angle, _numbers(folder, tables[0].head, "Ref.pt incident wave", 2), stated["g"],
                    stated["depth"])
        fields["X"] = np.stack([t.values for t in tables], axis=-1) * lag[:, :, None]
    return assemble(folder, omega, A.transpose(2, 0, 1), B.transpose(2, 0, 1), RIGID, notes=notes,
                    reference_point=tuple(point), **stated, **fields)


def _same(folder: Path, first: RaoTable, name: str) -> RaoTable:
    """Return the table of a file whose head, frequencies and headings are those of the first."""
    table = _table(folder / name)
    kind, component = name.removesuffix(".rao").split("_")
    skip = ("File", "RAOTYPE", "COMPONENT", "UNIT", "MEANVALUE", "Project", "User")
    if (not np.array_equal(table.omega, first.omega) or not np.array_equal(table.heading, first.heading)
            or any(table.head.get(key) != value for key, value in first.head.items() if key not in skip)
            or table.head.get("RAOTYPE") != kind
            or (kind != "Excitation" and table.head.get("COMPONENT") != component)):
        raise InputError(f"{folder / name}: its head, frequencies or headings are not those of AddedMass_11.rao")
    return table


def _table(path: Path) -> RaoTable:
    if not path.is_file():
        raise InputError(f"{path}: missing; the folder of HydroStar's AddedMass_ij.rao, WaveDamping_ij.rao is needed")
    head: dict[str, str] = {}
    heading: list[float] = []
    rows = []
    for k, line in enumerate(text.lines(path)):
        if line.startswith("#HEADING"):
            heading = text.row(path, k, line[8:], range(1, 1000), "headings [deg]")
        elif line.startswith("#"):
            name, colon, value = line[1:].partition(":")
            if colon:
                head[" ".join(name.split())] = " ".join(value.split())
            elif line.startswith("#NBHEADING"):
                head["NBHEADING"] = line[10:].strip()
        elif line.strip():
            count = len(heading)
            limit = line.split()[0].startswith("-")  # HAMS prints NaN for the force of the infinite frequency
            rows.append(text.row(path, k, line.replace("NaN", "0.0") if limit else line, (1 + count, 1 + 2 * count),
                                 f"frequency, then amplitude and phase for {count} headings"))
    if not rows or not heading or head.get("NBHEADING") != str(len(heading)) or len({len(r) for r in rows}) > 1:
        raise InputError(f"{path}: no #HEADING, another number of them than NBHEADING says, or rows of unequal length")
    if any(float(v) for v in re.findall(r"[\d.]+", head.get("Forward speed", ""))):
        raise InputError(f"{path}: forward speed {head['Forward speed']}; only zero speed is supported")
    if re.match(r"(k|M)N|t\b", head.get("UNIT", "")):
        raise InputError(f"{path}: unit {head['UNIT']}; kg, N, m and s are read")
    values = np.array(rows)
    count = len(heading)
    phase = np.deg2rad(values[:, 1 + count:]) if values.shape[1] > 1 + count else 0.0
    return RaoTable(head, values[:, 0], np.array(heading), values[:, 1:1 + count] * np.exp(1j * phase))


def _numbers(path: Path, head: dict[str, str], name: str, count: int) -> list[float]:
    found = [text.number(word) for word in head.get(name, "").strip("() ").replace(",", " ").split()[:count]]
    values = [value for value in found if value is not None]
    if len(values) != count:
        raise InputError(f"{path}: head: {name}: {count} numbers needed, found {head.get(name, '')!r}")
    return values
