"""A vessel type of OrcaFlex's .yml, which OrcaWave exports too: units, signs and phases as the file says.

Source: OrcaFlex help, "Vessel types: conventions" and "Stiffness, added mass and damping". In the system SI of OrcaFlex
masses are tonnes and forces kN. Load RAOs are complex per metre of amplitude about `RAOOrigin`.
"""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.errors import InputError
from radiation_ss.hydro.clean import rigid_inertia
from radiation_ss.hydro.data import RIGID, HydroData
from radiation_ss.hydro.readers import text
from radiation_ss.hydro.readers.assemble import assemble, constant, delay, log
from radiation_ss.units import FORCE, GRAVITY, LENGTH

MASS = {"kg": 1.0, "te": 1000.0, "lb": 0.45359237, "kips": 453.59237, "slug": 14.593903}
POSITIVE = {"SurgePositive": ("forward", "aft"), "SwayPositive": ("port", "starboard"), "HeavePositive": ("up", "down"),
            "RollPositiveStarboard": ("down", "up"), "PitchPositiveBow": ("down", "up"),
            "YawPositiveBow": ("port", "starboard")}  # ours and the other
WAVES = {"frequency (rad/s)": lambda x: x, "frequency (Hz)": lambda x: 2.0 * np.pi * x,
         "period (s)": lambda x: 2.0 * np.pi / x}
# The up-crossing is a quarter period before the crest: what leads it leads the crest by that much more.
MEANS = {"RAOPhaseConvention": {"leads": 1.0, "lags": -1.0},
         "RAOPhaseUnitsConvention": {"degrees": np.pi / 180.0, "radians": 1.0},
         "RAOPhaseRelativeToConvention": {"crest": 0.0, "trough": np.pi, "zero up-crossing": np.pi / 2.0,
                                          "zero down-crossing": -np.pi / 2.0},
         "RAOWaveUnit": {"amplitude": 1.0, "double amplitude": 2.0}}
GROUPS = "MultibodyGroups"
RAO_COLUMNS = 13  # period or frequency, then amplitude and phase of six modes
Tree = dict[str, Any]
Line = tuple[int, int, str]  # number, indentation, content


def read(path: Path, *, vessel: str | None = None, draught: str | None = None, **given: float) -> HydroData:
    """Read the vessel type and draught with frequency-dependent added mass and damping, of several the one named."""
    file = _Tree(path)
    kind, state = file.vessel(vessel, draught)
    general, sea = file.top("General"), file.top("Environment")
    si = general.get("UnitsSystem") == "SI"
    length, mass, force = (file.unit(general, key, table, default, si) for key, table, default in (
        ("LengthUnits", {**LENGTH, "km": 1000.0}, "m"), ("MassUnits", MASS, "te"),
        ("ForceUnits", {**FORCE, "kip": 1000.0 * FORCE["lbf"], "tef": FORCE["tf"]}, "kN")))
    notes: list[str] = []
    depth = given.get("depth", length * file.number(sea, "WaterDepth"))
    if "depth" not in given and depth < np.inf:
        notes.append(f"{path}: depth {depth:g} m is the model's; the coefficients may be of another (option depth=)")
    rho = constant(path, "rho", mass / length ** 3 * file.number(sea, "Density"), given, 1000.0, notes)
    g = constant(path, "g", length * file.number(general, "g") if "g" in general else GRAVITY, given, GRAVITY, notes)
    power = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    scale = length ** (power[:, None] + power)  # a rotation brings in a length each
    if GROUPS in file.sections:
        notes.append(f"{path}: {GROUPS} (from line {file.sections[GROUPS] + 1}) are not read: A, B and C are those of "
                     f"vessel type {str(kind.get('Name'))[:40]} alone, without other bodies beside it")
        log.warning(notes[-1])
    if (method := str(state.get("AMDMethod", "Frequency dependent"))) != "Frequency dependent":
        notes.append(f"{path}: AMDMethod is {method[:40]!r}: OrcaFlex uses the frequency-dependent added mass "
                     "and damping, which are read here, only where it is 'Frequency dependent'")
        log.warning(notes[-1])
    rows = state["FrequencyDependentAddedMassAndDamping"]
    omega = file.omega(kind, [file.number(row, "AMDPeriodOrFrequency") for row in rows])
    # Damping is a force over a velocity: where the units of the file do not cohere, that is no mass per second.
    A, B = (np.array([file.table(row, name, (6, 6)) for row in rows]) * scale * unit
            for name, unit in (("AddedMassMatrix", mass), ("Damping", force / length)))
    C = np.zeros((6, 6))
    C[2:5, 2:5] = file.table(state, "HydrostaticStiffness", (3, 3)) * force / length * scale[2:5, 2:5]
    origin = length * file.table(state, "ReferenceOrigin", (3,))
    datum, heel, trim = file.table(state, "ReferenceOriginDatumPosition", (3,))  # Z and two angles
    if heel or trim:
        raise InputError(f"{path}: ReferenceOriginDatumPosition: heel {heel:g} and trim {trim:g}; 0 needed")
    point = np.array([*origin[:2], length * datum])
    fields: dict[str, Any] = {"M": _mass(file, state, mass, length, origin), "C": C}
    if "LoadRAOs" in state and state["LoadRAOs"].get("RAOs"):
        raos = state["LoadRAOs"]
        X, angle = _forces(file, kind, raos, omega, force / length * length ** power)
        about = file.table(raos, "RAOOrigin", (3,))
        left_out = set(str(raos.get("PhaseOrigin"))) <= set("[~, ]")
        phase = about if left_out else file.table(raos, "PhaseOrigin", (3,))
        if np.allclose(length * about, origin):
            fields |= {"X": X * delay(omega, angle, (length * phase).tolist(), g, depth)[:, :, None],
                       "directions": angle}
        else:
            notes.append(f"{path}: load RAOs are about another point than the added mass; X is left out")
    return assemble(path, omega, A, B, RIGID, rho=rho, g=g, depth=depth, notes=notes,
                    reference_point=tuple(point.tolist()), **fields)


def _mass(file: "_Tree", draught: Tree, mass: float, length: float, origin: FloatArray) -> FloatArray:
    """Return the mass matrix about the reference origin; the tensor of the file is about the centre of mass."""
    m = mass * file.number(draught, "Mass")
    inertia = mass * length ** 2 * file.table(draught, "MomentOfInertiaTensor", (3, 3))
    centre = "CentreOfMass" if "CentreOfMass" in draught else "CentreOfGravity"  # the name in older versions
    return rigid_inertia(m, inertia, length * file.table(draught, centre, (3,)) - origin)


def _forces(file: "_Tree", vessel: Tree, raos: Tree, omega: FloatArray,
            scale: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Return X [frequency, direction, i] on the rows of the added mass, and directions [rad]."""
    says = {key: str(vessel.get(key)) for key in (*MEANS, *POSITIVE)}
    if strange := {key: word for key, word in says.items() if word not in {**MEANS, **POSITIVE}[key]}:
        raise InputError(f"{file.path}: conventions of the load RAOs {strange} not known")
    lead, unit, turn, factor = (means[says[key]] for key, means in MEANS.items())
    sign = np.array([1.0 if says[key] == ours else -1.0 for key, (ours, _) in POSITIVE.items()])
    X: ComplexArray = np.full((omega.size, len(raos["RAOs"]), 6), complex(np.nan, np.nan))
    for h, rao in enumerate(raos["RAOs"]):
        rows = file.table(rao, "RAOPeriodOrFrequency", (None, RAO_COLUMNS), limits=True)
        for w, row in zip(file.omega(vessel, rows[:, 0]), rows):
            if w in (0.0, np.inf):
                continue
            at = np.flatnonzero(np.isclose(omega, w, rtol=1e-6, atol=0.0))
            if at.size != 1:
                raise InputError(f"{file.path}: a load RAO at {w:g} rad/s, where there is no added mass")
            X[at[0], h] = row[1::2] * scale * sign * np.exp(1j * (unit * row[2::2] * lead + turn))
    if np.isnan(X[(omega > 0.0) & np.isfinite(omega)]).any():
        raise InputError(f"{file.path}: the load RAOs lack a frequency of the added mass")
    X *= factor
    return X, np.deg2rad(np.array([file.number(rao, "RAODirection") for rao in raos["RAOs"]]))


class _Tree:
    """The part of YAML that OrcaFlex writes: mappings and lists by indentation, lists of numbers in brackets."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.sections: dict[str, int] = {}
        found: list[Line] = []
        inside, section = False, ""
        for k, line in enumerate(text.lines(path)):
            content = " ".join(line.split())
            if not content or content.startswith(("#", "%", "---", "...")):
                continue
            if line[0].isalpha() and not inside:
                section = content
                self.sections[content.removesuffix(":")] = k
            if section not in ("General:", "Environment:", "VesselTypes:"):
                continue
            if inside:
                number, indent, begun = found.pop()
                content = f"{begun} {content}"
            else:
                number, indent = k, len(line) - len(line.lstrip())
            inside = content.count("[") > content.count("]")
            found.append((number, indent, content))
        self.root = self._node(found)

    def _node(self, lines: list[Line]) -> Any:
        """Return what some lines hold: None, a list of one line below its name, a list of lines, or a mapping."""
        if not lines or (len(lines) == 1 and lines[0][2].startswith("[")):
            return lines[0][2] if lines else None
        items: list[Any] = []
        tree: Tree = {}
        starts = [k for k, line in enumerate(lines) if line[1] <= lines[0][1]]
        for start, end in pairwise([*starts, len(lines)]):
            (number, indent, content), below = lines[start], lines[start + 1:end]
            item, inner = content.startswith("- "), content.removeprefix("- ")
            key, colon, value = (inner + " ").partition(": ")
            if item and colon and not inner.startswith("["):  # a mapping, its first entry beside the dash
                value, below = "", [(number, indent + 2, inner), *below]
            elif item:
                value = inner
            elif not colon or key in tree:
                raise InputError(f"{self.path}, line {number + 1}: 'name: value' needed, each once, found "
                                 f"{content[:60]!r}")
            if indent < lines[0][1] or (tree if item else items) or (below and value.strip()):
                raise InputError(f"{self.path}, line {(below or lines[start:])[0][0] + 1}: wrong indentation")
            held = value.strip() or self._node(below)
            if item:
                items.append(held)
            else:
                tree[key] = held
        return items or tree

    def top(self, name: str) -> Tree:
        found = self.root.get(name) if isinstance(self.root, dict) else None
        if not isinstance(found, dict):
            raise InputError(f"{self.path}: section {name} is missing; a .yml of OrcaFlex is needed")
        return found

    def vessel(self, vessel: str | None, draught: str | None) -> tuple[Tree, Tree]:
        """Return the vessel type and its draught that hold added mass, of several those with the names."""
        types: Any = self.root.get("VesselTypes") if isinstance(self.root, dict) else None
        name = "FrequencyDependentAddedMassAndDamping"
        found = [(kind, state) for kind in types or [] if isinstance(kind, dict) and vessel in (None, kind.get("Name"))
                 for state in kind.get("Draughts") or []
                 if isinstance(state, dict) and draught in (None, state.get("Name"))
                 and isinstance(rows := state.get(name), list) and all(isinstance(row, dict) for row in rows)]
        if len(found) == 1:
            return found[0]
        if found:
            kinds, states = ([str(one.get("Name"))[:40] for one in part[:8]] for part in zip(*found))
            one, names = ("vessel", kinds) if len({*kinds}) > 1 else ("draught", states)
            raise InputError(f"{self.path}: {len(found)} {one}s with {name} ({', '.join(names)}); give {one}= one of "
                             "the names")
        asked = "".join(f" {one!r}" for one in (vessel, draught) if one)
        raise InputError(f"{self.path}: no vessel type{asked} with {name}; " + (
            f"{GROUPS} (line {self.sections[GROUPS] + 1}) hold those of bodies beside each other, which are not read: "
            "export a run of one body" if GROUPS in self.sections else
            "one is needed (the results that OrcaWave exports, not its input)"))

    def number(self, tree: Tree, key: str) -> float:
        value = str(tree.get(key))
        if value == "Infinity":
            return np.inf
        if (found := text.number(value)) is None:
            raise InputError(f"{self.path}: {key}: a number is needed, found {value[:60]!r}")
        return found

    def unit(self, tree: Tree, key: str, table: dict[str, float], default: str, si: bool) -> float:
        name = default if si else str(tree.get(key))
        if name not in table:
            raise InputError(f"{self.path}: {key}: {name[:40]!r} is none of {list(table)}")
        return table[name]

    def omega(self, vessel: Tree, values: Any) -> FloatArray:
        """Return rad/s of `values`, frequencies or periods as the vessel type says."""
        says = str(vessel.get("WavesReferredToBy"))
        if says not in WAVES:
            raise InputError(f"{self.path}: WavesReferredToBy: {says[:40]!r} is none of {list(WAVES)}")
        with np.errstate(divide="ignore"):
            return np.asarray(WAVES[says](np.asarray(values, dtype=float)))

    def table(self, tree: Tree, start: str, shape: tuple[int | None, ...], limits: bool = False) -> FloatArray:
        """Return the numbers of the entry whose name begins with `start`; with `limits` Infinity may begin a row."""
        key = next((key for key in tree if key == start or (key.startswith(start) and "," in key)), "")
        value = tree.get(key)
        lines: list[Any] = value if isinstance(value, list) else [value]
        array = np.full(0, np.nan)
        if all(isinstance(line, str) and line[:1] == "[" and line[-1:] == "]" for line in lines):
            rows = [[np.inf if limits and k == 0 and word.strip() == "Infinity" else text.number(word.strip())
                     for k, word in enumerate(line[1:-1].rstrip(" ,").split(","))] for line in lines]
            if len({len(row) for row in rows}) == 1:
                array = np.array(rows if len(shape) > 1 else rows[0], dtype=float)  # None becomes NaN
        if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape)) \
                or not np.isfinite(array[:, 1:] if limits else array).all():
            wanted = " x ".join("any" if n is None else str(n) for n in shape)
            raise InputError(f"{self.path}: {start}: {wanted} numbers needed, each row in brackets")
        return array
