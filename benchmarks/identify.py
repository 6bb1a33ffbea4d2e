"""What `identify` gets out of records whose truth is known: own truths by convolution, and records of another hand.

OMP_NUM_THREADS=1 python benchmarks/identify.py [--seeds 12] [--only TEXT] [--write]
OMP_NUM_THREADS=1 python benchmarks/identify.py --cases FOLDER --labels FOLDER [--seeds 6] [--only TEXT] [--write]

Of another hand: FOLDER/<group>_<number>/model.nc and record.csv; labels <group>_<number>.npz with omega, A, B, A_inf,
M, C, time, force.
"""

import argparse
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

import identify_truth as truth
from validation import publish, table

import radiation_ss as rss
from radiation_ss.body.convert import read_model
from radiation_ss.errors import SolverError
from radiation_ss.filter import Band

# label: sea, length [s], what differs from motion alone
OWN = {f"{sea}, {length:g} s": (sea, length, {}) for sea in truth.SEAS for length in (30.0, 120.0)}
OWN |= {"JONSWAP, 600 s": ("JONSWAP", 600.0, {})}
OWN |= {f"force known, {label}, 30 s": ("JONSWAP", 30.0, options) for label, options in {
    "clean": {"force": True}, "mass +3 %": {"force": True, "mass": 1.03}, "drag 30 %": {"force": True, "drag": 0.3},
    "elevation and X": {"elevation": True}}.items()}
OWN |= {"sway-roll, JONSWAP, 120 s": ("JONSWAP", 120.0, {"body": "ship_sway_roll", "tp": 1.45}),
        "sway-roll, force known, 60 s": ("JONSWAP", 60.0, {"body": "ship_sway_roll", "tp": 1.45, "force": True})}
HEADER = ["case", "pooled (if right)", "worse than 1.1", "bands cover (least)",
          "the prior's (least)", "under 60 % (if right)", "force error (band covers)", "named", "cpu s"]


def judged(found, K, time_force):
    """Return errors of K after and before, spread and coverage of K's bands, error and coverage of the force, names.

    Entries count alike, whatever their units; those that symmetry makes zero do not count.
    """
    size = np.sqrt(np.mean(np.abs(K) ** 2, axis=0)).diagonal() ** 0.5
    scale = np.outer(size, size)
    low, high = found.K.lower, found.K.upper
    there = np.sqrt(np.mean(np.abs(K) ** 2, axis=0)) > 1e-3 * scale
    u = np.random.default_rng(0).standard_normal((1000, found.form.size))
    alone = Band.of(found.form.K(found.form.theta(u), found.omega))
    covered, prior = (np.mean([(f(band.lower) <= f(K))[:, there] & (f(K) <= f(band.upper))[:, there]
                               for f in (np.real, np.imag)]) for band in (found.K, alone))
    drawn = found.form.K(found.draws, found.omega)
    spread = np.sqrt(np.sum(np.mean(np.abs((drawn - drawn.mean(axis=0)) / scale) ** 2, axis=0)))
    drawn = drawn[:, :, there]
    inside = [(f(low)[:, there] <= f(drawn)) & (f(drawn) <= f(high)[:, there]) for f in (np.real, np.imag)]
    right = np.mean(np.mean(inside, axis=(0, 2, 3)) < 0.6)  # how often bands that are right hold less than 60 %
    error = within = np.nan
    if found.force:
        estimate = next(iter(found.force.values()))
        force = np.array([np.interp(estimate.time, time_force[0], row) for row in time_force[1]])
        error = np.sqrt(np.mean((estimate.mean - force) ** 2 / np.mean(force**2, axis=1, keepdims=True)))
        within = np.mean((estimate.lower <= force) & (force <= estimate.upper))
    said = " ".join(found.warnings)
    named = [word for word, text in (("mass", "ask for inertia"), ("drag", "ask for quadratic drag"),
                                     ("cubic", "ask for cubic"), ("sea", "not JONSWAP-like")) if text in said]
    return {"e": np.linalg.norm((found.K.mean - K) / scale), "e0": np.linalg.norm((found.prior["K"] - K) / scale),
            "spread": spread, "cover": covered, "alone": prior, "right": right, "force": error, "within": within,
            "named": " ".join(named)}


def own(label, seeds, base):
    """Yield what was found of own truths."""
    sea, length, options = OWN[label]
    options = dict(options)
    body = getattr(truth, options.pop("body", "lewis_heave"))()
    period = options.pop("tp", 0.9)
    for seed in range(seeds):
        rng = np.random.default_rng([base, seed, list(OWN).index(label)])
        model = truth.perturbed(body, rng)
        record, force = truth.sail(body, truth.SEAS[sea](rng, period), length, rng, **options)
        yield run(model, record, body.K(body.band), body.band, (record.time, force), known=bool(options))


def foreign(folder, labels, group, seeds):
    """Yield what was found of another hand's records; K is judged from 0.55 to 1.7 times the natural frequencies."""
    for case in sorted(folder.glob(f"{group}_[0-9][0-9]"))[:seeds]:
        data = np.load(labels / f"{case.name}.npz")
        natural = np.sqrt(np.diag(data["C"]) / np.diag(data["M"] + data["A_inf"]))
        omega = data["omega"]
        inside = (omega > 0.55 * natural.min()) & (omega < 1.7 * natural.max())
        K = (data["B"] + 1j * omega[:, None, None] * (data["A"] - data["A_inf"]))[inside]
        record = rss.read_record(case / "record.csv")
        yield run(read_model(case / "model.nc"), record, K, omega[inside], (data["time"], data["force"].T),
                  known="known" in group)


def run(model, record, K, omega, force, known):
    """Return what is found of one record and its CPU time; None if there is no result."""
    began = time.process_time()
    try:
        found = rss.identify(model, record, "prediction-error" if known else "spectral", omega=omega)
    except SolverError as error:
        print(f"{record.name}: {error}", flush=True)
        return None
    return judged(found, K, force) | {"cpu": time.process_time() - began}


def line(label, results):
    """Return a row of the table."""
    kept = [item for item in results if item is not None]
    column = {key: np.array([item[key] for item in kept]) for key in kept[0] if key != "named"}
    ratio = column["e"] / column["e0"]
    counts = defaultdict(int)
    for item in kept:
        for name in item["named"].split():
            counts[name] += 1
    known = np.isnan(column["force"]).all()
    pooled, right = (np.sqrt(np.mean(column[key] ** 2) / np.mean(column["e0"] ** 2)) for key in ("e", "spread"))
    failed = f" ({len(kept)} of {len(results)})" if len(kept) < len(results) else ""
    return [label + failed, f"{pooled:.2f} ({right:.2f})",
            f"{np.mean(ratio > 1.1):.0%}", *(f"{column[key].mean():.0%} ({column[key].min():.0%})"
                                             for key in ("cover", "alone")),
            f"{np.sum(column['cover'] < 0.6)} ({column['right'].sum():.1f})",
            "" if known else f"{np.median(column['force']):.3f} ({column['within'].mean():.0%})",
            ", ".join(f"{name} {n}" for name, n in counts.items()), f"{column['cpu'].mean():.1f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=201)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--only", default="", help="only cases whose label holds this text")
    parser.add_argument("--cases", type=Path)
    parser.add_argument("--labels", type=Path)
    parser.add_argument("--write", action="store_true", help="put the table into docs/validation/identify.md")
    args = parser.parse_args()
    part = "own" if args.cases is None else "foreign"
    names = list(OWN) if args.cases is None else sorted({path.name[:-3] for path in args.cases.glob("*_[0-9][0-9]")})
    rows = []
    for label in (name for name in names if args.only in name):
        results = own(label, args.seeds, args.seed) if args.cases is None else foreign(args.cases, args.labels, label,
                                                                                        args.seeds)
        rows.append(line(label, list(results)))
        print(rows[-1], flush=True)
        publish("identify", args.write, **{part: table(HEADER, rows)})
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            check=True).stdout.strip()
    publish("identify", args.write, **{f"{part}_run": f"Commit {commit}, `--seed {args.seed} --seeds {args.seeds}`."})


if __name__ == "__main__":
    main()
