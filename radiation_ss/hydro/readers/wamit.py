"""WAMIT: numeric output .1, .3 (or .2), .hst of one stem, and the formatted .out.

WAMIT has e^{+i w t} and leaves everything without dimension: A / (rho L^k), B / (rho L^k w), X / (rho g L^m),
C / (rho g L^k). The density is in none of its files; gravity, length scale, depth and body axes only in .out.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import RIGID, ROTATIONS, HydroData, mode
from radiation_ss.hydro.measures import horizontal_lead, is_led, is_reversed
from radiation_ss.hydro.readers import text, wamit_out
from radiation_ss.hydro.readers.assemble import assemble, bodies, constant, constants, log, six_dofs
from radiation_ss.hydro.readers.wamit_out import MOST_MODES, Entries, Forces, Header, Radiation, Table, add
from radiation_ss.units import GRAVITY


def read(path: Path, *, length: float | None = None, first_column: str | None = None, **given: float) -> HydroData:
    """Read a WAMIT run from any of its files; options as `read_hydro` has them.

    The files .1, .2, .3, .hst of one stem are read together; an .out beside them gives gravity, length scale, depth and
    body axes. An .out is read alone; its phases are whole degrees.
    """
    if path.is_dir():
        raise InputError(f"{path}: a folder; one of the files of the run is needed")
    plain = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    if plain.suffix.lower() in (".out", ".wamit"):
        return _dimensional(path, *wamit_out.parse_out(path), length, "period", given)
    main, *others = (_sibling(plain, suffix) for suffix in (".1", ".3", ".2", ".hst", ".out"))
    if main is None:
        raise InputError(f"{plain.with_suffix('.1')}: no such file; added mass and damping are in the .1 file")
    diffraction, haskind, hst, out = others
    header = wamit_out.parse_header(out) if out else Header()
    radiation = parse_1(main, header.notes)
    beside = diffraction or haskind
    forces = parse_3(beside, radiation.modes) if beside else None
    header.stiffness = parse_hst(hst, header.notes) if hst else None
    return _dimensional(main, header, radiation, forces, length, first_column, given)


def _sibling(path: Path, suffix: str) -> Path | None:
    places = (path.with_suffix(name) for name in (suffix, suffix.upper(), f"{suffix}.gz", f"{suffix.upper()}.gz"))
    return next((place for place in places if place.exists()), None)


def _dimensional(path: Path, header: Header, radiation: Radiation, forces: Forces | None, length: float | None,
                 first_column: str | None, given: dict[str, float]) -> HydroData:
    notes: list[str] = []
    if "rho" not in given:
        log.warning("%s: WAMIT files do not carry the density; rho = 1000 kg/m^3 assumed (option rho=)", path)
    stated = constants(path, {"g": header.g, "depth": header.depth}, given, notes)
    rho, g, depth = stated.values()
    L = constant(path, "length", header.length, {} if length is None else {"length": length}, 1.0, notes)
    modes, stiffness = radiation.modes, header.stiffness
    names, more = _names(path, modes, len(header.points), 0 if stiffness is None else len(stiffness), L)
    notes += more
    dofs = [names[m - 1] for m in modes]
    turn = np.array([mode(d) in ROTATIONS for d in dofs], dtype=float)
    pair = turn[:, None] + turn[None, :]
    if first_column is None:
        first_column, note = wamit_out.recognise(radiation, g, depth, L)
        if note:
            notes.append(f"{path}: {note}")
            log.warning(notes[-1])
    omega = wamit_out.to_omega(radiation.period, first_column, g, depth, L)
    if first_column not in ("period", "wavelength") and _exchanged(omega, radiation.A):
        omega = np.where(omega == 0.0, np.inf, np.where(np.isinf(omega), 0.0, omega))
        notes.append(f"{path}: a first column 0 taken as infinite frequency and a negative one as zero, which is the "
                     f"rule for periods, not for {first_column}: the added mass there is clearly nearer to the end of "
                     "the band that this gives")
        log.warning(notes[-1])
    finite = np.where(np.isfinite(omega), omega, 0.0)
    A = rho * L ** (3.0 + pair) * radiation.A
    B = rho * L ** (3.0 + pair) * finite[:, None, None] * radiation.B
    fields: dict[str, Any] = {}
    if stiffness is not None:
        pick = np.array(modes) - 1
        if pick.max() < len(stiffness):
            left = [m + 1 for m in range(len(stiffness)) if m not in pick and stiffness[m].any()]
            notes += _left_out(path, "stiffness", left, names)
            fields["C"] = rho * g * L ** (2.0 + pair) * stiffness[np.ix_(pick, pick)]
        elif names[-1] in RIGID or len(stiffness) != 6:
            raise InputError(f"{path}: added mass of mode {max(modes)}, but stiffness of {len(stiffness)} modes")
        else:
            notes.append(f"{path}: stiffness of modes 1 to 6 only; C is left out (the .hst of the run has all of it)")
    if forces is not None:
        notes += _left_out(path, "exciting forces", forces.beyond, names)
        X = rho * g * L ** (2.0 + turn) * forces.X
        fields["X"] = _at_rows(path, omega, wamit_out.to_omega(forces.period, first_column, g, depth, L), X)
        fields["directions"] = np.deg2rad(forces.heading)
    rigid = bodies([name for name in names if mode(name) in RIGID])
    points = dict(zip(rigid, header.points)) if len(header.points) == len(rigid) else None
    return assemble(path, omega, A, B, dofs, points=points, notes=[*notes, *header.notes], **stated, **fields)


def _exchanged(omega: FloatArray, A: FloatArray, clear: float = 3.0) -> bool:
    """Whether the added mass at the limits is `clear` times as near to that at the other end of the band."""
    own = np.einsum("kii->ki", A)
    own = own / np.fmax(np.ptp(own, axis=0), 1e-3 * np.abs(own).max(axis=0) + 1e-300)
    order = np.argsort(omega)
    inside = order[(omega[order] > 0.0) & np.isfinite(omega[order])]
    if not inside.size:
        return False

    def apart(first: int, last: int) -> float:
        return float(np.abs(own[omega == 0.0] - own[first]).sum() + np.abs(own[np.isinf(omega)] - own[last]).sum())

    return clear * apart(inside[-1], inside[0]) < apart(inside[0], inside[-1])


def _left_out(path: Path, what: str, modes: list[int], names: tuple[str, ...]) -> list[str]:
    """Return and log the note on modes that a part of the run has and its added mass has not."""
    each = ", ".join(f"{m} ({names[m - 1]})" if m <= len(names) else str(m) for m in modes)
    notes = [f"{path}: {what} of mode {each} left out: the run has no added mass of it"] * bool(modes)
    for note in notes:
        log.warning(note)
    return notes


def _names(path: Path, modes: list[int], known: int, stiff: int, length: float) -> tuple[tuple[str, ...], list[str]]:
    """Return the names of modes 1 to the last, and notes; `known` bodies (0: no .out tells), `stiff` modes in .hst.

    WAMIT counts the generalised modes of a body (NEWMDS) after its six; those of one body are read.
    """
    last = max(max(modes), stiff)
    ragged = last > 6 and last % 6 > 0 and (stiff == last or modes == list(range(1, last + 1)))
    if last <= 6 * max(1, known) or (known == 0 and not ragged):
        count = max(1, known, -(-last // 6))
        note = f"{path}: modes 7 to {last} taken as those of further bodies, not as generalised modes"
        return six_dofs([""] * count), [note] * (count > max(1, known))
    if known > 1 or (not known and (last > 12 or stiff != last)):
        raise InputError(f"{path}: {last} modes of {known or 'unknown'} bodies: which are generalised cannot be told; "
                         "put the .out and .hst of the run beside it, one body a run, or run WAMIT with NEWMDS = 0")
    if length != 1.0:
        raise InputError(f"{path}: generalised modes with the length scale {length:g} m, whose powers are not known "
                         "for them; run WAMIT with ULEN = 1 or NEWMDS = 0")
    return (*RIGID, *(f"Mode{k}" for k in range(7, last + 1))), [
        f"{path}: modes 7 to {last} are generalised ones, with the units of translations; the file does not say "
        "what shapes they have"]


def _at_rows(path: Path, omega: FloatArray, found: FloatArray, X: Any) -> Any:
    """Bring the forces to the rows of the radiation coefficients, which need the same frequencies; limits have none."""
    inside, same = (omega > 0.0) & np.isfinite(omega), np.isclose(omega[:, None], found, rtol=1e-6, atol=0.0)
    if (same.sum(axis=0) != 1).any() or (same.sum(axis=1) > 1).any() or not same[inside].any(axis=1).all():
        raise InputError(f"{path}: exciting forces at {found.size} frequencies, added mass at {int(inside.sum())}, not "
                         "the same ones; a file is cut off or of another run")
    rows = np.full((omega.size, *X.shape[1:]), complex(np.nan, np.nan))
    rows[same.argmax(axis=0)] = X
    return rows


def parse_1(path: Path, notes: list[str]) -> Radiation:
    """Parse PER I J A [B]; damping is absent in the limits of zero and infinite frequency."""
    table: Table = {}
    k, what = 0, "period, i, j, added mass, damping"
    for k, values in _rows(path, (4, 5), what):
        if len(values) == 4 and values[0] > 0.0:
            raise InputError(f"{path}, line {k + 1}: 4 columns found, 5 needed ({what})")
        add(path, k, table.setdefault(values[0], {}), values[1:3], (*values[3:], 0.0)[:2])
    _drop_empty_limit(path, table, notes)
    return wamit_out.matrices(path, table, k)


def _drop_empty_limit(path: Path, table: Table, notes: list[str]) -> None:
    """Leave out a limit without added mass; refuse WAMIT's impulse responses, which begin at time 0 with zeros."""
    column = np.array(sorted(value for value in table if value >= 0.0))
    if column.size < 3 or column[0] > 0.0 or any(a for a, _ in table[0.0].values()):
        return
    if np.allclose(np.diff(column), column[1], rtol=1e-3):
        raise InputError(f"{path}: the first column is 0 with zeros, then equal steps of {column[1]:g}: impulse "
                         "responses over time (F2T), not added mass and damping over periods")
    del table[0.0]
    notes.append(f"{path}: the added mass at first column 0 is zero in every entry: taken as absent")


def parse_3(path: Path, modes: list[int], apart: float = 0.05, faint: float = 1e-6) -> Forces:
    """Parse PER BETA I MOD PHASE RE IM; both forms of a force differ by `apart` at most (whole degrees: .9 %).

    WAMIT prints +-90 deg for what is zero by symmetry, whatever the noise of its parts. Forces, or moments, below
    `faint` of the largest one are not compared: the seventh digit printed of that one is as large.
    """
    table: Table = {}
    largest = {False: 0.0, True: 0.0}  # of the forces, of the moments
    contrary = []
    for k, values in _rows(path, 7, "period, heading, i, modulus, phase, real, imaginary part"):
        X, polar = complex(values[5], values[6]), values[3] * np.exp(1j * np.deg2rad(values[4]))
        add(path, k, table.setdefault((values[0], values[1]), {}), values[2:3], X)
        moment, size = (values[2] - 1.0) % 6.0 >= 3.0, max(abs(X), values[3])
        largest[moment] = max(largest[moment], size)
        if abs(X - polar) > apart * size:
            contrary.append((k, moment, size, f"{X:g}, are not those of modulus {values[3]:g} and phase {values[4]:g}"))
    for k, moment, size, forms in contrary:
        if size > faint * largest[moment]:
            raise InputError(f"{path}, line {k + 1}: real and imaginary part, {forms} deg")
    return wamit_out.force_array(path, table, modes)


def parse_hst(path: Path, notes: list[str]) -> FloatArray:
    """Parse I J C into a matrix; a file holds all entries of its modes. Rows that repeat are noted."""
    found: Entries = {}
    for k, values in _rows(path, 3, "i, j, stiffness"):
        i, j = (text.index(path, k, value, MOST_MODES, "mode") for value in values[:2])
        if found.get((i, j), values[2]) != values[2]:
            raise InputError(f"{path}, line {k + 1}: modes {i}, {j} are there twice, with different stiffness")
        if (i, j) in found:
            notes.append(f"{path}, line {k + 1}: modes {i}, {j} are there twice, with the same stiffness")
        found[i, j] = values[2]
    size = max((i for at in found for i in at), default=0)
    if size < 6 or len(found) != size ** 2:
        raise InputError(f"{path}: {len(found)} entries of the stiffness up to mode {size}; all {max(size, 6) ** 2} of "
                         f"{max(size, 6)} modes are needed: the file is cut off")
    return np.array([found[at] for at in sorted(found)]).reshape(size, size)


def _rows(path: Path, columns: int | tuple[int, ...], what: str) -> Iterator[tuple[int, list[float]]]:
    """Yield number and values of the lines with content; a first line of words is WAMIT's header."""
    rows = [(k, line) for k, line in enumerate(text.lines(path)) if line.strip()]
    header = bool(rows) and text.number(rows[0][1].split()[0]) is None
    yield from ((k, text.row(path, k, line, columns, what)) for k, line in rows[header:])


COLUMN = dict(zip((4, 3, 2, 1, 5), wamit_out.READINGS))  # Output_frequency_type


def read_hams(path: Path, **given: float) -> HydroData:
    """Read the folder of a run, or any file within its folders Input and Output."""
    root = next((p for p in (path, *path.parents) if (p / "Input" / "ControlFile.in").is_file()), None)
    if root is None:
        raise InputError(f"{path}: no Input/ControlFile.in; a HAMS run's folder is needed")
    control = root / "Input" / "ControlFile.in"
    lines = text.lines(control)
    depth = _entry(control, lines, "Waterdepth", 1)[0]
    kind = int(_entry(control, lines, "Output_frequency_type", 1)[0])
    if kind not in COLUMN:
        raise InputError(f"{control}: Output_frequency_type {kind} found; 1 to 5 are needed")
    found = [path] if is_wamit_form(path) else sorted((root / "Output" / "Wamit_format").glob("*.1"))
    if len(found) != 1:
        raise InputError(f"{root}: {len(found)} files Output/Wamit_format/*.1; one is needed")
    known = {"rho": 1025.0, "g": GRAVITY, "depth": depth if depth > 0.0 else np.inf}
    data = read(found[0], first_column=COLUMN[kind], **{**known, **given})
    point = tuple(_entry(control, lines, "Reference_body_center", 3))
    notes = [note for note in data.notes if "not say about which point" not in note and "not in the file" not in note]
    beside = sorted(file for file in found[0].parent.iterdir() if file.suffix in (".3", ".hst"))
    notes += [f"{root}: {file.name} is not read: {file.with_name(found[0].stem + file.suffix).name} would be"
              for file in beside if file.stem != found[0].stem]
    lead = horizontal_lead(data.X, data.C, data.dofs, data.directions)
    if data.X is not None and (lead is None or not (is_led(lead) or is_reversed(lead))):
        notes.append(f"{root}: no waves long enough to tell by X whether it is of e^(+iwt), as it is taken; HAMS of "
                     "December 2021 to March 2023 wrote e^(-iwt): of such a run take data.replace(X=data.X.conj())")
        log.warning(notes[-1])
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
    if not path.is_file() or data.dofs != RIGID:
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
    if lost := [name for name in names if name not in found]:
        raise InputError(f"{path}: no heading {lost[0]!r}")
    mass, damping, more = (found[name] for name in names)
    fields = {"M": mass, "D": damping, "C": None if data.C is None else data.C + more}
    return {name: value for name, value in fields.items() if value is not None and value.any()}
