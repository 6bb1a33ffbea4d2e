"""Table 3: mean of the final parameters over repeated runs, three seas, by several readings of the paper's noise."""

import numpy as np
from tank import CASES, TABLE_3, heave_model, options, printed, sail

import radiation_ss as rss
from radiation_ss.filter import FilterStudy

Q = 8.0739e-5  # section 5.1
READINGS = {"as printed": {}, "motion first": {"order": "motion-first"},
            "Q of theta / 100": {"Q_theta": Q / 100.0}, "theta without noise": {"Q_theta": 0.0}}


def main():
    model, runs = heave_model(), options().runs
    filter_ = rss.DualEnKF(model)
    start, names = filter_.parts.theta, [name.split(".")[1] for name in filter_.parts.names]
    rows = []
    for case, t01 in CASES.items():
        record, force = sail(model, t01)
        rows.append([f"{case}, the paper's", *(np.array(TABLE_3[case]) / TABLE_3["2D-BEM"]), "", "", ""])
        for title, reading in READINGS.items():
            study = FilterStudy(model, record, preset="paper", n_ensemble=100, **reading)
            results = rss.repeat(study, runs, seed=3)
            final = results["theta"][~results["diverged"]] / start
            off = [force_error(model, record, force, seed, reading) for seed in range(5)]
            rows.append([f"{case}, {title}", *final.mean(axis=0), f"{final.std(axis=0, ddof=1).max():.2g}",
                         f"{np.median(off):.2f}", str(int(results["diverged"].sum()))])
    printed(rows, ["mean over start", *names, "largest spread of a run", "force error", "diverged"])
    print(f"{runs} runs of each, 100 members")


def force_error(model, record, force, seed, reading):
    """Return the force's error relative to its rms after 2 s, of one run."""
    estimate = rss.DualEnKF(model, preset="paper", seed=seed, omega=[8.0], **reading).run(record)
    late = estimate.time >= 2.0
    return np.sqrt(np.mean((estimate.force.mean - force)[:, late] ** 2)) / force[:, late].std()


if __name__ == "__main__":
    main()
