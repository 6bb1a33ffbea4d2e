"""
Roll damping of a ship section
==============================

Roll damping of a ship section: stabilising moment on roll, sway and roll coupled by the radiated waves.

Run: python examples/05_roll_damping.py [--out FOLDER]
The model is about the centre of gravity. A rate controller behind an actuator lag is tuned to halve the roll, on the
right model and on two wrong ones: without the coupling L24, and without radiation damping. Feedback hardly sees
the difference (the nu-gap from moment to roll rate is small, the margins stay). The waves do, because they roll the
ship through sway: the gain comes out wrong.
"""

import control as ct
import numpy as np
from bodies import rss, save, ship_section
from scipy.optimize import brentq

from radiation_ss.simulation import linear_response
from radiation_ss.waves.force import exciting_force

SEA, LAG = rss.jonswap(4.0, tp=9.0), 0.5
VISCOUS = 0.02  # share of critical damping in roll that is not radiation; a tenth in the mooring


def bodies():
    """Return the coupled model, the one without coupled radiation, and the one with A_inf alone."""
    data = ship_section()
    mooring = 0.02 * (data.M + data.A_inf)[0, 0]
    inertia = (data.M + data.A_inf)[1, 1]
    natural = np.sqrt(data.C[1, 1] / inertia)
    fit = rss.fit_radiation(data, 4)
    damping = {"Sway": 2.0 * 0.1 * np.sqrt(mooring * (data.M + data.A_inf)[0, 0]),
               "Roll": 2.0 * VISCOUS * inertia * natural}
    model = rss.Model.from_hydro(data, fit).attached(stiffness={"Sway": mooring}, damping=damping)
    alone = [rss.fit_radiation(data.select(dof), 4) for dof in data.dofs]
    a = np.block([[alone[0].a, np.zeros((alone[0].states, alone[1].states))],
                  [np.zeros((alone[1].states, alone[0].states)), alone[1].a]])
    b, c = np.zeros((a.shape[0], 2)), np.zeros((2, a.shape[0]))
    b[:alone[0].states, :1], b[alone[0].states:, 1:] = alone[0].b, alone[1].b
    c[:1, :alone[0].states], c[1:, alone[0].states:] = alone[0].c, alone[1].c
    apart = model.replace(fit=rss.RadiationFit(data.dofs, a, b, c, 4), A_inf=np.diag(np.diag(model.A_inf)))
    none = model.replace(fit=rss.RadiationFit(data.dofs, np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), 0))
    return {"coupled": model, "no coupling": apart, "A_inf alone": none}, float(natural)


def roll_plant(model):
    """Return the plant from commanded moment to roll rate, with the actuator's lag."""
    actuator = ct.tf([1.0], [LAG, 1.0])
    system = rss.cummins(model)
    return ct.ss(system["roll_vel", "roll_force"] * ct.ss(actuator))


def rate_gain(model, wanted):
    """Return the rate gain [N m s/rad] with which this model predicts an rms roll of `wanted` [rad]."""
    critical = 2.0 * np.sqrt(model.C[1, 1] * (model.M + model.A_inf)[1, 1])
    return float(brentq(lambda gain: roll_rms(model, gain) - wanted, 0.0, 3.0 * critical, rtol=1e-3))


def roll_rms(model, gain, seed=0):
    """Return rms roll [rad] in the sea, the lagging actuator in the loop."""
    sea = rss.realise(SEA, 1800.0, 0.2, seed=seed)
    force = exciting_force(model, sea)
    body = rss.cummins(model)
    n = body.nstates
    rate = body.C[body.find_output("roll_vel")]
    a = np.block([[body.A, body.B[:, 1:]], [-gain / LAG * rate[None], np.array([[-1.0 / LAG]])]])
    loop = ct.ss(a, np.vstack([body.B, np.zeros((1, 2))]), np.eye(n + 1)[n - 3:n - 2], np.zeros((1, 2)))
    return float(linear_response(loop, sea.time, force).outputs[0, sea.time > 120.0].std())


def study():
    """Return rms roll, margins and gaps."""
    models, natural = bodies()
    real = models["coupled"]
    plant = roll_plant(real)
    scale = {"input_scale": 0.05 * real.C[1, 1], "output_scale": 0.05 * natural}
    free = roll_rms(real, 0.0)
    wanted, rows = 0.5 * free, {}
    for name, model in models.items():
        gain = rate_gain(model, wanted)
        margins = ct.stability_margins(plant * gain)
        rows[name] = {"gain": gain, "roll": roll_rms(real, gain), "predicted": roll_rms(model, gain),
                      "phase_margin": float(margins[1]), "margin": rss.robust_margin(plant, gain, **scale),
                      "gap": rss.gap_metric(plant, roll_plant(model), **scale)}
    return {"rows": rows, "free": free, "natural": natural, "plant": plant, "models": models}


def draw(found):
    """Save Bode of roll per sway force, where the models differ, and Nyquist of the loop."""
    from matplotlib import pyplot as plt

    figures = {}
    omega = np.geomspace(0.1, 4.0, 400)
    shown = [name for name in found["models"] if name != "no coupling"]  # there a sway force does not roll the ship
    plt.figure()
    ct.bode_plot([rss.cummins(found["models"][name])["roll", "sway_force"] for name in shown], omega, label=shown,
                 title="Roll per sway force (without coupling: none)")
    figures["05_bode"] = plt.gcf()
    gain = found["rows"]["coupled"]["gain"]
    plt.figure()
    ct.nyquist_plot(found["plant"] * gain, np.unique(np.r_[np.geomspace(1e-3, 1e3, 2000), np.linspace(0.4, 0.6, 500)]),
                    indent_radius=1e-7, title="Loop of the rate controller")
    figures["05_nyquist"] = plt.gcf()
    return figures


def main():
    found = study()
    print(f"natural roll {found['natural']:.2f} rad/s; free roll {np.degrees(found['free']):.2f} deg rms")
    for name, row in found["rows"].items():
        print(f"tuned on {name}: gain {row['gain']:.3g} N m s/rad, predicted {np.degrees(row['predicted']):.2f} deg, "
              f"the ship rolls {np.degrees(row['roll']):.2f} deg rms; phase margin {row['phase_margin']:.0f} deg, "
              f"b(P, C) {row['margin']:.3f}, nu-gap of the models {row['gap']:.3f}")
    save(draw(found))


if __name__ == "__main__":
    main()
