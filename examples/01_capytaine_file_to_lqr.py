"""
From a Capytaine file to an LQR
===============================

From a Capytaine file to a controller: fit the radiation model, look at Bode and Nyquist, design an LQR.

Run: python examples/01_capytaine_file_to_lqr.py [--out FOLDER] [your.nc]
Without a file of yours it writes one from the section solver. A model with constant added mass
and damping, taken at the natural frequency, is compared with it.
"""

import sys
import tempfile
from pathlib import Path

import control as ct
import numpy as np
from bodies import absorber, constant_coefficients, rss, save
from scipy.linalg import solve_continuous_lyapunov


def own_file():
    """Write a Capytaine file of the half-cylinder and return its path."""
    path = Path(tempfile.mkdtemp()) / "absorber.nc"
    rss.write_hydro(absorber(), path)
    return path


def cost(plant, K, weight, force):
    """Return the LQR cost of u = -K x under a white force of intensity (0.1 C)^2 s: trace of the Lyapunov solution."""
    closed = plant.A - plant.B @ K
    spread = solve_continuous_lyapunov(closed, -plant.B @ plant.B.T * force**2)
    return float(np.trace((weight + K.T @ K / force**2) @ spread))


def study(path=None):
    """Return the systems and the numbers of the story."""
    data = rss.read_hydro(path or own_file())
    heave = data.select([dof for dof in data.dofs if dof.endswith("Heave")][:1])
    fit = rss.fit_radiation(heave, 4)
    model = rss.Model.from_hydro(heave, fit)
    plant = rss.cummins(model)
    constant, natural = constant_coefficients(heave)
    wrong = rss.cummins(constant)

    # LQR on the whole state; the cost is on motion and force only, in units of the static response to 10 % of C.
    force = 0.1 * model.C[0, 0]
    weight = np.diag([0.0] * fit.states + [1.0 / 0.1**2, 1.0 / (0.1 * natural) ** 2])
    K, _, _ = ct.lqr(plant, weight, [[1.0 / force**2]])
    # The same design with constant coefficients, on displacement and velocity, then run on the real body.
    K_wrong, _, _ = ct.lqr(wrong, weight[fit.states:, fit.states:], [[1.0 / force**2]])
    hoped = cost(wrong, K_wrong, weight[fit.states:, fit.states:], force)
    K_wrong = np.hstack([np.zeros((1, fit.states)), K_wrong])
    # Loop seen by the actuator, for Nyquist and margins; the plant with all states as outputs.
    states = ct.ss(plant.A, plant.B, np.eye(plant.nstates), np.zeros((plant.nstates, 1)), name="states")
    loop = ct.ss(plant.A, plant.B, K, 0.0, inputs=["heave_force"], outputs=["u"], name="lqr_loop")
    scale = {"input_scale": force, "output_scale": 0.1}
    numbers = {"relative_error": fit.relative_error, "passive": fit.passive, "natural": natural,
               "cost_with_radiation": cost(plant, K, weight, force), "cost_hoped": hoped,
               "cost_got": cost(plant, K_wrong, weight, force),
               "phase_margin": float(ct.margin(loop)[1]),
               "gap": rss.gap_metric(plant[0, 0], wrong[0, 0], **scale)}
    return {"model": model, "plant": plant, "wrong": wrong, "loop": loop, "states": states, **numbers}


def draw(found):
    """Save Bode and Nyquist plots, drawn by python-control."""
    from matplotlib import pyplot as plt

    figures = {}
    omega = np.geomspace(0.1, 10.0, 400)  # whole decades: readable marks on the axis
    plt.figure()
    ct.bode_plot([found["plant"][0, 0], found["wrong"][0, 0]], omega, title="Heave per force",
                 label=["radiation model", "constant coefficients"])
    figures["01_bode"] = plt.gcf()
    plt.figure()
    ct.nyquist_plot(found["loop"], np.geomspace(0.01, 100.0, 1000), title="LQR loop")
    figures["01_nyquist"] = plt.gcf()
    return figures


def main():
    found = study(next((word for word in sys.argv[1:] if word.endswith(".nc")), None))
    print(found["model"].fit)
    print(f"LQR with the radiation model: cost {found['cost_with_radiation']:.3f}, "
          f"phase margin {found['phase_margin']:.0f} deg")
    print(f"LQR designed with constant coefficients: predicted cost {found['cost_hoped']:.3f}, "
          f"actual cost {found['cost_got']:.3f}")
    print(f"nu-gap between the two plants: {found['gap']:.3f}")
    save(draw(found))


if __name__ == "__main__":
    main()
