"""
Vugts' half-immersed cylinder
=============================

Potential theory against forced-oscillation tests: the half-immersed circular cylinder of Vugts (1968).

Reads the digitised measurements from RADIATION_SS_DATA or ../shared/data (reference/vugts1968), prints how far the
section solver is from them, and draws both. J. H. Vugts, Int. Shipbuilding Progress 15 (1968) 251-276.

    python examples/vugts/01_half_circle.py --out pictures
"""

# sphinx_gallery_thumbnail_path = 'validation/section_table3.svg'
from __future__ import annotations

import argparse
import csv
import os
import sys
from pathlib import Path

import numpy as np

ROOT = Path(sys.argv[0]).resolve().parents[2]  # the gallery runs scripts without __file__
sys.path.insert(0, str(ROOT))

from radiation_ss import style
from radiation_ss.hydro.section import circle_section, solve_section

RHO, G, R = 1000.0, 9.81, 1.0


def measurements(folder: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    with (folder / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        rows = [(float(row["omega_sqrt_R_over_g"]), float(row["value"])) for row in csv.DictReader(file)
                if row["kind"] == "experimental"]
    x, y = np.array(rows).T
    return x, y


def theory(x: np.ndarray) -> dict[str, np.ndarray]:
    """Return the solver's curves in Vugts' non-dimensional forms; m = rho pi R^2 / 2."""
    tick = np.sqrt(R / G)
    solution = solve_section(circle_section(R), x / tick, rho=RHO, g=G)
    h, mass = solution.hydro, 0.5 * RHO * np.pi * R**2
    wave = np.abs(solution.far_field.radiated[:, 0]) * h.omega[:, None]  # per unit amplitude of motion
    k = h.omega**2 / G
    return {"sway_added_mass": h.A[:, 0, 0] / mass, "heave_added_mass": h.A[:, 1, 1] / mass,
            "sway_damping": h.B[:, 0, 0] / mass * tick, "heave_damping": h.B[:, 1, 1] / mass * tick,
            "sway_exciting_force": np.abs(h.X[:, 0, 0]) / (mass * G * k),
            "heave_exciting_force": np.abs(h.X[:, 0, 1]) / (2 * RHO * G * R),
            "wave_ratio_sway": wave[:, 0], "wave_ratio_heave": wave[:, 1]}


def main(out: Path | None) -> None:
    places = [os.environ.get("RADIATION_SS_DATA", ""), str(ROOT.parent / "shared" / "data")]
    folder = next((Path(p) / "reference" / "vugts1968" for p in places
                   if p and (Path(p) / "reference" / "vugts1968").is_dir()), None)
    if folder is None:
        print("Vugts' measurements (reference/vugts1968) are absent: set RADIATION_SS_DATA to the data folder.")
        return
    x = np.linspace(0.1, 1.6, 76)
    curves = theory(x)
    fig, axes = style.figure(2, 4, size=(12.0, 5.2))
    titles = {"added_mass": "added mass / m", "damping": "damping √(R/g) / m", "exciting_force": "exciting force"}
    print("quantity                 points  rms(measured - theory) / rms(theory)")
    for row, mode in enumerate(("sway", "heave")):
        names = [f"{mode}_added_mass", f"{mode}_damping", f"{mode}_exciting_force", f"wave_ratio_{mode}"]
        for axis, name in zip(axes[row], names):
            at, value = measurements(folder, name)
            expected = np.interp(at, x, curves[name])
            print(f"{name:24s} {at.size:6d}  {np.sqrt(np.mean((value - expected) ** 2) / np.mean(expected**2)):.3f}")
            axis.plot(x, curves[name], color=style.BLUE, label="section solver")
            axis.plot(at, value, "o", ms=3.5, mfc="none", color=style.VERMILION, label="Vugts (1968), measured")
            what = titles.get(name.removeprefix(f"{mode}_"), "radiated wave / motion")
            axis.set(title=f"{mode}: {what}", xlabel="ω √(R/g)", ylim=(0.0, None))
    axes[0, 0].legend(fontsize=7.5)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        fig.savefig(out / "01_half_circle.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="folder for the picture")
    main(parser.parse_args().out)
