"""What `identify` gets out of records of the paper's tank, and out of the measured flume runs.

Every truth is drawn from the prior (15 % on each parameter, passive) around Table 3's 2D-BEM row, so that bands can be
counted. Run: OMP_NUM_THREADS=1 python benchmarks/identify.py --seed 41 [--seeds 20] [--only NAME ...] [--write]
"""

import argparse
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "benchmarks")]

from identify_tank import BAND, G, drawn_truth, jonswap, sail, tank, with_waves
from validation import publish, table

import radiation_ss as rss
from radiation_ss.errors import SolverError
from radiation_ss.identification.channels import motion_channels
from radiation_ss.identification.relation_score import doubts, score_relation
from radiation_ss.identification.sea_structure import do_nothing, structures
from radiation_ss.identification.spectral import spectral_likelihood
from radiation_ss.identification.study import Inference, Study
from radiation_ss.inference.parameters import parametrise

START = with_waves(tank())
FORM = parametrise(START.fit, START.A_inf, 0.15)
WAVE_NUMBERS = np.geomspace(0.01, 200.0, 4000)
FREQUENCIES = np.sqrt(G * WAVE_NUMBERS * np.tanh(0.45 * WAVE_NUMBERS))


def two_peaks(w):
    return 0.5 * jonswap(w, 0.01, 1.35) + 0.5 * jonswap(w, 0.01, 0.85)


def other_tail(w):
    return jonswap(w) * np.maximum(w / 6.5, 1.0)


def wiggles(w):
    return jonswap(w) * (1.0 + 0.3 * np.sin(2.0 * np.pi * np.log(np.maximum(w, 0.1)) / 0.25))


def seas(w, number):
    return jonswap(w, 0.01, (0.95, 1.1, 1.3)[number])


def before_a_wall(w, share=0.3, distance=4.0):
    k = np.interp(w, FREQUENCIES, WAVE_NUMBERS)
    return jonswap(w) * np.abs(1.0 + share * np.exp(2j * k * distance)) ** 2


def off(K, truth):
    return np.linalg.norm(K - truth.fit.frequency_response(BAND))


def fisher_bound(truth, record):
    """Return (trace of the bound of K's covariance, trace of its prior covariance), linearised at the truth."""
    theta = np.linalg.lstsq(*rows(truth.fit.frequency_response(BAND)[:, 0, 0]), rcond=None)[0]
    u = (theta - FORM.mean) / FORM.std
    part, _ = spectral_likelihood(START, FORM, motion_channels(START, record))
    v, _ = do_nothing(part, u.size)
    F = part.local(u, v)[2]
    covariance = np.linalg.inv(F + np.eye(F.shape[0]))[:u.size, :u.size]
    J = np.stack([(FORM.K(FORM.theta(u + 1e-4 * e), BAND) - FORM.K(FORM.theta(u - 1e-4 * e), BAND))[:, 0, 0] / 2e-4
                  for e in np.eye(u.size)], axis=1)
    return np.trace(J @ covariance @ J.conj().T).real, np.trace(J @ J.conj().T).real


def rows(K):
    """Return the linear equations K P - Q = 0 (27) of theta."""
    powers = (1j * BAND[:, None]) ** np.arange(3)
    left, right = np.hstack([K[:, None] * powers, -powers]), -K * (1j * BAND) ** 3
    return np.vstack([left.real, left.imag]), np.r_[right.real, right.imag]


def study(method, duration, seeds, base, *, spectra=(jonswap,), bound=False, missing=0.0, **sailing):
    """Return statistics over seeds of one method, one entry a seed."""
    out = {key: [] for key in ("ratio", "e", "e0", "K", "theta", "force", "force_cover", "bound", "prior", "s", "path",
                               "failed")}
    for seed in range(seeds):
        rng = np.random.default_rng([base, seed])
        truth = drawn_truth(START, rng)
        runs = [sail(truth, duration, rng, spectrum=spectrum, with_force=method == "prediction-error", **sailing)
                for spectrum in spectra]
        runs = [(with_gaps(record, missing, rng), force) for record, force in runs]
        began = time.process_time()
        try:
            found = rss.identify(START, [record for record, _ in runs], method, omega=BAND, seed=seed)
        except SolverError as error:
            print(f"seed {seed}: {error}", flush=True)
            out["failed"].append(seed)
            continue
        out["s"].append(time.process_time() - began)
        out["e"].append(off(found.K.mean, truth))
        out["e0"].append(off(START.fit.frequency_response(BAND), truth))
        out["ratio"].append(out["e"][-1] / out["e0"][-1])
        true, low, high = truth.fit.frequency_response(BAND), found.K.lower, found.K.upper
        out["K"].append(np.mean([(low.real <= true.real) & (true.real <= high.real),
                                 (low.imag <= true.imag) & (true.imag <= high.imag)]))
        theta = np.linalg.lstsq(*rows(true[:, 0, 0]), rcond=None)[0]
        low, high = np.percentile(found.draws, [2.5, 97.5], axis=0)
        out["theta"].append(np.mean((low <= theta) & (theta <= high)))
        for name, (_, force) in zip(found.force, runs):
            estimate = found.force[name]
            out["force"].append(np.sqrt(np.mean((estimate.mean[0] - force) ** 2) / np.mean(force**2)))
            out["force_cover"].append(np.mean((estimate.lower[0] <= force) & (force <= estimate.upper[0])))
        if bound:
            for key, value in zip(("bound", "prior"), fisher_bound(truth, runs[0][0])):
                out[key].append(value)
        if "history" in found.baseline:
            history = found.baseline["history"]
            steps = [off(FORM.K(np.array(mean), BAND), truth) / out["e0"][-1] for mean in history["mean"]]
            out["path"].append(np.interp([30.0, 60.0, 120.0, 300.0, 600.0], history["time"], steps))
    return {key: np.array(value) for key, value in out.items()}


def with_gaps(record, share, rng):
    """Return the record with a share of its samples missing, at random."""
    if not share:
        return record
    y = np.where(rng.random(record.time.size) < share, np.nan, record.channels["Heave"])
    return record.with_channels(Heave=y)


def line(label, asked, found):
    """Return a table row."""
    def cover(key):
        """Return a mean coverage and its standard error over seeds."""
        x = found[key]
        return f"{100 * x.mean():.0f} ± {100 * x.std() / np.sqrt(max(x.size - 1, 1)):.0f}" if x.size else ""

    pooled = np.sqrt(np.sum(found["e"] ** 2) / np.sum(found["e0"] ** 2))
    bound = np.sqrt(found["bound"].mean() / np.mean(found["e0"] ** 2)) if found["bound"].size else np.nan
    digits = 3 if np.median(found["ratio"]) < 0.1 else 2
    failed = f" ({found['failed'].size} without a result)" if found["failed"].size else ""
    return [label, f"{found['e'].size}{failed}", asked, f"{np.median(found['ratio']):.{digits}f}",
            f"{quantile(found['ratio'])}", f"{pooled:.{digits}f}",
            f"{bound:.2f}" if bound > 0.0 else "", cover("K"), cover("theta"),
            f"{np.median(found['force']):.3f}" if found["force"].size else "", cover("force_cover"),
            f"{found['s'].mean():.1f}"]


def quantile(ratio):
    """Return the 90 % quantile of the ratios."""
    return f"{np.quantile(ratio, 0.9):.2f}"


HEADER = ["case", "seeds", "asked", "median after/before", "90 % quantile", "pooled", "Fisher bound",
          "band of K covers %", "of parameters %", "force error", "force band covers %", "cpu s",
          "commit, seed"]
THREE = [lambda w, i=i: seas(w, i) for i in range(3)]
# label, asked, method, duration [s], seeds as a share of --seeds, options
CASES = {
    "force": [("force known, 30 s", "<= .12", "prediction-error", 30.0, 1.0, {}),
              ("force known, 600 s", "<= .01", "prediction-error", 600.0, 0.4, {})],
    "motion": [("motion only, 30 s", "<= .80", "spectral", 30.0, 1.0, {"bound": True}),
               ("motion only, 120 s", "<= .55", "spectral", 120.0, 1.25, {"bound": True}),
               ("motion only, 600 s", "<= .30", "spectral", 600.0, 1.0, {"bound": True}),
               ("20 % of samples missing, 120 s", "", "spectral", 120.0, 0.3, {"missing": 0.2})],
    "three": [("three seas, 30 s each", "<= .60", "spectral", 30.0, 1.0, {"spectra": THREE}),
              ("three seas, 120 s each", "<= .45", "spectral", 120.0, 0.6, {"spectra": THREE})],
    "other": [("two peaks, 120 s", "<= .85", "spectral", 120.0, 1.0, {"spectra": (two_peaks,)}),
              ("tail w^-4, 120 s", "<= .85", "spectral", 120.0, 0.5, {"spectra": (other_tail,)}),
              ("wiggles of 30 %, 120 s", "<= .85", "spectral", 120.0, 0.5, {"spectra": (wiggles,)}),
              ("two peaks, 600 s", "<= .85", "spectral", 600.0, 0.3, {"spectra": (two_peaks,)}),
              ("tail w^-4, 600 s", "<= .85", "spectral", 600.0, 0.3, {"spectra": (other_tail,)}),
              ("wiggles of 30 %, 600 s", "<= .85", "spectral", 600.0, 0.3, {"spectra": (wiggles,)})],
    "joint": [("joint, recursive, 600 s", "<= 1", "joint", 600.0, 1.0, {})],
}
ONLINE_HEADER = ["joint filter after", "30 s", "60 s", "120 s", "300 s", "600 s"]


def online(found):
    """Return rows: median and largest error of K after / before along the records, and how often it is above 1.05."""
    path, idle = found["path"], found["e0"]
    far = idle > np.median(idle)
    return [["median", *(f"{x:.2f}" for x in np.median(path, axis=0))],
            ["90 % quantile", *(quantile(column) for column in path.T)],
            ["largest", *(f"{x:.2f}" for x in path.max(axis=0))],
            ["seeds above 1.05", *(f"{n} of {idle.size}" for n in (path > 1.05).sum(axis=0))],
            ["largest, truths farther off than the median", *(f"{x:.2f}" for x in path[far].max(axis=0))],
            ["pooled", *(f"{x:.2f}" for x in np.sqrt(((path * idle[:, None]) ** 2).sum(0) / (idle**2).sum()))]]


def most_probable(record):
    """Return the score tests at the most probable parameters, as `identify` finds them, without drawing."""
    part, _ = spectral_likelihood(START, FORM, motion_channels(START, record))
    job = Study(START, FORM, (record,), None, np.random.default_rng(0), 10)
    start = do_nothing(part, job.n_u)[0]
    best = structures(job, [part], [], start)[0]
    return score_relation(job, list(best.parts), Inference(job.target(list(best.parts)), best.modes[0],
                                                           np.empty((0, 0)), 0.0, start))


def score(seeds, base, case):
    """Return rows of the score test: how often each departure is named, healthy records first."""
    lost = START.replace(D=np.array([[10.0]]))
    cases = [("nothing wrong", 2.0, 120.0, {}), ("nothing wrong", 0.5, 600.0, {}),
             ("damping of 10 kg/s without waves", 0.6, 120.0, {"D": lost.D}),
             ("damping of 10 kg/s without waves", 0.3, 600.0, {"D": lost.D}),
             ("1 kg more than A_inf says", 0.6, 120.0, {"A_inf": START.A_inf + 1.0}),
             ("1 kg more than A_inf says", 0.3, 600.0, {"A_inf": START.A_inf + 1.0}),
             ("wall 4 m away sends 30 % back", 0.6, 120.0, {"spectrum": before_a_wall}),
             ("wall 4 m away sends 30 % back", 0.3, 600.0, {"spectrum": before_a_wall}),
             ("nothing wrong, two peaks", 1.0, 120.0, {"spectrum": two_peaks})]
    out = []
    for number, (label, share, duration, wrong) in enumerate(cases):
        if case not in label:
            continue
        names, all_rows = [], []
        sea = {key: wrong[key] for key in wrong if key == "spectrum"}
        body = {key: wrong[key] for key in wrong if key != "spectrum"}
        for seed in range(round(share * seeds)):
            rng = np.random.default_rng([base, seed, number])
            record, _ = sail(drawn_truth(START, rng).replace(**body), duration, rng, with_force=False, **sea)
            try:
                found = most_probable(record)
            except SolverError as error:
                print(f"seed {seed}: {error}", flush=True)
                continue
            all_rows.append(found)
            names.append([name for name in found if any(name in text for text in doubts(found))
                          or (name == "reflection" and any("sent back" in text for text in doubts(found)))])
        count = len(names)
        kinds = list(all_rows[0])
        out.append([label, f"{duration:g} s", count, sum(bool(item) for item in names),
                    *(sum(kind in item for item in names) for kind in kinds),
                    *(f"{np.median([row[kind]['estimate'] for row in all_rows]):+.2f} ± "
                      f"{np.median([row[kind]['std'] for row in all_rows]):.2f}" for kind in kinds)])
        print(out[-1], flush=True)
    return out


SCORE_HEADER = ["truth", "length", "records", "any warning", "damping named", "A_inf named", "reflection named",
                "damping / B", "A_inf / A_inf", "reflection"]


def flume(folder):
    """Return rows of A33 and B33 of the measured section, from force on the held model and motion of the free one."""
    import ntnu_section as ntnu

    data = ntnu.nominal().select(("Heave",))
    model, runs, out = rss.Model.from_hydro(data, order=4), ntnu.manifest(folder), []
    for free, held in ntnu.pairs(folder):
        if not free.startswith("free_sway_heave/"):
            continue
        record, marks = ntnu.record(folder, free, held, ("Heave",)), runs[free]
        w = marks["omega_rad_s"]
        found = rss.identify(model, record, "prediction-error", omega=[w])
        steady = [ntnu.phasor(record.time, record.channels[name], w, marks["steady_from_s"], marks["reflection_back_s"])
                  for name in ("Heave_force", "Heave_velocity")]
        Z = steady[0] / (steady[1] / (1j * w))
        B, A = found.B, found.A
        far = max(found.parameters.items(), key=lambda item: abs(item[1]["moved"]))
        out.append([Path(free).name.split(".")[0], f"{w:.3f}", f"{B.mean[0, 0, 0]:.1f}",
                    f"{B.lower[0, 0, 0]:.1f} to {B.upper[0, 0, 0]:.1f}", f"{Z.imag / w:.1f}",
                    f"{found.prior['B'][0, 0, 0]:.1f}", f"{A.mean[0, 0, 0]:.1f}",
                    f"{A.lower[0, 0, 0]:.1f} to {A.upper[0, 0, 0]:.1f}",
                    f"{(data.C[0, 0] - Z.real) / w**2 - data.M[0, 0]:.1f}", f"{found.prior['A'][0, 0, 0]:.1f}",
                    f"{abs(Z) / w * np.pi / 180:.1f}", f"{far[0]} {far[1]['moved']:+.1f}",
                    "yes" if any("contradict" in text for text in found.warnings) else "no"])
    return out


def decay(body, rng, drag, noise, dt, duration):
    """Return a decay test from 20 mm with quadratic drag [N s^2/m^2] and sensor noise as a share of that."""
    t = dt * np.arange(round(duration / dt))
    still = rss.Record(t, {"Heave": np.zeros(t.size), "Heave_force": np.zeros(t.size)}, kind="decay")
    y = dragged(body, still, drag, start=np.r_[np.zeros(body.fit.states), 0.02, 0.0])
    return still.with_channels(Heave=y + noise * 0.02 * rng.standard_normal(t.size))


def waves(body, rng, drag, noise, dt, duration):
    """Return a record in waves with the force known and quadratic drag [N s^2/m^2]."""
    record, _ = sail(body, duration, rng, dt=dt)
    y = dragged(body, record, drag)
    return record.with_channels(Heave=y + noise * y.std() * rng.standard_normal(y.size))


def dragged(body, record, drag, **start):
    """Return the simulated heave."""
    effects = [("quadratic_drag", "Heave", {"coefficient": drag})] if drag else []
    return rss.simulate(body, record, effects, **start).outputs[0]


DRAG_CASES = [("decay, 0.1 % noise, 50 Hz, 8 s", decay, (1e-3, 0.02, 8.0), (0.0, 10.0, 30.0, 100.0, 400.0)),
              ("decay, 3 % noise, 20 Hz, 10 s", decay, (3e-2, 0.05, 10.0), (0.0, 100.0)),
              ("waves with force, 1 % noise, 20 Hz, 30 s", waves, (1e-2, 0.05, 30.0), (0.0, 100.0, 400.0))]
DRAG_HEADER = ["record", "drag [N s^2/m^2]", "records", "any warning", "drag named", "stiffness named",
               "drag, median ± its sd", "band of K covers %", "commit, seed"]


def drag_tests(seeds, base):
    """Yield rows of the test of linearity with the force known: how often it warns, healthy bodies first."""
    for number, (label, sail_or_drop, setting, coefficients) in enumerate(DRAG_CASES):
        for coefficient in coefficients:
            found, inside, failed = [], [], 0
            for seed in range(seeds if coefficient == 0.0 else max(round(0.3 * seeds), 1)):
                rng = np.random.default_rng([base, seed, number])
                body = drawn_truth(START, rng)
                try:
                    result = rss.identify(START, sail_or_drop(body, rng, coefficient, *setting), "prediction-error",
                                          omega=BAND, draws=200)
                except SolverError as error:
                    print(f"seed {seed}: {error}", flush=True)
                    failed += 1
                    continue
                true, low, high = body.fit.frequency_response(BAND), result.K.lower, result.K.upper
                inside.append(np.mean([(low.real <= true.real) & (true.real <= high.real),
                                       (low.imag <= true.imag) & (true.imag <= high.imag)]))
                found.append((result.baseline["nonlinearity_test"], " ".join(result.warnings)))
            drags = [test["quadratic drag [Heave]"] for test, _ in found]
            yield [label, f"{coefficient:g}", f"{len(found)}" + (f" ({failed} without a result)" if failed else ""),
                   sum("look linear" in text or "linear model leaves" in text for _, text in found),
                   sum("ask for quadratic drag" in text for _, text in found),
                   sum("ask for cubic stiffness" in text for _, text in found),
                   f"{np.median([row['estimate'] for row in drags]):.3g} ± "
                   f"{np.median([row['std'] for row in drags]):.2g}",
                   f"{100 * np.mean(inside):.0f}", f"{commit()}, {base}"]


FLUME_HEADER = ["run", "w [rad/s]", "B33 [kg/s]", "band", "B33, steady part alone", "B33, panel method", "A33 [kg]",
                "band", "A33, steady part alone", "A33, panel method", "1 degree of phase in B33",
                "farthest parameter, prior sd", "warned"]


GROUPS = [*CASES, "drag", "score", "flume"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--only", nargs="+", choices=GROUPS, default=GROUPS)
    parser.add_argument("--case", default="", help="only cases whose label holds this text")
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("RADIATION_SS_DATA", "data")))
    parser.add_argument("--write", action="store_true", help="put the tables into docs/validation/identify.md")
    args = parser.parse_args()
    began, lines = time.process_time(), {}
    for group in args.only:
        if group == "flume":
            publish("identify", args.write, flume=table(FLUME_HEADER, flume(args.data / "ntnu_section")))
            continue
        if group == "drag":
            rows = []
            for row in drag_tests(args.seeds, args.seed):
                rows.append(row)
                publish("identify", args.write, drag=table(DRAG_HEADER, rows))
            continue
        if group == "score":
            publish("identify", args.write, score=table(SCORE_HEADER, score(args.seeds, args.seed, args.case)))
            continue
        for number, (label, asked, method, duration, share, options) in enumerate(CASES[group]):
            if args.case not in label:
                continue
            base = 1000 * args.seed + 10 * list(CASES).index(group) + number
            found = study(method, duration, max(round(share * args.seeds), 1), base, **options)
            lines[label] = [*line(label, asked, found), f"{commit()}, {args.seed}"]
            parts = {"tank": table(HEADER, merged(lines))}
            if group == "joint":
                parts["online"] = table(ONLINE_HEADER, online(found))
            publish("identify", args.write, **parts)
    publish("identify", args.write, run=f"`--seed {args.seed} --seeds {args.seeds} --only {' '.join(args.only)}`"
                                        f"{f' (cases {args.case})' if args.case else ''}, "
                                        f"{(time.process_time() - began) / 60.0:.0f} CPU minutes.")


def commit():
    """Return the commit that is measured."""
    return subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                          check=True).stdout.strip()


def merged(lines):
    """Return the page's rows with those measured now in their places: every row carries its commit and seed."""
    text = (ROOT / "docs" / "validation" / "identify.md").read_text(encoding="utf-8")
    section = re.search(r"<!-- tank -->\n(.*?)<!-- end -->", text, flags=re.DOTALL)[1]
    rows = [[cell.strip() for cell in row.strip().strip("|").split("|")] for row in section.splitlines()[2:]]
    rows = {row[0]: row for row in rows} | lines
    return [rows[case[0]] for group in CASES.values() for case in group if case[0] in rows]


if __name__ == "__main__":
    main()
