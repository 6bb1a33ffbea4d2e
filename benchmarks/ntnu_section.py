"""The 2-D ship section of Sundsdal et al. (2025) in a wave flume: nominal model and records from the measured runs.

Force from the run with the model held (the diffraction test), motion from the run of the same wave with the model
free. Both runs carry the wavemaker's own motion: it aligns them in time, and the wave probes check that. Each sensor of
the free run is used where it can tell: accelerometers at the waves' frequencies and above, freed of the gravity that
they feel when the body tilts; below, the springs' tensions for sway and the camera for heave. What a free section sends
to the wavemaker, and gets again, is not what a held one sends: the probes say how much.
"""

from __future__ import annotations

import csv
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

sys.path.insert(0, str(Path(__file__).parents[1]))

import radiation_ss as rss
from benchmarks.ntnu_waves import come_back, two_ways
from radiation_ss.errors import InputError
from radiation_ss.hydro.section.shapes import box_section
from radiation_ss.waves.realise import Sea

RHO, G, LENGTH, BEAM, DRAFT, BILGE = 1000.0, 9.81, 0.586, 0.40, 0.20, 0.0512
MASS, GYRADIUS, GM, SWAY_SPRING = 46.8, 0.36 * 0.40, 0.0629, 60.0
FREE = {"free_sway_heave": ("Sway", "Heave"), "free_heave_roll": ("Heave", "Roll"),
        "free_sway_roll": ("Sway", "Roll"), "free_sway_heave_roll": ("Sway", "Heave", "Roll")}
FORCES = {"Heave": "Fz_heave_N", "Sway": "Fy_sway_N"}
ACCELERATIONS = {"Heave": ("acc_heave_sb_m_s2", "acc_heave_ps_m_s2"), "Sway": ("acc_sway_m_s2",)}
ARM, LEVER = 0.12995, 0.0502  # of the heave accelerometers from the centre line, of the sway one below the centre [m]
PROBES = {"wp1_m": 3.0, "wp2_m": 4.95, "wp3_m": 5.2, "wp4_m": 5.5}  # before the section, from the wavemaker [m]
PLACE, DEPTH = 7.0, 1.0
SLOW = 0.5  # of the wave's frequency: below it the accelerometers cannot tell motion from tilt and zero error


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


@lru_cache
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


def integrated(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the integral from the first sample on."""
    return CubicSpline(time, values).antiderivative()(time)


def slow(time: np.ndarray, values: np.ndarray, omega: float) -> np.ndarray:
    """Return the part below half the wave's frequency omega [rad/s], without delay."""
    sos = butter(4, SLOW * omega / (2 * np.pi), fs=1.0 / np.median(np.diff(time)), output="sos")
    return sosfiltfilt(sos, values)


def fast(time: np.ndarray, values: np.ndarray, omega: float) -> np.ndarray:
    """Return the part above half the wave's frequency."""
    return values - slow(time, values, omega)


def read(run: dict, marks: dict, dof: str) -> np.ndarray:
    """Return the acceleration as the accelerometers give it [m/s^2], less their reading in still water."""
    return np.mean([still(run, marks, column) for column in ACCELERATIONS[dof]], axis=0)


def tilt(run: dict, marks: dict) -> tuple[np.ndarray, np.ndarray]:
    """Return roll angle [rad] and its acceleration above half the wave's frequency, from the heave accelerometers."""
    time, omega = run["time_s"], marks["omega_rad_s"]
    starboard, port = (still(run, marks, column) for column in ACCELERATIONS["Heave"])
    acceleration = fast(time, (starboard - port) / (2.0 * ARM), omega)
    rate = fast(time, integrated(time, acceleration), omega)
    return fast(time, integrated(time, rate), omega), acceleration


def level(run: dict, marks: dict) -> np.ndarray:
    """Return the sway acceleration of the centre of gravity [m/s^2]: the reading, freed of gravity and of the lever.

    A body-fixed accelerometer reads a - g phi - l phi'' (roll positive as `tilt` has it). With the roll "locked" by a
    wedge phi is still about 2 mrad, in time with the sway: a tenth of the reading.
    """
    angle, acceleration = tilt(run, marks)
    return read(run, marks, "Sway") + G * angle + LEVER * acceleration


def velocity(run: dict, marks: dict, dof: str) -> np.ndarray:
    """Return the velocity [m/s]: accelerometers above half the wave's frequency, springs (sway) or camera below.

    An accelerometer's zero error and a slow heel of a milliradian integrate to what springs and camera both deny. The
    sway springs' tensions give the displacement, by their stiffness; they resolve 0.1 mm, the camera about 1 mm.
    """
    time, omega = run["time_s"], marks["omega_rad_s"]
    acceleration = level(run, marks) if dof == "Sway" else read(run, marks, dof)
    displacement = (pull(run, marks) / SWAY_SPRING if dof == "Sway" else still(run, marks, "heave_cam_m"))
    drift = CubicSpline(time, slow(time, displacement, omega)).derivative()(time)
    return fast(time, integrated(time, acceleration), omega) + drift


def pull(run: dict, marks: dict) -> np.ndarray:
    """Return the difference of the springs' tensions [N]: spring stiffness times sway."""
    return still(run, marks, "tension_sb_N") - still(run, marks, "tension_ps_N")


def guide_friction(run: dict, marks: dict) -> np.ndarray:
    """Return the force of the sway guides on the model [N]: the rig's force as measured, less that of the springs."""
    return still(run, marks, "rig_force_sway_N") + pull(run, marks)


def as_read(time: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Return the velocity by accelerometers alone: the integral from rest, less the ramp of a left-over zero error."""
    v, ramp = integrated(time, acceleration), time - time[0]
    return v - ramp * (ramp @ v) / (ramp @ ramp)


def where_it_is(time: np.ndarray, force: np.ndarray, run: dict, marks: dict) -> np.ndarray:
    """Return the exciting force at a section that has drifted by x down the flume: the wave comes k x / omega later.

    By the slow part of the springs' displacement, up to 8 mm; nothing in it is fitted. What the motion at the waves'
    frequency does is of second order, with much else.
    """
    drift = np.interp(time, run["time_s"], slow(run["time_s"], pull(run, marks) / SWAY_SPRING, marks["omega_rad_s"]))
    return force - marks["k_rad_m"] / marks["omega_rad_s"] * drift * np.gradient(force, time)


def scaled(time: np.ndarray, force: np.ndarray, ratio: float, omega: float) -> np.ndarray:
    """Return the force of a held run for a wave `ratio` times lower: by the ratio at the wave's frequency.

    Beside it, at twice the frequency and at slow ones, forces are of second order: by its square.
    """
    first = of_first_order(time, force, omega)
    return first / ratio + (force - first) / ratio**2


def of_first_order(time: np.ndarray, values: np.ndarray, omega: float) -> np.ndarray:
    """Return the part about the wave's frequency, half of it to one and a half, without delay."""
    sos = butter(3, np.array([SLOW, 1.5]) * omega / (2 * np.pi), "bandpass", fs=1.0 / np.median(np.diff(time)),
                 output="sos")
    return sosfiltfilt(sos, values)


def towards_wavemaker(free: dict, fixed: dict, marks: tuple[dict, dict], shift: float, ratio: float) -> tuple[Sea, Sea]:
    """Return the waves that the free run has beside those of the held one: away from the wavemaker, and towards it."""
    time, clock = free["time_s"], fixed["time_s"] + shift
    both = (time > clock[0]) & (time < clock[-1])
    differences = [np.where(both, still(free, marks[0], probe)
                            - np.interp(time, clock, still(fixed, marks[1], probe)) / ratio, 0.0) for probe in PROBES]
    first = of_first_order(time, np.stack(differences), marks[0]["omega_rad_s"])
    return two_ways(first, np.array(list(PROBES.values())), float(np.median(np.diff(time))), DEPTH)


def sent_back(free: dict, fixed: dict, marks: tuple[dict, dict], shift: float, ratio: float,
              dofs: tuple[str, ...]) -> np.ndarray:
    """Return the force [N] of the waves that the free section has back from the wavemaker and the held one had not.

    What runs from the section to the wavemaker differs between the two runs by as much as the wave is high. Its front
    runs ahead of the wave's group velocity: before the wave itself is back a tenth of it is. Difference of the probes,
    linear waves, total reflection, nominal exciting force; nothing in it is fitted. (The probes show what comes back,
    too, but with it the one or two percent by which their daily calibration is off.)
    """
    _, towards = towards_wavemaker(free, fixed, marks, shift, ratio)
    return rss.exciting_force(nominal().select(dofs), come_back(towards, PLACE, DEPTH))


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


def record(folder: Path, free_name: str, fixed_name: str, dofs: tuple[str, ...], *, camera: bool = False,
           corrected: bool = True, returned: bool = True, friction: bool = False, placed: bool = False) -> rss.Record:
    """Return motion of the free run and force of the held run on the free run's clock, up to the first reflection.

    Each channel less its reading in still water. The record begins three seconds before the waves reach the model.
    Runs with the roll locked only: with the roll free, gravity is most of what the sway accelerometer reads.

    Parameters
    ----------
    folder : Path
    free_name, fixed_name : str
        A held run in a higher wave of the same period is scaled (`scaled`) by the ratio of the wavemaker's amplitudes:
        the waves without a model have it, too (runs 1061_1 and 1062_1: 1.66).
    dofs : tuple of str
    camera : bool
        The camera's displacement as a channel beside the velocity; it has a clock of its own.
    corrected : bool
        Velocity by all sensors (`velocity`); else by the accelerometers as they are.
    returned : bool
        Add the force of the waves that only the free section has back from the wavemaker (`sent_back`).
    friction : bool
        Add the measured force of the guides to the exciting one.
    placed : bool
        Take the exciting force where the section is (`where_it_is`), not where it was held.
    """
    runs = manifest(folder)
    free, fixed = table(folder / free_name), table(folder / fixed_name)
    marks = runs[free_name], runs[fixed_name]
    omega = marks[0]["omega_rad_s"]
    shift, ratio, misfit = lag(free, fixed, marks)
    if misfit > 0.05:
        raise InputError(f"{free_name} and {fixed_name}: the wavemaker moved differently (misfit {misfit:.2f})")
    time = free["time_s"]
    begin = max(time[0], fixed["time_s"][0] + shift, marks[0]["front_at_model_s"] - 3.0)
    keep = (time >= begin) & (time < marks[0]["reflection_back_s"])
    back = sent_back(free, fixed, marks, shift, ratio, dofs) if returned else np.zeros((len(dofs), time.size))
    channels = {}
    for i, dof in enumerate(dofs):
        channels[f"{dof}_velocity"] = (velocity(free, marks[0], dof)[keep] if corrected else
                                       as_read(time[keep], read(free, marks[0], dof)[keep]))
        if camera:
            channels[dof] = still(free, marks[0], f"{dof.lower()}_cam_m")[keep]
        force = still(fixed, marks[1], FORCES[dof])
        if abs(ratio - 1.0) > 0.02:
            force = scaled(fixed["time_s"], force, ratio, omega)
        channels[f"{dof}_force"] = np.interp(time[keep], fixed["time_s"] + shift, force) + back[i, keep]
        if placed:
            channels[f"{dof}_force"] = where_it_is(time[keep], channels[f"{dof}_force"], free, marks[0])
        if friction and dof == "Sway":
            channels["Sway_force"] += guide_friction(free, marks[0])[keep]
    name = Path(free_name).name.split(".")[0]
    return rss.Record(time[keep], channels, kind="waves", name=f"ntnu_{name}",
                      meta={"free run": free_name, "held run": fixed_name, "omega": f"{omega:g}",
                            "steady from": f"{marks[0]['steady_from_s']:g}",
                            "lag": f"{shift:.4f} s", "wavemaker ratio": f"{ratio:.4f}",
                            "wavemaker misfit": f"{misfit:.4f}"})


def build(folder: Path, out: Path) -> list[Path]:
    """Write the models (heave; sway and heave) and records of each pair of runs with the roll locked.

    Of each pair one record, one with the camera's displacement beside it and, with sway, one with the friction and the
    force where the section is.
    """
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
            for extra in ((), ("camera",), ("friction", "placed"))[: 3 if "Sway" in dofs else 2]:
                run = record(folder, free_name, fixed_name, dofs, **dict.fromkeys(extra, True))
                path = out / f"{'_'.join((run.name, stem, *extra[:1]))}.csv"
                rss.write_record(run, path)
                files.append(path)
    return files


if __name__ == "__main__":
    for file in build(Path(sys.argv[1]), Path(sys.argv[2])):
        print(file)
