"""Sections 5.2's runs, shared by Figs. 14 to 17: start 15 % off, no constraint and constraints at K b = 1, 3, 10."""

from functools import lru_cache

import numpy as np
from tank import figure, force_error, frequency, options, perturbed, printed, sail, sway_roll_model, wavenumber

import radiation_ss as rss

CONSTRAINTS = {"no constraint": (), "K b = 1": (1.0,), "K b = 3": (3.0,), "K b = 10": (10.0,)}
RANK = "paper: without a constraint worse than the start; K b = 1 best, 10 worst, all useful"


@lru_cache
def runs(preset, seed=0):
    """Return {constraint: estimate}, the record's force and the start, for one seed."""
    body = sway_roll_model()
    start = perturbed(body, seed)
    record, force = sail(body, 1.0, seed=seed)
    members = 500 if options().full else 100
    w = np.linspace(frequency(0.1), frequency(4.0), 80)
    found = {}
    for name, Kb in CONSTRAINTS.items():
        try:
            found[name] = rss.DualEnKF(start, preset=preset, seed=seed, n_ensemble=members, omega=w,
                                       points=list(frequency(Kb))).run(record)
        except rss.SolverError as error:
            print(f"{name}: {error}")
    return found, force, start


def truth(w):
    """Return the section solver's K about the centre of gravity, shape (nw, 2, 2)."""
    data = sway_roll_model().hydro
    return np.stack([np.interp(w, data.omega, column) for column in data.K.reshape(-1, 4).T], 1).reshape(-1, 2, 2)


def compare(name, j, k, label):
    """Print the error of entry jk in 0.2 < K b < 3 for both filters, and draw the default filter's."""
    rows, seeds = [], range(options().seeds)
    for preset, title in (("paper", "paper's filter"), (None, "default")):
        for constraint in CONSTRAINTS:
            ratios = []
            for seed in seeds:
                found, _, start = runs(preset, seed)
                if constraint in found:
                    w, K = found[constraint].omega, found[constraint].K[:, j, k]
                    near = (wavenumber(w) > 0.2) & (wavenumber(w) < 3.0)
                    true, first = truth(w)[near, j, k], start.fit.frequency_response(w)[near, j, k]
                    ratios.append(np.linalg.norm(K[near] - true) / np.linalg.norm(first - true))
            rows.append([title, constraint, np.median(ratios) if ratios else "diverged"])
    printed(rows, ["", f"{label}: error after / before, median of {len(seeds)}", "ours"])
    print(RANK)

    def draw(axes):
        for row, preset in zip(axes, ("paper", None)):
            found, _, start = runs(preset, 0)
            w = start.hydro.omega[(start.hydro.omega > frequency(0.1)) & (start.hydro.omega < frequency(4.0))]
            true, first = truth(w)[:, j, k], start.fit.frequency_response(w)[:, j, k]
            for ax, part in zip(row, (lambda z, w: z.imag / w, lambda z, w: z.real)):
                ax.plot(wavenumber(w), part(true, w), "ko", ms=2.5, label="section solver")
                ax.plot(wavenumber(w), part(first, w), ":", color="0.5", label="start")
                for constraint, estimate in found.items():
                    ax.plot(wavenumber(estimate.omega), part(estimate.K[:, j, k], estimate.omega), label=constraint)
                reach = np.ptp(part(true, w)) + 1e-9
                ax.set(ylim=(part(true, w).min() - reach, part(true, w).max() + reach), xlabel="K b")
            row[0].set(ylabel=f"A - A$_{{inf}}$, {label}", title="paper's filter" if preset else "default")
            row[1].set(ylabel=f"B, {label}")
        axes[0, 0].legend(fontsize=6)

    figure(name, draw, nrows=2, ncols=2, figsize=(8.0, 5.6))


def forces(name):
    """Print the force's error for each constraint and both filters, and draw the default filter's."""
    rows, seeds = [], range(options().seeds)
    for preset, title in (("paper", "paper's filter"), (None, "default")):
        for constraint in CONSTRAINTS:
            results = [np.concatenate(force_error(found[constraint], force))
                       for found, force, _ in (runs(preset, seed) for seed in seeds) if constraint in found]
            *error, sway, roll = np.median(results, axis=0)
            rows.append([title, constraint, *error, f"{100 * sway:.0f} %", f"{100 * roll:.0f} %"])
    printed(rows, ["", f"medians of {len(seeds)}", "sway NRMSE", "roll NRMSE", "sway band covers", "roll band covers"])
    print("paper: 'almost the same behavior for all the constrained frequencies', no number given")
    found, force, _ = runs(None)

    def draw(axes):
        for column, (constraint, estimate) in enumerate(list(found.items())[1:]):
            part = estimate.time < 10.0
            for i, ax in enumerate(axes[:, column]):
                mean, low, high = (values[i, part] for values in estimate.force)
                ax.fill_between(estimate.time[part], low, high, alpha=0.25)
                ax.plot(estimate.time[part], mean)
                ax.plot(estimate.time[part][::8], force[i, part][::8], "k.", ms=3)
            axes[0, column].set(title=constraint)
            axes[1, column].set(xlabel="t [s]")
        axes[0, 0].set(ylabel="sway [N]")
        axes[1, 0].set(ylabel="roll [N m]")

    figure(name, draw, nrows=2, ncols=3, figsize=(9.0, 4.4), sharex=True, sharey="row")
