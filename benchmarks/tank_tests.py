"""Diagnoses of records by others, told nothing of the cause: decays, statics, a tow, a drift, two benchmarks.

    RADIATION_SS_DATA=DATA python benchmarks/tank_tests.py [NAME ...]

Each function below builds model and records from the numbers of the data's README. Prints the table and writes it into
the table of docs/validation/real_data.md; with names, only prints these.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.signal import csd, welch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss
from benchmarks import kvlcc2_roll, measured
from benchmarks.pages import write_table

PAGE = ROOT / "docs" / "validation" / "real_data.md"
START, END = "<!-- tank tests: written by the benchmark -->", "<!-- end of tank tests -->"
PINION = 6.35e-3  # siweed's radius of the pinion [m]


def columns(path: Path) -> dict[str, np.ndarray]:
    """Return a CSV's columns by name."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: np.atleast_1d(table[name]) for name in table.dtype.names}


def sweep(data: Path) -> rss.Diagnosis:
    """A buoy pushed slowly: position and torque of the motor; the model knows the waterplane alone."""
    c = columns(data / "foreign" / "siweed" / "slow_torque_sweep_1.csv")
    model = rss.body(dof="Heave", mass=1.0, added_mass=0.0, C=110.9)
    force = c["wec_torque_Nm"] / PINION
    return rss.diagnose(model, rss.Record(c["time_s"], {"Heave": c["wec_position_m"], "Heave_force": force},
                                          kind="static", name="sweep"))


def tanker(data: Path, name: str, speed: float, last: float) -> rss.Record:
    """Return a roll decay of the KVLCC2 from its largest angle on."""
    c = columns(data / "kvlcc2_roll" / name)
    first = int(np.argmax(np.abs(c["roll_rad"])))
    keep = (np.arange(c["time_s"].size) >= first) & (c["time_s"] < last)
    return rss.Record(c["time_s"][keep] - c["time_s"][first], {"Roll": c["roll_rad"][keep]}, kind="decay",
                      name=f"{speed} m/s", speed=speed)


def tow(data: Path) -> rss.Diagnosis:
    """Roll of a tanker at rest and under way in one diagnosis; the carriage stops at 80 s."""
    model = rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.0017)
    return rss.diagnose(model, [tanker(data, "roll_decay_0kn_run1_21337.csv", 0.0, np.inf),
                                tanker(data, "roll_decay_15p5kn_21340.csv", 0.97, 80.0)])


def platform(data: Path) -> rss.Model:
    """Return the UMaine semisubmersible of IEA's 15 MW turbine (Allen et al. 2020), tower and rotor as one body."""
    folder = data / "bem" / "formats" / "iea15"
    hydro = rss.read_hydro(folder / "UMaineSemi.1")
    mass, height, inertia = 2.0119e7, -1.93, (4.465e10, 4.465e10, 2.403e10)
    M = np.diag([mass] * 3 + list(inertia))
    M[0, 4] = M[4, 0] = mass * height
    M[1, 3] = M[3, 1] = -mass * height
    C = hydro.C.copy()
    C[3, 3] -= mass * 9.81 * height
    C[4, 4] -= mass * 9.81 * height
    return rss.Model.from_hydro(hydro.replace(M=M, C=C, X=None))


def offsets(data: Path) -> rss.Diagnosis:
    """A moored floating wind platform pulled and brought back slowly; six motions, no force recorded."""
    c = columns(data / "foreign" / "focal" / "surge_offsets_plus.csv.gz")
    record = rss.Record(c.pop("time_s"), {name.split("_")[0]: values for name, values in c.items()},
                        kind="motion-only", name="surge offsets")
    return rss.diagnose(platform(data), record)


def box(data: Path) -> rss.Diagnosis:
    """A free box that drifts in regular waves: a section with its own radiation; unmoored, so no line is asked."""
    folder = data / "foreign" / "ren2015_box"
    eta, sway, heave, roll = (columns(folder / f"H04_{name}.csv") for name in ("wavegauge", "surge", "heave", "pitch"))
    t = np.arange(max(c["time_s"][0] for c in (eta, sway, heave, roll)),
                  min(c["time_s"][-1] for c in (eta, sway, heave, roll)), 0.02)
    at = [np.interp(t, c["time_s"], list(c.values())[1]) for c in (eta, sway, heave, roll)]
    corners = [(-0.15, 0.0), (-0.15, -0.1), (0.15, -0.1), (0.15, 0.0)]
    model = rss.body(section=corners, length=0.4, depth=0.4, dof=["Sway", "Heave", "Roll"], mass=12.0,
                     gyradius=float(np.sqrt(0.151 / 12.0)), centre_of_gravity=0.0)
    record = rss.Record(t, {"wave_elevation": at[0], "Sway": at[1], "Heave": at[2], "Roll": at[3]}, kind="waves",
                        name="H04")
    return rss.diagnose(model, record, absent=["slack_mooring"])


def absorber(data: Path) -> rss.Diagnosis:
    """Two bodies heaving in a measured sea by their elevation: power take-off and mooring are not in the BEM file.

    Motions are about their means: where the lines' pull sets the plate is no matter of its dynamics.
    """
    folder = data / "foreign" / "rm3_moored"
    t, floats, plate = np.loadtxt(folder / "body_motions.txt.gz").T
    elevation = np.interp(t, *np.loadtxt(folder / "wave_elevation.txt.gz").T)
    hydro = rss.read_hydro(data / "bem" / "formats" / "rm3_capytaine.nc")
    dofs = [dof for dof in hydro.dofs if dof.endswith("Heave")]
    two = hydro.select(dofs)
    model = rss.Model.from_hydro(two.replace(M=np.diag([725834.0, 886691.0])))
    channels = {dofs[0]: floats - floats.mean(), dofs[1]: plate - plate.mean(), "wave_elevation": elevation}
    return rss.diagnose(model, rss.Record(t, channels, kind="waves", name="sea"))


def realisations(table: np.ndarray, dt: float, size: int, count: int) -> list[rss.Record]:
    """Return records of columns force and displacement, one after another."""
    time = np.arange(size) * dt
    parts = [table[k * size:(k + 1) * size] for k in range(count)]
    return [rss.Record(time, {"Heave": part[:, 1], "Heave_force": part[:, 0]}, name=f"realisation {k + 1}")
            for k, part in enumerate(parts)]


def duffing(data: Path) -> rss.Diagnosis:
    """An electronic circuit with a cubic spring, V for N and m; the model is its mean linear response, mass first."""
    path = data / "foreign" / "silverbox" / "multisine.csv.gz"
    table, dt = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:], 1.0 / 610.35
    frequency, cross = csd(*table.T, 1.0 / dt, nperseg=4096)
    H = cross / welch(table[:, 0], 1.0 / dt, nperseg=4096)[1]
    band = (frequency > 5.0) & (frequency < 180.0)
    w, Z = 2.0 * np.pi * frequency[band], 1.0 / H[band]
    weight = np.abs(H[band])
    mass, C = np.linalg.lstsq(np.column_stack([-w**2, np.ones_like(w)]) * weight[:, None], Z.real * weight)[0]
    damping = np.sum(weight**2 * w * Z.imag) / np.sum(weight**2 * w**2)
    model = rss.body(dof="Heave", mass=mass, C=C, added_mass=0.0, damping_ratio=damping / 2.0 / np.sqrt(C * mass),
                     tolerance={"mass": 0.1, "C": 0.1})
    records = realisations(table, dt, 8192, 5)
    return rss.diagnose(model, records[:2], withhold=records[-1:])


def hysteretic(data: Path) -> rss.Diagnosis:
    """A mass on a spring with Bouc and Wen's hysteresis (Noel & Schoukens 2016); the model lacks the latter."""
    table = np.loadtxt(data / "foreign" / "boucwen" / "multisine.csv.gz", delimiter=",", skiprows=1)[:, 1:]
    model = rss.body(dof="Heave", mass=2.0, C=5e4, added_mass=0.0, damping_ratio=10.0 / 2.0 / np.sqrt(1e5))
    records = realisations(table, 1.0 / 750.0, 8192, 5)
    return rss.diagnose(model, [records[0], records[2]], withhold=records[4:])


def roll(name: str, length: float) -> Callable[[Path], rss.Diagnosis]:
    """Return the diagnosis of one roll decay cut to a length; the model is the inviscid simulation's."""
    def study(data: Path) -> rss.Diagnosis:
        record = tanker(data, name, 0.0, np.inf)
        model = rss.Model.from_hydro(kvlcc2_roll.nominal(data / "kvlcc2_roll"))
        return rss.diagnose(model, record.window(0.0, length))
    return study


def sphere(program: str) -> Callable[[Path], rss.Diagnosis]:
    """Return the diagnosis of a sphere's heave decay by one program (OES Task 10)."""
    def study(data: Path) -> rss.Diagnosis:
        time, heave = np.loadtxt(data / "foreign" / "sphere_decay" / f"{program}.txt").T
        hydro = rss.read_hydro(data / "bem" / "formats" / "sphere_capytaine.nc").select(["Heave"])
        model = rss.Model.from_hydro(hydro.replace(M=[[261.8e3]]))
        return rss.diagnose(model, rss.Record(time, {"Heave": heave}, kind="decay", name=program))
    return study


REST, SPEED = "roll_decay_0kn_run1_21337.csv", "roll_decay_15p5kn_21340.csv"
CASES = {**{f"roll at rest, {length:.0f} s": roll(REST, length) for length in (45.0, 60.0, 92.0)},
         **{f"roll at 15.5 kn, {length:.0f} s": roll(SPEED, length) for length in (30.0, 60.0, 80.0)},
         **{f"sphere, {program}": sphere(program) for program in ("proteusds", "marin", "nrel_cfd")},
         "silverbox": duffing, "boucwen": hysteretic, "siweed sweep": sweep, "roll at rest and at 15.5 kn": tow,
         "focal offsets": offsets, "ren2015 box": box, "rm3 by elevation": absorber}


def line(name: str, found: rss.Diagnosis, seconds: float) -> str:
    """Return a row of the table."""
    names = "; ".join(f"{e.name} on {e.dof}: " + ", ".join(
        f"{n} {v:.4g} ± {2 * s:.1g} {e.units.get(n, '')}" for n, (v, s) in e.parameters.items())
        for e in found.verdict.effects)
    alike = found.verdict.indistinguishable
    more = f" or {len(alike) - 1} more" * (len(alike) > 1)
    sets = f"{' + '.join(alike[0]) or 'recalibration alone'}{more}" if alike else ""
    far = found.how_far
    return (f"| {name} | {found.verdict.status} ({found.verdict.probability:.2f}) | {names or sets or '-'} | "
            f"{far.gap_before:.1%} to {far.gap_after:.1%} | {seconds:.0f} s |")


def main(names: Sequence[str]) -> None:
    data = measured.data_folder()
    if data is None:
        print("The measured data are absent: set RADIATION_SS_DATA to their folder.")
        return
    warnings.simplefilter("ignore")
    rows = ["| data | verdict (probability) | effects, with two standard deviations | unseen gap | processor time |",
            "|---|---|---|---|---|"]
    for name in names or CASES:
        began = time.process_time()
        try:
            found = CASES[name](data)
            rows.append(line(name, found, time.process_time() - began))
        except rss.InputError as error:
            rows.append(f"| {name} | refused | {error} | | |")
        print(rows[-1], flush=True)
    if not names:
        write_table(PAGE, "\n".join(rows), START, END)


if __name__ == "__main__":
    main(sys.argv[1:])
