"""Do the default filter's bands hold? Many tanks, drawn in two ways; what the filter sees of a force is told apart.

    OMP_NUM_THREADS=1 python benchmarks/filter_bands.py [--write] [--tanks 200]
"""


import numpy as np
from heave_tank import BAND, MASS, POINTS, STIFFNESS, drawn_about, error, known, sea_record, tank, with_force
from validation import arguments, publish, table

import radiation_ss as rss
from radiation_ss.filter import UncertainPlant
from radiation_ss.filter.prior import Evidence, finish

TRUTHS = {"start": "truth drawn", "truth": "start drawn"}
CASES = {"nothing known": (0.3, {}), "points {0.3, 1}": (0.3, {"points": POINTS}),
         "point {1}": (0.3, {"points": POINTS[1:]}),
         "force known (1 % noise), 30 s": (30.0, {"force": True})}


def off(filter_, truth):
    """Return the truth's distance in each direction of the record's information, in standard deviations of it.

    First as the filter has it, with d the change of theta; then with the straight line in u, the logarithm. (2, 6).
    """
    iterated = filter_.engine.iterated
    prior = iterated.drawing.prior
    u, at = prior.u(filter_.engine.state.theta[:, -2]), prior.u(truth)
    run = iterated.run_at(u)
    finish(iterated.take(run, filter_.engine.window.samples()))
    data = Evidence(u, run.gradient, run.information)
    values, vectors = np.linalg.eigh(data.information)
    best = np.linalg.solve(data.information, data.gradient)
    return np.array([np.sqrt(values) * ((d - best) @ vectors) for d in (data.change(prior, at), at - u)])


def trial(which, seed, duration, points=(), force=False):
    """Return K error after / before, covers of parameters, added mass and damping, and `off`."""
    model, truth = drawn_about(which, seed)
    record, exciting = sea_record(seed, duration, truth=truth)
    if force:
        record = with_force(record, exciting, seed)
    filter_ = rss.DualEnKF(model, seed=seed, omega=BAND, points=known(points, truth) if points else None)
    found = filter_.run(record)
    K = tank(truth).fit.frequency_response(BAND)
    A = model.A_inf + K.imag / BAND[:, None, None]
    inside = [np.mean([p.lower <= value <= p.upper for p, value in zip(found.parameters.values(), truth)])]
    inside += [np.mean((band.lower <= true) & (true <= band.upper)) for band, true in ((found.A, A), (found.B, K.real))]
    before = error(model.fit.frequency_response(BAND), truth)
    return error(found.K, truth) / before, inside, off(filter_, truth) if force else None


def named(seed, duration=20.0):
    """Return (mean - truth) / std of mass, stiffness and drag with a known force, and whether their bands hold.

    The record is exact for a force linear over .6 ms: these parameters are known to .04 %.
    """
    truth = {"mass": MASS, "stiffness": STIFFNESS, "drag": 5.0}

    def build(p):
        return tank().replace(M=[[p["mass"]]], C=[[p["stiffness"]]], D=[[p["drag"]]])

    record, force = sea_record(seed, duration, dt=0.01 / 16)
    force = force * np.minimum(record.time, 1.0)
    motion = rss.linear_response(build(truth), record.time, force).outputs[:, ::16]
    rng = np.random.default_rng(seed + 500)
    noisy = {f"Heave{s}": row + 0.01 * row.std() * rng.standard_normal(row.size)
             for s, row in zip(("", "_velocity", "_acceleration"), motion)}
    off = 1.0 + 0.12 * np.random.default_rng(seed).standard_normal(3)
    plant = UncertainPlant(build, {name: (value * factor, 0.15) for (name, value), factor in zip(truth.items(), off)})
    found = rss.DualEnKF(plant, seed=seed).run(with_force(rss.Record(record.time[::16], noisy), force[::16], seed))
    rows = [found.parameters[name] for name in truth]
    return ([(p.mean - value) / p.std for p, value in zip(rows, truth.values())],
            [p.lower <= value <= p.upper for p, value in zip(rows, truth.values())])


def main(write, tanks):
    z, inside = (np.array(part) for part in zip(*(named(seed) for seed in range(tanks // 5))))
    named_ones = (f"Mass, stiffness and drag of {len(z)} tanks as named parameters, force known, 20 s: "
                  f"{inside.sum()} of {inside.size} bands hold the truth; its rms distance is "
                  f"{' '.join(f'{v:.2f}' for v in np.sqrt(np.mean(z**2, axis=0)))} standard deviations.")
    print(named_ones, flush=True)
    rows, apart = [], []
    for which, title in TRUTHS.items():
        for case, (duration, given) in CASES.items():
            results = [trial(which, seed, duration, **given) for seed in range(tanks)]
            covers = 100.0 * np.array([inside for _, inside, _ in results])
            apart += [z for *_, z in results if z is not None]
            errors = covers.std(axis=0, ddof=1) / np.sqrt(tanks)
            rows.append([title, case, f"{np.median([ratio for ratio, *_ in results]):.3g}",
                         *(f"{c:.1f} ({e:.1f})" for c, e in zip(covers.mean(axis=0), errors))])
            print(rows[-1], flush=True)
    for row in np.sqrt(np.mean(np.square(apart), axis=0)):
        print("rms distance of the truth in each direction [standard deviations]", np.round(row, 2))
    publish("dual_filter", write, named=named_ones, bands=table(
        [f"{tanks} tanks", "", "K error after / before, median", "parameter bands cover, % (standard error)",
         "added mass", "damping"], rows))


if __name__ == "__main__":
    main(*arguments(__doc__, "dual_filter", tanks=200))
