"""
A wave-energy absorber with a passive power take-off
====================================================

A wave-energy absorber with a passive power take-off: one damper, tuned to the sea.

Run: python examples/02_passive_wave_energy.py [--out FOLDER]
The power of a damper c is the mean of c v^2. It is computed twice: from the spectrum, and from a simulation of the
composite in a random sea. Then the damper is tuned on two wrong radiation models and run on the right one.
"""

import numpy as np
from bodies import absorber, constant_coefficients, rss, save
from scipy.optimize import minimize_scalar

from radiation_ss.simulation import linear_response
from radiation_ss.waves.force import exciting_force, transfer

SEA = rss.jonswap(1.0, tp=5.0)


def mean_power(model, damper, sea=SEA):
    """Return the mean power [W] of a damper in a sea: c times the variance of the velocity."""
    omega = np.linspace(0.6, 5.9, 800)
    K = model.fit.frequency_response(omega)[:, 0, 0]
    M, C = (model.M + model.A_inf)[0, 0], model.C[0, 0]
    velocity = transfer(model.hydro, omega)[:, 0] / (1j * omega * M + K + damper + C / (1j * omega))
    return float(damper * np.trapezoid(np.abs(velocity) ** 2 * sea(omega), omega))


def best_damper(model):
    """Return the damper [N s/m] of the largest mean power that this model predicts."""
    found = minimize_scalar(lambda log: -mean_power(model, np.exp(log)), bounds=(7.0, 16.0), method="bounded")
    return float(np.exp(found.x))


def simulated_power(model, damper, seed=0, duration=1800.0):
    """Return the mean and the largest power [W] of a simulation in a random sea."""
    sea = rss.realise(SEA, duration, 0.1, seed=seed)
    motion = linear_response(model.attached(damping={"Heave": damper}), sea.time, exciting_force(model, sea))
    power = damper * motion.outputs[1, sea.time > 60.0] ** 2
    return float(power.mean()), float(power.max())


def study():
    """Return dampers, predicted and real powers [W]."""
    data = absorber()
    right = rss.Model.from_hydro(data, rss.fit_radiation(data, 6))
    flat, _ = constant_coefficients(data)
    half = right.replace(fit=right.fit.replace(c=0.5 * right.fit.c))  # half the radiation
    rows = {}
    for name, model in (("right", right), ("constant coefficients", flat), ("half the radiation", half)):
        damper = best_damper(model)
        rows[name] = {"damper": damper, "predicted": mean_power(model, damper), "got": mean_power(right, damper)}
    mean, largest = simulated_power(right, rows["right"]["damper"])
    omega, B = data.omega, data.B[:, 0, 0]
    bound = float(np.trapezoid(np.abs(transfer(data, omega)[:, 0]) ** 2 / (4.0 * B) * SEA(omega), omega))
    return {"rows": rows, "simulated": mean, "largest": largest, "bound": bound, "model": right}


def draw(found):
    """Save power against damper."""
    from radiation_ss import style

    figure, axes = style.figure(1, 1, size=(5.0, 3.2))
    dampers = np.geomspace(1e4, 1e6, 60)
    axes[0, 0].semilogx(dampers, [mean_power(found["model"], c) / 1e3 for c in dampers], color=style.BLUE)
    for (name, row), colour in zip(found["rows"].items(), (style.GREEN, style.VERMILION, style.ORANGE)):
        axes[0, 0].plot(row["damper"], row["got"] / 1e3, "o", color=colour, label=f"tuned on: {name}")
    axes[0, 0].set(xlabel="damper [N s/m]", ylabel="mean power [kW]", title="Passive take-off, Hs = 1 m, Tp = 5 s")
    axes[0, 0].legend()
    return {"02_power": figure}


def main():
    found = study()
    print(f"no absorber can take more than {found['bound'] / 1e3:.1f} kW (half of what passes, in two dimensions)")
    for name, row in found["rows"].items():
        print(f"damper tuned on {name}: {row['damper'] / 1e3:.0f} kN s/m, predicted {row['predicted'] / 1e3:.1f} kW, "
              f"the sea gives {row['got'] / 1e3:.1f} kW")
    print(f"simulated with the right one: {found['simulated'] / 1e3:.1f} kW, at most {found['largest'] / 1e3:.0f} kW")
    save(draw(found))


if __name__ == "__main__":
    main()
