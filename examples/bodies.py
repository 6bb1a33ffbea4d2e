"""Bodies of the examples, from the section solver: no file needed. And where pictures go."""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import radiation_ss as rss


def absorber():
    """A floating half-cylinder across the waves, radius 2.5 m, 10 m long, heaving in deep water."""
    section = rss.section_2d(rss.lewis_section(2.5, 2.5, np.pi / 4.0), np.linspace(0.1, 6.0, 60))
    data = section.select("Heave").times(10.0)
    mass = data.rho * 0.5 * np.pi * 2.5**2 * 10.0
    return data.replace(M=[[mass]], source="half-cylinder, radius 2.5 m, 10 m long")


def tank_heave():
    """The paper's section in heave: Lewis form, b = d = 0.1 m, 0.297 m long, 0.45 m of water."""
    section = rss.section_2d(rss.lewis_section(0.1, 0.1, 0.9), np.linspace(0.5, 30.0, 60), depth=0.45)
    return section.select("Heave").times(0.297).replace(M=[[52.4 / 9.81]], source="tank section, heave")


def ship_section():
    """A ship of one section, 20 m wide, 8 m deep, 100 m long, in sway and roll about its centre of gravity."""
    section = rss.section_2d(rss.lewis_section(10.0, 8.0, 0.95), np.linspace(0.1, 4.0, 60), gyradius=7.5,
                             centre_of_gravity=-1.0)
    data = section.select(("Sway", "Roll")).times(100.0).at((0.0, 0.0, -1.0))
    return data.replace(source="ship section, sway and roll")


def constant_coefficients(data):
    """Return the model that many simulators use: A and B of the natural frequency as constants; one dof."""
    A, omega = data.A[:, 0, 0], data.omega
    at = int(np.argmin(np.abs(data.C[0, 0] - omega**2 * (data.M[0, 0] + A))))
    nothing = rss.RadiationFit(data.dofs, np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0, method="none")
    model = rss.Model(data.dofs, data.M, data.A[at], data.C, nothing, D=data.B[at], hydro=data,
                      name="constant_coefficients")
    return model, float(omega[at])


def save(figures):
    """Write figures, a dictionary by file name, into the folder after --out on the command line, where there is one."""
    options = argparse.ArgumentParser()
    options.add_argument("--out", type=Path, help="folder for pictures")
    folder = options.parse_known_args()[0].out
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in figures.items():
            figure.savefig(folder / f"{name}.png", dpi=110)
