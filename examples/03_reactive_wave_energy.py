"""
Reactive control of a wave-energy absorber
==========================================

Reactive control of the same absorber: a damper and a negative spring tune it to the waves; what that costs.

Run: python examples/03_reactive_wave_energy.py [--out FOLDER]
Optimum for one frequency: the take-off's impedance is the conjugate of the body's. In a sea one spring and one damper
are optimised together. The spring moves power to and fro; the loop's margin shrinks; a radiation model that
is not passive predicts power that no sea has.
"""

import control as ct
import numpy as np
from bodies import absorber, constant_coefficients, rss, save
from scipy.optimize import minimize

from radiation_ss.simulation import linear_response
from radiation_ss.waves.force import exciting_force, transfer

SEA = rss.jonswap(1.0, tp=5.0)
OMEGA = np.linspace(0.6, 5.9, 800)


def velocity_transfer(model, take_off):
    """Return velocity per wave amplitude under take-off impedance `take_off` (nw,), and the impedance of the body."""
    K = model.fit.frequency_response(OMEGA)[:, 0, 0] + model.D[0, 0]
    body = 1j * OMEGA * (model.M + model.A_inf)[0, 0] + K + model.C[0, 0] / (1j * OMEGA)
    return transfer(model.hydro, OMEGA)[:, 0] / (body + take_off), body


def mean_power(model, spring, damper):
    """Return the mean power [W] of a spring and damper in the sea; only the damper takes any."""
    v, _ = velocity_transfer(model, damper + spring / (1j * OMEGA))
    return float(damper * np.trapezoid(np.abs(v) ** 2 * SEA(OMEGA), OMEGA))


def best(model):
    """Return spring [N/m] and damper [N s/m] of the largest power predicted, the static body staying stable."""
    C = model.C[0, 0]

    def loss(x):
        return -mean_power(model, -C / (1.0 + np.exp(-x[0])), np.exp(x[1]))

    found = minimize(loss, [-1.0, 12.0], method="Nelder-Mead", options={"maxiter": 400})
    return -C / (1.0 + np.exp(-found.x[0])), float(np.exp(found.x[1]))


def simulated(model, spring, damper, seed=0):
    """Return mean power, share of time in which the take-off feeds power in, and peak over mean, by simulation."""
    sea = rss.realise(SEA, 1800.0, 0.1, seed=seed)
    tuned = model.attached(stiffness={"Heave": spring}, damping={"Heave": damper})
    motion = linear_response(tuned, sea.time, exciting_force(model, sea)).outputs[:, sea.time > 60.0]
    power = (spring * motion[0] + damper * motion[1]) * motion[1]
    mean = float(power.mean())
    return {"mean": mean, "back": float(np.mean(power < 0.0)), "swing": float(np.ptp(power) / mean)}


def study():
    """Return powers [W], settings and margins."""
    data = absorber()
    right = rss.Model.from_hydro(data, rss.fit_radiation(data, 6))
    flat, _ = constant_coefficients(data)
    spoilt = right.replace(D=-0.9 * right.hydro.B[np.searchsorted(data.omega, 1.6)])  # a fit with too little damping
    rows = {}
    for name, model in (("right", right), ("constant coefficients", flat), ("not passive", spoilt)):
        spring, damper = best(model)
        rows[name] = {"spring": spring / model.C[0, 0], "damper": damper,
                      "predicted": mean_power(model, spring, damper), "got": mean_power(right, spring, damper)}
    spring, damper = rows["right"]["spring"] * right.C[0, 0], rows["right"]["damper"]
    plant = rss.cummins(right)
    take_off = ct.ss([], [], [], [[spring, damper, 0.0]], inputs=plant.output_labels, outputs=["heave_force"])
    loop = ct.ss(take_off * plant, inputs=["force"], outputs=["take_off"], name="take_off_loop")
    v, body = velocity_transfer(right, np.conj(velocity_transfer(right, 0.0)[1]))
    bound = float(np.trapezoid(body.real * np.abs(v) ** 2 * SEA(OMEGA), OMEGA))
    scales = {"input_scale": 0.1 * right.C[0, 0], "output_scale": [0.1, 0.15, 0.2]}
    passive = rss.robust_margin(plant, [[0.0, 1.9e5, 0.0]], **scales)
    return {"rows": rows, "bound": bound, "time": simulated(right, spring, damper), "loop": loop, "model": right,
            "margin": rss.robust_margin(plant, take_off, **scales), "passive_margin": passive,
            "gain_margin": gain_margin(loop)}


def gain_margin(loop):
    """Return the factor on the take-off at which the loop goes unstable, by python-control's Nyquist crossings."""
    gain, _, _, _, _, _ = ct.stability_margins(loop)
    return float(gain)


def draw(found):
    """Save the Nyquist curve of the take-off's loop."""
    from matplotlib import pyplot as plt

    figures = {}
    plt.figure()
    ct.nyquist_plot(found["loop"], np.geomspace(1e-3, 50.0, 2000), title="Loop of the reactive take-off")
    figures["03_nyquist"] = plt.gcf()
    return figures


def main():
    found = study()
    print(f"bound, conjugate impedance at every frequency: {found['bound'] / 1e3:.1f} kW")
    for name, row in found["rows"].items():
        print(f"tuned on {name}: spring {row['spring']:.2f} C, damper {row['damper'] / 1e3:.0f} kN s/m, "
              f"predicted {row['predicted'] / 1e3:.1f} kW, the sea gives {row['got'] / 1e3:.1f} kW")
    t = found["time"]
    print(f"simulated: {t['mean'] / 1e3:.1f} kW; power flows back {t['back']:.0%} of the time, "
          f"swing {t['swing']:.0f} times the mean")
    print(f"margin b(P, C): passive {found['passive_margin']:.3f}, reactive {found['margin']:.3f}; "
          f"gain margin {found['gain_margin']:.2f}")
    save(draw(found))


if __name__ == "__main__":
    main()
