"""Records whose sensors err in ways that no model states: no gap is found where there is none."""

import numpy as np
import pytest
from fit_systems import data_of, random_passive
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import radiation_ss as rss
from radiation_ss.diagnosis import contradiction


def roll():
    return rss.body(dof="Roll", mass=993.0, GM=0.0843, gyradius=0.341, period=2.545, damping_ratio=0.01)


def heave():
    return rss.body(dof="Heave", mass=2.0, added_mass=1.0, C=8.0, damping_ratio=0.05)


def driven(model, rng, periods=60, force=0.0):
    """Fine times, an irregular force and the motion by a library integrator; `force` is one more of x."""
    total, C, D = (float(part[0, 0]) for part in (model.M + model.A_inf, model.C, model.D))
    w = np.sqrt(C / total)
    time = np.arange(0.0, periods * 2 * np.pi / w, 2 * np.pi / w / 240)
    waves, phase, size = w * np.exp(rng.uniform(-0.7, 0.7, 60)), rng.uniform(0, 6.28, 60), rng.normal(size=60)
    pull = 0.0125 * C * np.cos(np.outer(time, waves) + phase) @ size * np.clip(time * w / 20.0, 0, 1)
    at = CubicSpline(time, pull)

    def rate(t, s):
        return [s[1], (at(t) - D * s[1] - C * s[0] - (force(t, s[0]) if callable(force) else 0.0)) / total]

    moved = solve_ivp(rate, time[[0, -1]], [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-10, max_step=time[1] * 8).y[0]
    return time, at, CubicSpline(time, moved)


def recorded(model, rng, kind, name):
    """A record of 30 samples a period with 3 % noise of the motion itself, or times that are off by .4 samples."""
    time, force, moved = driven(model, rng)
    even = time[::8][:-1]
    jitter = 0.4 * even[1] * rng.uniform(-1, 1, even.size) if kind == "jitter" else 0.0
    read = moved(np.clip(even + jitter, 0.0, time[-1])) * (1 + (kind == "noise") * 0.03 * rng.normal(size=even.size))
    read += 0.001 * np.std(read) * rng.normal(size=even.size)
    dof = model.dofs[0]
    return rss.Record(even, {dof: read, f"{dof}_force": force(even)}, kind="forced", name=name)


@pytest.mark.parametrize("kind", ["noise", "jitter"])
def test_errors_that_grow_with_the_motion_are_no_gap(kind):
    answers = []
    for model in (roll(), heave()):
        for seed in range(3):
            rng = np.random.default_rng(seed)
            seen, unseen = (recorded(model, rng, kind, name) for name in ("seen", "unseen"))
            answers.append(rss.diagnose(model, seen, withhold=unseen).verdict)
    assert not any(answer.effects for answer in answers)
    assert sum(answer.status == "no_gap" for answer in answers) >= 5  # of six: an excess of two deviations is chance


def test_end_stops_are_found_beside_a_slow_force():
    """Stops at 60 % of the largest motion, as stiff as the body's restoring four times over, and a slow push."""
    model, rng = heave(), np.random.default_rng(5)
    time, force, moved = driven(model, rng)
    gap = 0.6 * float(np.abs(moved(time)).max())

    def extra(t, x):
        return 32.0 * (max(x - gap, 0.0) - max(-x - gap, 0.0)) - 0.05 * gap * 8.0 * np.sin(2 * np.pi * t / time[-1])

    records = []
    for name, seed in (("seen", 5), ("unseen", 6)):
        time, force, moved = driven(model, np.random.default_rng(seed), force=extra)
        even = time[::8]
        read = moved(even) + 0.005 * np.std(moved(even)) * rng.normal(size=even.size)
        records.append(rss.Record(even, {"Heave": read, "Heave_force": force(even)}, kind="forced", name=name))
    found = rss.diagnose(model, records[0], withhold=records[1])
    sets = found.verdict.indistinguishable or [[effect.name for effect in found.verdict.effects]]
    assert sets and all("end_stop" in labels for labels in sets) and found.budget.after < 0.05 < found.budget.before
    value, std = next(row for row in found.budget.rows if row.cause == "end_stop").parameters["gap"]
    assert 0.0 < std and abs(value - gap) < 0.1 * gap


@pytest.mark.parametrize("share", [0.0, 0.1, 0.2])
def test_what_contradicts_itself_is_told_of_the_coefficients(share):
    """Damping of a passive system, its coupling moved in one direction only, of the largest damping."""
    omega = np.linspace(0.1, 12.0, 120)
    data = data_of(*random_passive(4, 2, 0), omega, dofs=("Surge", "Heave"), A_inf=np.eye(2))
    B = data.B.copy()
    largest = np.abs(B).max()
    B[:, 0, 1] += share * largest * np.exp(-((omega - 4.0) ** 2))
    model = rss.Model(data.dofs, M=np.eye(2), A_inf=np.eye(2), C=np.eye(2), fit=rss.fit_radiation(data, order=2),
                      hydro=data.replace(B=B))
    # Of the damping of the two motions themselves, and where it makes the damping negative by that.
    assert 0.8 * share <= contradiction(model) <= 2.0 * share
