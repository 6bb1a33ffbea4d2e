"""The 2-D ship section of Sundsdal et al. (2025) in a wave flume: nominal model and records from the measured runs.

Force from the run with the model held (the diffraction test), motion from the run of the same wave with the model
free. Both runs carry the wavemaker's own motion: it aligns them in time, and the wave probes check that.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

sys.path.insert(0, str(Path(__file__).parents[1]))

import radiation_ss as rss
from radiation_ss.errors import InputError
from radiation_ss.hydro.section.shapes import box_section

RHO, G, LENGTH, BEAM, DRAFT, BILGE = 1000.0, 9.81, 0.586, 0.40, 0.20, 0.0512
MASS, GYRADIUS, GM, SWAY_SPRING = 46.8, 0.36 * 0.40, 0.0629, 60.0
FREE = {"free_sway_heave": ("Sway", "Heave"), "free_heave_roll": ("Heave", "Roll"),
        "free_sway_roll": ("Sway", "Roll"), "free_sway_heave_roll": ("Sway", "Heave", "Roll")}
FORCES = {"Heave": "Fz_heave_N", "Sway": "Fy_sway_N"}


def table(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file of numbers by name."""
    data = np.genfromtxt(path, delimiter=",", names=True)
    return {name: np.asarray(data[name]) for name in data.dtype.names}


def manifest(folder: Path) -> dict[str, dict[str, float]]:
    """Return conditions and time marks of the runs that are there, by file name."""
    with (folder / "manifest.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {row["file"]: {name: float(value) for name, value in row.items() if name != "file"}
            for row in rows if (folder / row["file"]).is_file()}


def nominal() -> rss.HydroData:
    """Return the nominal coefficients: linear potential flow, stated mass, gyradius, GM and sway spring.

    The section solver in deep water; it agrees with the published table of this section to all its digits
    (tests/test_gap_real.py) and gives what the table lacks: A_inf and frequencies beyond 2 to 12 rad/s.
    """
    section = box_section(0.5 * BEAM, DRAFT, BILGE)
    data = rss.section_2d(section, np.linspace(0.5, 20.0, 79)).times(LENGTH).at((0.0, 0.0, -0.092))
    return data.replace(M=np.diag([MASS, MASS, MASS * GYRADIUS**2]), source="ntnu_section",
                        C=np.diag([SWAY_SPRING, RHO * G * LENGTH * BEAM, MASS * G * GM]))


def phasor(time: np.ndarray, values: np.ndarray, omega: float, start: float, end: float) -> complex:
    """Return the complex amplitude a of Re[a e^{i w t}] in a window, a whole number of periods."""
    periods = int((end - start) * omega / (2 * np.pi))
    keep = (time >= start) & (time < start + periods * 2 * np.pi / omega)
    design = np.stack([np.cos(omega * time[keep]), -np.sin(omega * time[keep]), np.ones(keep.sum())], axis=1)
    re, im, _ = np.linalg.lstsq(design, values[keep], rcond=None)[0]
    return complex(re, im)


def lag(free: dict, fixed: dict, marks: tuple[dict, dict]) -> tuple[float, float, float]:
    """Return the time to add to the fixed run's clock, the amplitude ratio and the misfit, by the wavemaker's motion.

    The coarse lag is that of the wavemaker's start, the fine one the phase of its steady motion.
    """
    one, two = marks
    omega = one["omega_rad_s"]
    coarse = one["wavemaker_start_s"] - two["wavemaker_start_s"]
    a, b = (phasor(run["time_s"], run["wavemaker_m"], omega, m["steady_from_s"], m["reflection_back_s"])
            for run, m in zip((free, fixed), marks))
    fine = np.angle(b * np.exp(-1j * omega * coarse) / a) / omega
    shift = coarse + fine
    moved = np.interp(free["time_s"], fixed["time_s"] + shift, fixed["wavemaker_m"]) / abs(b / a)
    window = (free["time_s"] > one["wavemaker_start_s"]) & (free["time_s"] < one["reflection_back_s"])
    misfit = np.std(moved[window] - free["wavemaker_m"][window]) / np.std(free["wavemaker_m"][window])
    return shift, abs(b / a), float(misfit)


def still(run: dict, marks: dict, column: str) -> np.ndarray:
    """Return a column less its mean in still water, before the wavemaker starts: the zero reading of the rig."""
    calm = run["time_s"] < marks["wavemaker_start_s"]
    return run[column] - run[column][calm].mean()


def integrated(time: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return the velocity from rest: the integral, less the ramp of a left-over zero error.

    The error's size is the one that leaves the least velocity; the record begins at rest, so it is all that the
    integral leaves open. (A second integral would drift; of the displacement's slow part these sensors say nothing.)
    """
    v = CubicSpline(time, acceleration).antiderivative()(time)
    ramp = time - time[0]
    return v - ramp * (ramp @ v) / (ramp @ ramp)


def pairs(folder: Path) -> list[tuple[str, str]]:
    """Return (free run, held run of the same period, if possible of the same height) for every free run."""
    runs = manifest(folder)

    def unlike(name: str, other: str) -> float:
        return abs(runs[name]["H_nominal_m"] - runs[other]["H_nominal_m"])

    found = []
    for name in (name for name in runs if name.startswith("free_")):
        held = [other for other in runs if other.startswith("fixed/")
                and runs[other]["period_index"] == runs[name]["period_index"]]
        if held:
            found.append((name, min(held, key=lambda other, name=name: unlike(name, other))))
    return found


def record(folder: Path, free_name: str, fixed_name: str, dofs: tuple[str, ...], *, camera: bool = False) -> rss.Record:
    """Return motion of the free run and force of the held run on the free run's clock, up to the first reflection.

    A held run in a higher or lower wave of the same period is scaled by the ratio of the wavemaker's amplitudes (its
    force is linear in the height to 2 %: runs 2101_2 and 2102_1). Motion by accelerometers, for runs with the roll
    locked (body-fixed ones feel gravity when the body rolls): integrated once, from rest. The camera's displacement
    beside it where asked: it resolves about 1 mm and has a clock of its own. Each channel less its reading in still
    water. The record begins three seconds before the waves reach the model.
    """
    runs = manifest(folder)
    free, fixed = table(folder / free_name), table(folder / fixed_name)
    marks = runs[free_name], runs[fixed_name]
    shift, ratio, misfit = lag(free, fixed, marks)
    if misfit > 0.05:
        raise InputError(f"{free_name} and {fixed_name}: the wavemaker moved differently (misfit {misfit:.2f})")
    time = free["time_s"]
    begin = max(time[0], fixed["time_s"][0] + shift, marks[0]["front_at_model_s"] - 3.0)
    keep = (time >= begin) & (time < marks[0]["reflection_back_s"])
    channels = {}
    for dof in dofs:
        columns = ("acc_heave_sb_m_s2", "acc_heave_ps_m_s2") if dof == "Heave" else ("acc_sway_m_s2",)
        acceleration = np.mean([still(free, marks[0], c)[keep] for c in columns], axis=0)
        channels[f"{dof}_velocity"] = integrated(time[keep], acceleration)
        if camera:
            channels[dof] = still(free, marks[0], f"{dof.lower()}_cam_m")[keep]
        force = still(fixed, marks[1], FORCES[dof]) / (ratio if abs(ratio - 1.0) > 0.02 else 1.0)
        channels[f"{dof}_force"] = np.interp(time[keep], fixed["time_s"] + shift, force)
    name = Path(free_name).name.split(".")[0]
    return rss.Record(time[keep], channels, kind="waves", name=f"ntnu_{name}",
                      meta={"free run": free_name, "held run": fixed_name, "omega": f"{marks[0]['omega_rad_s']:g}",
                            "steady from": f"{marks[0]['steady_from_s']:g}",
                            "lag": f"{shift:.4f} s", "wavemaker ratio": f"{ratio:.4f}",
                            "wavemaker misfit": f"{misfit:.4f}"})


def build(folder: Path, out: Path) -> list[Path]:
    """Write the models (heave; sway and heave) and a record of each pair of runs with the roll locked."""
    out.mkdir(parents=True, exist_ok=True)
    data = nominal()
    files = []
    for dofs in (("Heave",), ("Sway", "Heave")):
        stem = "_".join(dofs).lower()
        path = out / f"ntnu_{stem}.nc"
        rss.write_hydro(data.select(dofs), path)
        files.append(path)
        for free_name, fixed_name in pairs(folder):
            if not free_name.startswith("free_sway_heave/"):
                continue
            for camera in (False, True):
                run = record(folder, free_name, fixed_name, dofs, camera=camera)
                path = out / f"{run.name}_{stem}{'_camera' if camera else ''}.csv"
                rss.write_record(run, path)
                files.append(path)
    return files


if __name__ == "__main__":
    for file in build(Path(sys.argv[1]), Path(sys.argv[2])):
        print(file)
