"""
LQG on heave with an estimated wave force
=========================================

LQG on heave: the dual filter's force becomes the disturbance model of the controller.

Run: python examples/04_lqg_heave.py [--out FOLDER]

1. The body floats freely; from its motion alone the dual filter estimates the wave force.
2. The spectrum of that force gives a resonant disturbance model; LQG is designed on body and disturbance together.
3. The loop runs in another sea of the same spectrum. Beside it: LQG that takes the force for white noise, and LQG
   designed with constant coefficients. A strong loop on a good sensor hides the wrong model; its margin does not.
"""

import control as ct
import numpy as np
from bodies import constant_coefficients, rss, save, tank_heave
from scipy.signal import welch

from radiation_ss.design.gap_metric import hinf_norm
from radiation_ss.simulation import linear_response
from radiation_ss.waves.force import exciting_force

SEA, DT, NOISE = rss.jonswap(0.01, t01=0.9), 0.01, 2e-5


def free_record(model, seed):
    """Return a record of the free body in the sea (motion only), and the force that it hides."""
    sea = rss.realise(SEA, 60.0, DT, seed=seed)
    force = exciting_force(model, sea)
    motion = linear_response(model, sea.time, force).outputs
    rng = np.random.default_rng(seed + 100)
    sigma = np.array([NOISE, 1e-4, 2e-3])[:, None]
    measured = motion + sigma * rng.standard_normal(motion.shape)
    names = ("Heave", "Heave_velocity", "Heave_acceleration")
    return rss.Record(sea.time, dict(zip(names, measured)), kind="motion-only"), force[0]


def disturbance(force):
    """Return (a, b, c) of a second-order model of a force record: its variance, centre frequency and band width."""
    f, S = welch(force - force.mean(), fs=1.0 / DT, nperseg=1024)
    w = 2.0 * np.pi * f
    inside = (w > 2.0) & (w < 20.0)
    m0, m1, m2 = (np.trapezoid(w[inside] ** k * S[inside], w[inside]) for k in (0, 1, 2))
    centre, width = m1 / m0, np.sqrt(max(m0 * m2 / m1**2 - 1.0, 1e-4))
    a = np.array([[0.0, 1.0], [-(centre**2), -2.0 * width * centre]])
    intensity = 4.0 * width * centre**3 * np.var(force)  # stationary variance of the first state is that of the force
    return a, np.array([[0.0], [np.sqrt(intensity)]]), np.array([[1.0, 0.0]]), centre


def lqg(model, shape=None, white=1.0):
    """Return the LQG controller from measured heave to force; the force follows `shape`, or is white without one."""
    plant = rss.cummins(model)
    a, b, c = plant.A, plant.B, plant.C[:1]
    n = a.shape[0]
    drive = b * np.sqrt(white)
    if shape is not None:
        ad, bd, cd = shape[:3]
        a = np.block([[a, b @ cd], [np.zeros((2, n)), ad]])
        drive = np.vstack([np.zeros((n, 1)), bd])
        b, c = np.vstack([b, np.zeros((2, 1))]), np.hstack([c, np.zeros((1, 2))])
    stiffness = model.C[0, 0]
    Q = np.zeros_like(a)
    Q[n - 2, n - 2] = 1.0
    K, _, _ = ct.lqr(a, b, Q, [[(0.5 / stiffness) ** 2]])
    L, _, _ = ct.lqe(a, drive, c, [[1.0]], [[NOISE**2 * DT]])
    return ct.ss(a - b @ K - L @ c, L, K, 0.0, inputs=["heave"], outputs=["heave_force"], name="lqg")


def run(model, controller, seed):
    """Return rms heave [m] and rms control force [N] of the loop in another sea, noise on the sensor."""
    sea = rss.realise(SEA, 300.0, DT, seed=seed)
    plant = rss.cummins(model)
    wave = exciting_force(model, sea)[0]
    noise = NOISE * np.random.default_rng(seed).standard_normal(wave.size)
    # Inputs (wave force, sensor noise); u = -controller (heave + noise).
    c = plant.C[:1]
    a = np.block([[plant.A, -plant.B @ controller.C], [controller.B @ c, controller.A]])
    b = np.block([[plant.B, np.zeros_like(plant.B)], [np.zeros((controller.nstates, 1)), controller.B]])
    read = np.block([[c, np.zeros((1, controller.nstates))], [np.zeros((1, plant.nstates)), -controller.C]])
    loop = ct.ss(a, b, read, np.zeros((2, 2)))
    y = linear_response(loop, sea.time, np.stack([wave, noise])).outputs
    return y[:, sea.time > 30.0].std(axis=1)


def peak(system):
    """Return the largest gain over all frequencies."""
    return hinf_norm(system.A, system.B, system.C, system.D)


def study(seed=0):
    """Return rms heave and force of each design, margins, and how good the estimated force was."""
    data = tank_heave()
    model = rss.Model.from_hydro(data, rss.fit_radiation(data, 3))
    record, force = free_record(model, seed)
    guess = rss.DualEnKF(model, seed=seed).run(record).force.mean[0]
    half = model.replace(fit=model.fit.replace(c=0.5 * model.fit.c))
    spoilt = rss.DualEnKF(half, seed=seed).run(record).force.mean[0]
    shape = disturbance(guess)
    flat, _ = constant_coefficients(data)
    white = np.var(guess) / shape[3]
    designs = {"LQG, force from the dual filter": lqg(model, shape), "LQG, white force": lqg(model, white=white),
               "the same, designed with constant coefficients": lqg(flat, shape)}
    sea = rss.realise(SEA, 300.0, DT, seed=seed + 1)
    idle = linear_response(model, sea.time, exciting_force(model, sea)).outputs[0, sea.time > 30.0].std()
    plant, C = rss.cummins(model)[0, 0], model.C[0, 0]
    rows = {}
    for name, controller in designs.items():
        heave, effort = run(model, controller, seed + 1)
        rows[name] = {"heave": float(heave / idle), "effort": float(effort / np.std(force)),
                      "margin": rss.robust_margin(plant, controller, input_scale=C),
                      "sensitivity": peak(ct.feedback(1, plant * controller))}
    error, spoilt_error = (float(np.std((f - force)[500:]) / np.std(force)) for f in (guess, spoilt))
    gap = rss.gap_metric(plant, rss.cummins(flat)[0, 0], input_scale=C)
    return {"rows": rows, "force_error": error, "spoilt_error": spoilt_error, "centre": shape[3], "plant": plant,
            "designs": designs, "gap": gap}


def draw(found):
    """Save Bode of heave per force, free and controlled, and Nyquist of the loops."""
    from matplotlib import pyplot as plt

    figures = {}
    omega = np.geomspace(1.0, 40.0, 400)
    loops = [found["plant"]] + [ct.feedback(found["plant"], c) for c in found["designs"].values()]
    plt.figure()
    ct.bode_plot(loops, omega, label=["free", *found["designs"]],
                 title="Heave per wave force, free and controlled", legend_map=np.array([[None], ["lower left"]]))
    figures["04_bode"] = plt.gcf()
    plt.figure()
    ct.nyquist_plot([found["plant"] * c for c in found["designs"].values()], np.geomspace(1e-3, 1e3, 2000),
                    label=list(found["designs"]), title="Loops of the LQG designs")
    figures["04_nyquist"] = plt.gcf()
    return figures


def main():
    found = study()
    print(f"dual filter: force error {found['force_error']:.2f} of its rms, {found['spoilt_error']:.2f} with radiation "
          f"half as strong; centre frequency {found['centre']:.1f} rad/s")
    for name, row in found["rows"].items():
        print(f"{name}: heave {row['heave']:.2f} of the free body's, control force {row['effort']:.2f} of the wave's, "
              f"margin b(P, C) {row['margin']:.3f}, largest sensitivity {row['sensitivity']:.2f}")
    print(f"nu-gap between the body and the one with constant coefficients: {found['gap']:.3f}")
    save(draw(found))


if __name__ == "__main__":
    main()
