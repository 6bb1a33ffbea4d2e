"""What the dual filter delivers on simulated tanks with known truth.

    OMP_NUM_THREADS=1 python benchmarks/dual_filter.py [--write] [--seeds 24]
"""


import numpy as np
from heave_tank import BAND, POINTS, TRUTH, error, known, sea_record, start, tank, with_force
from validation import arguments, publish, table

import radiation_ss as rss
from radiation_ss.records.record import Record


def trial(seed, duration=30.0, *, from_truth=False, force_known=False, **options):
    """Return K error after / before and after, force NRMSE, that of doing nothing, covers of force and parameters."""
    record, force = sea_record(seed, duration)
    if force_known:
        record = with_force(record, force, seed)
    model = tank() if from_truth else start(seed)
    try:
        estimate = rss.DualEnKF(model, seed=seed, omega=BAND, **options).run(record)
    except rss.SolverError:
        return [np.nan] * 6
    late = estimate.time > 2.0
    forces = (estimate.force.mean, estimate.baseline["force"])
    nrmse, idle = (np.std((f[0] - force)[late]) / force.std() for f in forces)
    inside = within(estimate, TRUTH)
    before = error(model.fit.frequency_response(BAND))
    after = error(estimate.K)
    return [after / before if before > 0.0 else np.nan, after, nrmse, idle,
            covered(estimate.force, force, late), np.mean(inside)]


def covered(band, force, late):
    """Return the share of late samples whose force lies in its band."""
    return np.mean(((force >= band.lower[0]) & (force <= band.upper[0]))[late])


def within(estimate, truth):
    """Return which parameters lie in their band; a rounding's width where nothing is uncertain."""
    return [p.lower - 1e-9 * abs(value) <= value <= p.upper + 1e-9 * abs(value)
            for p, value in zip(estimate.parameters.values(), truth)]


def medians(seeds, **options):
    results = np.array([trial(seed, **options) for seed in range(seeds)])
    lost = int(np.isnan(results[:, 1]).sum())
    ratio, after, nrmse, idle, cover, _ = np.nanmedian(results, axis=0) if not options.get(
        "from_truth") else [np.nan, *np.nanmedian(results[:, 1:], axis=0)]
    parameters = np.nanmean(results[:, 5])
    first = f"{ratio:.3g}" if np.isfinite(ratio) else f"(error {after:.2g})"
    beside = f", {lost} diverged" * (lost > 0)
    return [first, f"{nrmse:.3f}", f"{idle:.3f}", f"{cover:.0%}", f"{parameters:.0%}" + beside]


def damage(record, kind, rng):
    channels = {name: values.copy() for name, values in record.channels.items()}
    for name, values in channels.items():
        if kind == "20 % of samples missing":
            values[rng.random(values.size) < 0.2] = np.nan
        elif kind == "1 % spikes of 20 sigma":
            values[rng.random(values.size) < 0.01] += 20.0 * values.std()
        elif kind == "3 s gap":
            values[1200:1500] = np.nan
        elif kind == "velocity dies at 10 s" and name.endswith("velocity"):
            values[1000:] = values[999]
        elif kind == "displacement at 20 Hz, the rest at 100 Hz" and name == "Heave":
            values[np.arange(values.size) % 5 != 0] = np.nan
    if kind.startswith("only"):
        channels = {name: v for name, v in channels.items() if (kind.split()[1] == "displacement") == (name == "Heave")
                    and (name == "Heave" or name.endswith(kind.split()[1]))}
    return Record(record.time, channels)


def damaged(seeds):
    rows = []
    for kind in ("nothing", "20 % of samples missing", "1 % spikes of 20 sigma", "velocity dies at 10 s", "3 s gap",
                 "displacement at 20 Hz, the rest at 100 Hz", "only displacement", "only acceleration"):
        errors, covers = [], []
        for seed in range(seeds):
            record, force = sea_record(seed)
            estimate = rss.DualEnKF(start(seed), seed=seed, omega=BAND, points=known(POINTS)).run(
                damage(record, kind, np.random.default_rng(seed)))
            late = estimate.time > 2.0
            errors.append(np.std((estimate.force.mean[0] - force)[late]) / force.std())
            covers.append(covered(estimate.force, force, late))
        rows.append([kind, f"{np.median(errors):.3f}", f"{np.median(covers):.0%}"])
    return rows


def main(write, seeds):
    points = known(POINTS)
    cases = [("default, motion only, 30 s", {}), ("default, motion only, 600 s", {"duration": 600.0}),
             ("default, points {0.3, 1}", {"points": points}),
             ("default, point {1}", {"points": known(POINTS[1:])}),
             ("default, points {0.3, 1}, persistence", {"points": points, "force_model": "persistence"}),
             ("default, started at the truth, 600 s", {"from_truth": True, "duration": 600.0}),
             ("default, force known (1 % noise), 30 s", {"force_known": True}),
             ("default, force known (1 % noise), 600 s", {"force_known": True, "duration": 600.0}),
             ("learn='always' (its force model believed), 30 s", {"learn": "always"}),
             ("learn='always', 600 s", {"learn": "always", "duration": 600.0}),
             ("paper's filter, 30 s", {"preset": "paper"}),
             ("paper's filter, started at the truth, 30 s", {"preset": "paper", "from_truth": True}),
             ("paper's filter, points {0.3, 1}", {"preset": "paper", "points": points}),
             ("paper's filter, square root", {"preset": "paper", "analysis": "square-root"})]
    head = ["", "K error after / before", "force NRMSE", "prior model", "force band covers", "parameter bands cover"]
    rows = []
    for name, options in cases:
        rows.append([name, *medians(seeds, **options)])
        print(rows[-1], flush=True)
    publish("dual_filter", write, results=table(head, rows),
            damage=table(["what happens to the record", "force NRMSE", "force band covers"], damaged(seeds)),
            seeds=f"Medians over {seeds} tanks (cover of parameters: mean).")


if __name__ == "__main__":
    main(*arguments(__doc__, "dual_filter", seeds=24))
