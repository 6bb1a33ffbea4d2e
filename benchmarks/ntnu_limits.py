"""The flume's gap taken apart: what the sensors and the rig make of it, where the rest lies, what two runs repeat."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import hilbert

import radiation_ss as rss
from benchmarks import ntnu_section as flume
from benchmarks.ntnu_waves import come_back
from radiation_ss.gap.how_far.ledger import Error, errors_on, pooled_gap
from radiation_ss.gap.where.residual_force import memory_force
from radiation_ss.waves.realise import Sea

BANDS = ((0.0, 0.5), (0.5, 1.5), (1.5, 2.5), (2.5, np.inf))  # in multiples of the wave's frequency
PULLED = 3.0  # standard deviations
HEADS = "slow | wave frequency | twice it | above"
STAGES = (("accelerometers as they are, integrated from rest", {"corrected": False, "returned": False}),
          ("sway freed of gravity, slow parts from springs and camera", {"returned": False}),
          ("and the waves that come back from the wavemaker", {}),
          ("and the measured friction of the guides in the force", {"friction": True}),
          ("and the force where the section is", {"friction": True, "placed": True}))
REPEATS = (("fixed/2091.csv.gz", "fixed/2091_1.csv.gz"),
           ("free_heave_roll/6041_1.csv", "free_heave_roll/6041_2.csv.gz"),
           ("free_sway_heave_roll/3061_1.csv.gz", "free_sway_heave_roll/3061_2.csv.gz"))


def in_bands(time: np.ndarray, error: np.ndarray, measured: np.ndarray, omega: float) -> list[float]:
    """Return rms of the error in each of BANDS over rms of the measured signal."""
    power = np.abs(np.fft.rfft(error)) ** 2 / error.size**2
    power[1:] *= 2.0
    at = 2.0 * np.pi * np.fft.rfftfreq(error.size, np.median(np.diff(time))) / omega
    total = np.mean(measured**2)
    return [float(np.sqrt(power[(at >= low) & (at < high)].sum() / total)) for low, high in BANDS]


def numbers(values: Sequence[float]) -> str:
    """Return cells of a table."""
    return " | ".join(f"{value:.3f}" for value in values)


def runs_with_roll_locked(folder: Path) -> list[tuple[str, str]]:
    """Return the pairs of runs that the diagnosis uses."""
    return [pair for pair in flume.pairs(folder) if pair[0].startswith("free_sway_heave/")]


def stages(folder: Path, model: rss.Model) -> list[str]:
    """Return the gap of the model as given, nothing fitted, on the last third of each run, as sensors are put right."""
    lines = ["| sensors, model as given, last third of each run | sway | heave |", "|---|---|---|"]
    for name, options in STAGES:
        errors: list[Error] = []
        for pair in runs_with_roll_locked(folder):
            record = flume.record(folder, *pair, model.dofs, **options)
            errors += errors_on(model, [], record, record.time[0] + 2.0 / 3.0 * np.ptp(record.time))
        gaps = [pooled_gap([e for e in errors if e.dof == dof]) for dof in range(model.n)]
        lines.append(f"| {name} | {numbers(gaps)} |")
    return [*lines, ""]


def by_motion(diagnosis: rss.Diagnosis, model: rss.Model, records: Sequence[rss.Record]) -> list[str]:
    """Return the gap on unseen data of each motion, and of each record by band."""
    omegas = {record.name: float(record.meta["omega"]) for record in records}
    lines = ["| motion, unseen data | nominal | retuned | with the effects |", "|---|---|---|---|"]
    for i, dof in enumerate(model.dofs):
        gaps = [pooled_gap([e for e in diagnosis.predictions[name] if e.dof == i])
                for name in ("nominal", "retuned", "corrected")]
        lines.append(f"| {dof} | {numbers(gaps)} |")
    lines += ["", f"| left of the record | {HEADS} | all |", "|---|---|---|---|---|---|"]
    for e in diagnosis.predictions["corrected"]:
        shares = in_bands(e.time, e.error, e.measured, omegas[e.record])
        lines.append(f"| {e.record}, {model.dofs[e.dof]} | {numbers(shares)} | {np.hypot.reduce(shares):.3f} |")
    pulls = [f"{name} {pull:.1f}" for name, pull in diagnosis.where.pulls.items() if abs(pull) > PULLED]
    return [*lines, "", f"Nominal numbers retuned by more than {PULLED:g} standard deviations of their tolerance: "
            f"{', '.join(pulls) or 'none'}.", ""]


def floors(folder: Path, model: rss.Model) -> list[str]:
    """Return what is left of the sway at the wave's frequency with the recorded force scaled and turned at will.

    Gain and phase are fitted to the last third of each run itself, with all slow parts and multiples of the frequency
    free beside: an error that no linear model with this force can get below.
    """
    lines = ["| last third of each run, fitted on itself | wave frequency in sway |", "|---|---|"]
    for pair in runs_with_roll_locked(folder):
        record = flume.record(folder, *pair, model.dofs, friction=True, placed=True)
        omega, time = float(record.meta["omega"]), record.time
        force = np.stack([record.channels[f"{dof}_force"] for dof in model.dofs])
        answer = np.asarray(rss.simulate(model, (time - time[0], force)).outputs)[model.n]
        tail = time >= time[0] + 2.0 / 3.0 * np.ptp(time)
        at, measured = time[tail], record.channels["Sway_velocity"][tail]
        share = (at - at[0]) / np.ptp(at)
        slow = np.cos(np.pi * np.outer(share, np.arange(int(flume.SLOW * omega * np.ptp(at) / np.pi) + 1)))
        overtones = np.stack([wave(k * omega * at) for k in (2, 3) for wave in (np.cos, np.sin)], axis=1)
        columns = np.column_stack([answer[tail], np.gradient(answer, time)[tail], slow, overtones])
        left = measured - columns @ np.linalg.lstsq(columns, measured, rcond=None)[0]
        lines.append(f"| {record.name} | {in_bands(at, left, measured, omega)[1]:.3f} |")
    return [*lines, ""]


def drift_forces(folder: Path, model: rss.Model) -> list[str]:
    """Return the mean force that the free section lacks, as its motion has it and as the lee probe has it.

    By momentum, a wave of amplitude a of which the share T gets past a section pushes it with
    rho g a^2 length (1 - T^2) / 2 (times 2 c_g / c), no energy lost: what the free section lets past it does not feel.
    """
    waves = {"4041": "waves/1041_1.csv", "4061": "waves/1061_1.csv.gz", "4101": "waves/1101_1.csv"}
    runs = flume.manifest(folder)
    lines = ["| mean sway force [N], steady waves | held | missing as free, by motion | missing, by the lee probe |",
             "|---|---|---|---|"]
    for free_name, fixed_name in runs_with_roll_locked(folder):
        record = flume.record(folder, free_name, fixed_name, model.dofs, friction=True)
        marks, k = runs[free_name], runs[free_name]["k_rad_m"]

        def probe(name, column):
            run = flume.table(folder / name)
            window = runs[name]["omega_rad_s"], runs[name]["steady_from_s"], runs[name]["reflection_back_s"]
            height, maker = (flume.phasor(run["time_s"], run[c], *window) for c in (column, "wavemaker_m"))
            return abs(height / maker), abs(maker)

        undisturbed = waves[Path(free_name).name.split("_")[0]]
        past = [probe(name, "wp6_m")[0] / probe(undisturbed, "wp6_m")[0] for name in (fixed_name, free_name)]
        amplitude = probe(undisturbed, "wp4_m")[0] * probe(free_name, "wp4_m")[1]
        push = 0.5 * flume.RHO * flume.G * amplitude**2 * flume.LENGTH * (1.0 + 2.0 * k / np.sinh(2.0 * k))
        held, missing = mean_forces(record, model, marks)
        lines.append(f"| {record.name} | {held:.2f} | {missing:.2f} | {push * (past[0]**2 - past[1]**2):.2f} |")
    return [*lines, ""]


def beside(folder: Path, names: tuple[str, str]) -> tuple[dict, dict, tuple[Sea, Sea]]:
    """Return the free run, its marks and its waves less those of the held one, away from the wavemaker and towards."""
    runs = flume.manifest(folder)
    free, fixed = (flume.table(folder / name) for name in names)
    marks = runs[names[0]], runs[names[1]]
    shift, ratio, _ = flume.lag(free, fixed, marks)
    return free, marks[0], flume.towards_wavemaker(free, fixed, marks, shift, ratio)


def flap(time: np.ndarray, away: Sea, towards: Sea, marks: dict) -> complex:
    """Return the part of what runs to the wavemaker that the probes see come back, in the last third of a record."""
    keep = last_third(time, marks)
    back, sent = (hilbert(sea.elevation)[keep] for sea in (away, towards))
    return complex(np.vdot(sent, back) / np.vdot(sent, sent))


def last_third(time: np.ndarray, marks: dict) -> np.ndarray:
    """Return which samples are in the last third of the record of a run."""
    end = marks["reflection_back_s"]
    return (time < end) & (time > end - (end - marks["front_at_model_s"] + 3.0) / 3.0)


def wall(folder: Path) -> list[str]:
    """Return what the free section sends to the wavemaker beside the held one, what comes back, how soon it acts."""
    lines = ["| waves of the free run less those of the held one, last third | sent to the wavemaker [mm] | comes back "
             "| turned by [deg] | back at the section, rms and end [mm] | wave [mm] |", "|---|---|---|---|---|---|"]
    for names in runs_with_roll_locked(folder):
        free, marks, (away, towards) = beside(folder, names)
        time, began = free["time_s"], marks["wavemaker_start_s"]
        part = flap(time, away, towards, marks)
        sent, here = (1e3 * np.abs(hilbert(sea.elevation))[last_third(time, marks)]
                      for sea in (towards, come_back(towards, flume.PLACE, flume.DEPTH)))
        height = 1e3 * abs(flume.phasor(time, free["wp1_m"], marks["omega_rad_s"], began + 9.0, began + 12.0))
        lines.append(f"| {Path(names[0]).name.split('.')[0]} | {np.sqrt(np.mean(sent**2)):.1f} | {abs(part):.2f} | "
                     f"{np.degrees(np.angle(part)):.0f} | {np.sqrt(np.mean(here**2)):.2f}, {here[-1]:.2f} | "
                     f"{height:.1f} |")
    return [*lines, ""]


def mean_forces(record: rss.Record, model: rss.Model, marks: dict) -> tuple[float, float]:
    """Return the means of acting and of missing sway force [N] over whole periods of the steady wave."""
    h, omega = float(np.median(np.diff(record.time))), marks["omega_rad_s"]
    v = np.stack([record.channels[f"{dof}_velocity"] for dof in model.dofs], axis=1)
    x, a = (np.stack([CubicSpline(record.time, column).antiderivative()(record.time) if up else
                      CubicSpline(record.time, column).derivative()(record.time) for column in v.T], axis=1)
            for up in (True, False))
    acting = record.channels["Sway_force"]
    missing = (a @ (model.M + model.A_inf).T + x @ model.C.T + memory_force(model, v, h))[:, 0] - acting
    first = marks["steady_from_s"]
    periods = int((min(record.time[-1], marks["reflection_back_s"]) - first) * omega / (2.0 * np.pi))
    keep = (record.time >= first) & (record.time < first + periods * 2.0 * np.pi / omega)
    return float(acting[keep].mean()), float(missing[keep].mean())


def signals(folder: Path, name: str, marks: dict) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return a run's columns, and its signals that another run of the same wave should repeat."""
    run = flume.table(folder / name)
    if name.startswith("fixed/"):
        return run, {"sway force": flume.still(run, marks, "Fy_sway_N"),
                     "heave force": flume.still(run, marks, "Fz_heave_N")}
    found = {"heave acceleration": flume.read(run, marks, "Heave")}
    if "sway" in name:
        found["sway accelerometer"] = flume.read(run, marks, "Sway")
    return run, found


def repeats(folder: Path) -> list[str]:
    """Return how far two runs of the same wave differ, by band: no model can be held to less."""
    marks = flume.manifest(folder)
    lines = [f"| difference of two runs of the same wave | {HEADS} | all |", "|---|---|---|---|---|---|"]
    for first, second in REPEATS:
        (one, mine), (two, other) = (signals(folder, name, marks[name]) for name in (first, second))
        shift, ratio, _ = flume.lag(one, two, (marks[first], marks[second]))
        keep = ((one["time_s"] > marks[first]["front_at_model_s"] - 3.0)
                & (one["time_s"] < marks[first]["reflection_back_s"]))
        time = one["time_s"][keep]
        for name, values in mine.items():
            again = np.interp(time, two["time_s"] + shift, other[name]) / ratio
            shares = in_bands(time, values[keep] - again, values[keep], marks[first]["omega_rad_s"])
            runs = " and ".join(Path(run).name.split(".")[0] for run in (first, second))
            lines.append(f"| {name}, {runs} | {numbers(shares)} | {np.hypot.reduce(shares):.3f} |")
    return [*lines, ""]
