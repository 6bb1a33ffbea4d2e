"""The 2-D ship section of Sundsdal et al. (2025) in a wave flume: nominal model and records from the measured runs.

Force from the run with the model held (the diffraction test), motion from the run of the same wave with the model
free. Both runs carry the wavemaker's own motion: it aligns them in time, and the wave probes check that.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import radiation_ss as rss
from radiation_ss.errors import InputError

RHO, G, LENGTH, BEAM = 1000.0, 9.81, 0.586, 0.40
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


def nominal(folder: Path) -> rss.HydroData:
    """Return the nominal coefficients: linear potential flow, stated mass, gyradius, GM and sway spring."""
    bem = table(folder / "bem_deepwater_L0p586.csv")
    omega = bem["omega_rad_s"]
    A, B = np.zeros((2, omega.size, 3, 3))
    for k, (i, j) in {"22": (0, 0), "33": (1, 1), "44": (2, 2), "24": (0, 2)}.items():
        A[:, i, j] = A[:, j, i] = bem["A" + k]
        B[:, i, j] = B[:, j, i] = bem["B" + k]
    X = np.stack([bem[f"X{k}_abs"] * np.exp(1j * np.radians(bem[f"X{k}_lead_deg"])) for k in (2, 3, 4)], axis=-1)
    return rss.HydroData(omega=omega, A=A, B=B, A_inf=infinite_frequency(omega, A, B), dofs=("Sway", "Heave", "Roll"),
                         rho=RHO, g=G, M=np.diag([MASS, MASS, MASS * GYRADIUS**2]),
                         C=np.diag([SWAY_SPRING, RHO * G * LENGTH * BEAM, MASS * G * GM]), X=X[:, None, :],
                         reference_point=(0.0, 0.0, -0.092), source="ntnu_section")


def infinite_frequency(omega: np.ndarray, A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return A_inf by a fit of A and B together with a causal kernel, sum of damped cosines on a grid of poles.

    The table ends at 12 rad/s; the kernel's modes s/(s^2 + c1 s + c0) and (s + c1)/(s^2 + c1 s + c0) tie what it says
    of B to A - A_inf (Kramers-Kronig).
    """
    s = 1j * omega[:, None]
    w0 = np.geomspace(0.5, 25.0, 14)
    modes = [(s + d * c) / (s**2 + c * s + w0**2) for c in (0.7 * w0, 1.6 * w0) for d in (0.0, 1.0)]
    K = np.concatenate(modes, axis=1)
    rows = np.concatenate([np.hstack([K.real, np.zeros((omega.size, 1))]),
                           np.hstack([K.imag / omega[:, None] * omega.mean(), np.ones((omega.size, 1)) * omega.mean()]),
                           1e-3 * np.eye(K.shape[1], K.shape[1] + 1) * np.abs(K).max()])
    result = np.zeros(A.shape[1:])
    for i, j in np.ndindex(*result.shape):
        right = np.concatenate([B[:, i, j], A[:, i, j] * omega.mean(), np.zeros(K.shape[1])])
        result[i, j] = np.linalg.lstsq(rows, right, rcond=None)[0][-1]
    return result


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
    moved = np.interp(free["time_s"], fixed["time_s"] + shift, fixed["wavemaker_m"])
    window = (free["time_s"] > one["wavemaker_start_s"]) & (free["time_s"] < one["reflection_back_s"])
    misfit = np.std(moved[window] - free["wavemaker_m"][window]) / np.std(free["wavemaker_m"][window])
    return shift, abs(b / a), float(misfit)


def still(run: dict, marks: dict, column: str) -> np.ndarray:
    """Return a column less its mean in still water, before the wavemaker starts: the zero reading of the rig."""
    calm = run["time_s"] < marks["wavemaker_start_s"]
    return run[column] - run[column][calm].mean()


def pairs(folder: Path) -> list[tuple[str, str]]:
    """Return (free run, fixed run of the same wave) for every free run that has one."""
    runs = manifest(folder)
    wave = {name: (run["period_index"], run["H_nominal_m"]) for name, run in runs.items()}
    fixed = {wave[name]: name for name in runs if name.startswith("fixed/")}
    return [(name, fixed[wave[name]]) for name in runs if name.startswith("free_") and wave[name] in fixed]


def record(folder: Path, free_name: str, fixed_name: str, dofs: tuple[str, ...]) -> rss.Record:
    """Return motion of the free run and force of the held run on the free run's clock, up to the first reflection.

    Columns: the camera's displacement; the accelerometers' heave (mean of the two) where heave is free; the force in
    the held run. Each less its reading in still water.
    """
    runs = manifest(folder)
    free, fixed = table(folder / free_name), table(folder / fixed_name)
    marks = runs[free_name], runs[fixed_name]
    shift, ratio, misfit = lag(free, fixed, marks)
    if misfit > 0.05:
        raise InputError(f"{free_name} and {fixed_name}: the wavemaker moved differently (misfit {misfit:.2f})")
    time = free["time_s"]
    keep = (time >= max(time[0], fixed["time_s"][0] + shift)) & (time < marks[0]["reflection_back_s"])
    channels = {}
    for dof in dofs:
        channels[dof] = still(free, marks[0], f"{dof.lower()}_cam_{'rad' if dof == 'Roll' else 'm'}")[keep]
        if dof == "Heave":
            channels["Heave_acceleration"] = 0.5 * (still(free, marks[0], "acc_heave_sb_m_s2")
                                                    + still(free, marks[0], "acc_heave_ps_m_s2"))[keep]
        if dof in FORCES:
            force = still(fixed, marks[1], FORCES[dof])
            channels[f"{dof}_force"] = np.interp(time[keep], fixed["time_s"] + shift, force)
    name = Path(free_name).name.split(".")[0]
    return rss.Record(time[keep], channels, kind="waves", name=f"ntnu_{name}",
                      meta={"free run": free_name, "held run": fixed_name, "omega": f"{marks[0]['omega_rad_s']:g}",
                            "lag": f"{shift:.4f} s", "wavemaker ratio": f"{ratio:.4f}",
                            "wavemaker misfit": f"{misfit:.4f}"})


def build(folder: Path, out: Path) -> list[Path]:
    """Write the models (heave; sway and heave) and a record of each pair of runs; return the files."""
    out.mkdir(parents=True, exist_ok=True)
    data = nominal(folder)
    files = []
    for dofs in (("Heave",), ("Sway", "Heave")):
        path = out / f"ntnu_{'_'.join(dofs).lower()}.nc"
        rss.write_hydro(data.select(dofs), path)
        files.append(path)
    for free_name, fixed_name in pairs(folder):
        free_dofs = tuple(dof for dof in FREE[free_name.split("/")[0]] if dof in FORCES)
        for dofs in {tuple(free_dofs), *((dof,) for dof in free_dofs if dof == "Heave")}:
            run = record(folder, free_name, fixed_name, dofs)
            path = out / f"{run.name}_{'_'.join(dofs).lower()}.csv"
            rss.write_record(run, path)
            files.append(path)
    return files


if __name__ == "__main__":
    for file in build(Path(sys.argv[1]), Path(sys.argv[2])):
        print(file)
