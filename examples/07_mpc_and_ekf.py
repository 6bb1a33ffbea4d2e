"""
Model predictive control and an extended Kalman filter
======================================================

Both are designed for a body with nonlinear effects.

Run: python examples/07_mpc_and_ekf.py [--out FOLDER]

The corrected plant is one CasADi function, so both come from it: the filter takes its Jacobian, the controller puts it
into an optimal control problem. The filter knows the noisy displacement only; it estimates motion, radiation states and
the wave force, a narrow-band process. The controller holds the body still with a limited force.
"""

import casadi as ca
import numpy as np
from bodies import rss, save, tank_heave
from matplotlib import pyplot as plt

from radiation_ss import style
from radiation_ss.simulation import state_equations

SEA, DT, NOISE, LIMIT, HORIZON = rss.jonswap(0.02, t01=0.9), 0.05, 1e-4, 4.0, 20
EFFECTS = [("quadratic_drag", {"coefficient": 90.0}), ("cubic_stiffness", {"stiffness": 2e5})]


def step_of(model):
    """Return one step of body and wave force as a function of (x, control): x is the plant's state, force, its rate."""
    rate, n = state_equations(model, EFFECTS), model.fit.states + 2
    x, u = ca.SX.sym("x", n + 2), ca.SX.sym("u")
    centre, damping = 2.0 * np.pi / SEA.t01, 0.2
    wave = ca.vertcat(x[n + 1], -(centre**2) * x[n] - 2.0 * damping * centre * x[n + 1])
    whole = ca.Function("whole", [x, u], [ca.vertcat(rate(0.0, x[:n], x[n] + u)[0], wave)])
    k1 = whole(x, u)
    k2 = whole(x + DT / 2 * k1, u)
    k3 = whole(x + DT / 2 * k2, u)
    after = x + DT / 6 * (k1 + 2 * k2 + 2 * k3 + whole(x + DT * k3, u))
    return ca.Function("step", [x, u], [after]), ca.Function("slope", [x, u], [ca.jacobian(after, x)]), n


def controller(step, n):
    """Return a function from the estimated state to the control: least motion and force over the horizon."""
    u, start, cost = ca.SX.sym("u", HORIZON), ca.SX.sym("start", n + 2), 0.0
    x = start
    for k in range(HORIZON):
        x = step(x, u[k])
        cost += (x[n - 2] / 0.01) ** 2 + 0.01 * u[k] ** 2
    quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
    solver = ca.nlpsol("mpc", "ipopt", {"x": u, "f": cost, "p": start}, quiet)
    last = np.zeros(HORIZON)

    def control(state):
        nonlocal last
        last = np.asarray(solver(x0=np.r_[last[1:], 0.0], p=state, lbx=-LIMIT, ubx=LIMIT)["x"]).ravel()
        return last[0]

    return control


def run(model, force, control=None):
    """Return true and estimated heave and wave force, and the control, in a sea; one row each."""
    step, slope, n = step_of(model)
    decide = controller(step, n) if control else lambda state: 0.0
    rng, size = np.random.default_rng(0), force.std()
    # The wave force's own noise keeps its variance; the body's states have none.
    Q, P, R = np.zeros((n + 2, n + 2)), np.diag(np.r_[np.full(n, 1e-4), size**2, (7.0 * size) ** 2]), NOISE**2
    Q[-1, -1] = DT * 4.0 * 0.2 * (2.0 * np.pi / SEA.t01) ** 3 * size**2
    true, guess, rows = np.zeros(n + 2), np.zeros(n + 2), []
    for w in force:
        measured = true[n - 2] + NOISE * rng.standard_normal()
        gain = P[:, n - 2] / (P[n - 2, n - 2] + R)
        guess, P = guess + gain * (measured - guess[n - 2]), P - np.outer(gain, P[n - 2])
        u = float(decide(guess))
        rows.append([true[n - 2], guess[n - 2], w, guess[n], u])
        F = np.asarray(slope(guess, u))
        guess, P = np.asarray(step(guess, u)).ravel(), F @ P @ F.T + Q
        true = np.asarray(step(np.r_[true[:n], w, 0.0], u)).ravel()
    return np.array(rows).T


def study(duration=20.0):
    """Return times and the run without and with control."""
    model = rss.Model.from_hydro(tank_heave(), order=3)
    sea = rss.realise(SEA, duration, DT, seed=1, directions=model.hydro.directions)
    force = rss.exciting_force(model, sea)[0]
    return sea.time, run(model, force), run(model, force, control=True)


def draw(found):
    """Draw heave without and with control, and the forces."""
    time, free, held = found
    with style.look():
        figure, (upper, lower) = plt.subplots(2, 1, figsize=(7.0, 4.8), sharex=True)
    upper.plot(time, 1e3 * free[0], label="free")
    upper.plot(time, 1e3 * held[0], label="controlled")
    for row, label, line in ((2, "wave force", "-"), (3, "estimated", "--"), (4, "control", ":")):
        lower.plot(time, held[row], line, label=label)
    upper.set_ylabel("heave [mm]")
    lower.set(ylabel="force [N]", xlabel="time [s]")
    for axes in (upper, lower):
        axes.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return {"07_mpc_and_ekf": figure}


def main():
    found = study()
    for name, (heave, _, wave, estimated, control) in zip(("free", "controlled"), found[1:]):
        print(f"{name:11s} heave {1e3 * heave.std():5.2f} mm rms, control {np.abs(control).max():.2f} N at most, "
              f"wave force off by {(estimated - wave).std() / wave.std():.0%}")
    save(draw(found))


if __name__ == "__main__":
    main()
