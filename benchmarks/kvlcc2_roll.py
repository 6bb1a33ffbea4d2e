"""Roll decay of the KVLCC2 tanker model (SSPA 2018; Alexandersson & Kjellberg): nominal model and records.

The nominal model has one degree of freedom, roll about the axis that the ship rolls about. Inertia and stiffness are
the stated particulars. Added inertia and potential damping at the natural frequency are those of the inviscid
simulation of the same test; nothing is taken from the measured runs.
"""

from __future__ import annotations

import csv
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import radiation_ss as rss

RHO, G = 1000.0, 9.81
LPP, BEAM, DRAFT, VOLUME, GYRADIUS, GM = 4.706, 0.853, 0.3059, 0.993, 0.341, 0.0843
MEASURED, SIMULATED = "roll_decay_0kn_run1_21337.csv", "simulation_inviscid_fnpf_0kn.csv"


def columns(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return time [s] and roll [rad]."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = [(float(row["time_s"]), float(row["roll_rad"])) for row in csv.DictReader(file)]
    time, roll = np.array(rows).T
    return time, roll


def crossings(time: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Return the times of zero crossings, linear between samples."""
    at = np.flatnonzero(roll[:-1] * roll[1:] < 0.0)
    return time[at] - roll[at] * (time[at + 1] - time[at]) / (roll[at + 1] - roll[at])


def decay_rate(time: np.ndarray, roll: np.ndarray) -> tuple[float, float]:
    """Return natural frequency [rad/s] and decay rate [1/s] of a lightly damped decay.

    The frequency is that of the zero crossings; the rate the slope of the log of each half period's rms.
    """
    zero = crossings(time, roll)
    omega = np.pi / np.polyfit(np.arange(zero.size), zero, 1)[0]
    size = [np.sqrt(np.mean(roll[(time >= a) & (time < b)] ** 2)) for a, b in pairwise(zero)]
    return float(omega), float(-np.polyfit(0.5 * (zero[:-1] + zero[1:]), np.log(size), 1)[0])


def nominal(folder: Path) -> rss.HydroData:
    """Return the coefficients of the nominal model.

    M = rho V k^2, C = rho g V GM. The simulation's natural frequency w0 and rate d give (M + A(w0)) = C / w0^2 and
    B(w0) = 2 d (M + A(w0)). Around w0 the damping is given the shape of one passive mode
    r s / (s^2 + c1 s + c0) with its peak at twice w0; in a decay only its value at w0 acts.
    """
    omega0, rate = decay_rate(*columns(folder / SIMULATED))
    M, C = RHO * VOLUME * GYRADIUS**2, RHO * G * VOLUME * GM
    inertia = C / omega0**2
    omega = np.unique(np.concatenate([np.geomspace(0.2, 12.0, 60), [omega0]]))

    def mode(w):
        return 1j * w / (-(w**2) + 2j * omega0 * w + (2 * omega0) ** 2)

    K = 2.0 * rate * inertia * mode(omega) / mode(omega0).real
    A_inf = inertia - M - (2.0 * rate * inertia * mode(omega0) / mode(omega0).real).imag / omega0
    A = A_inf + K.imag / omega
    return rss.HydroData(omega=omega, A=A[:, None, None], B=K.real[:, None, None], A_inf=[[A_inf]], dofs=("Roll",),
                         rho=RHO, g=G, M=[[M]], C=[[C]], source="kvlcc2_roll")


def measured(folder: Path) -> rss.Record:
    """Return the measured decay from its largest angle on; before it the model was rolled by hand."""
    time, roll = columns(folder / MEASURED)
    start = int(np.argmax(np.abs(roll)))
    return rss.Record(time[start:] - time[start], {"Roll": roll[start:]}, kind="decay", name="kvlcc2_run1",
                      meta={"source": MEASURED, "released": f"{time[start]:.2f} s"})


def build(folder: Path, out: Path) -> list[Path]:
    """Write the model, the decay, and its first two thirds and last third; return the files."""
    out.mkdir(parents=True, exist_ok=True)
    rss.write_hydro(nominal(folder), out / "kvlcc2.nc")
    run = measured(folder)
    split = 2.0 / 3.0 * run.time[-1]
    files = [out / "kvlcc2.nc"]
    for part, name in ((run, ""), (run.window(0.0, split), "_seen"), (run.window(split, np.inf), "_withheld")):
        path = out / f"kvlcc2_run1{name}.csv"
        rss.write_record(part, path)
        files.append(path)
    return files


if __name__ == "__main__":
    for file in build(Path(sys.argv[1]), Path(sys.argv[2])):
        print(file)
