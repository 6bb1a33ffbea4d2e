"""What `identify` gets out of records of the paper's tank, and out of the measured flume runs.

Every truth is drawn from the prior (15 % on each parameter) around Table 3's 2D-BEM row, so that bands can be counted.
Run: OMP_NUM_THREADS=1 python benchmarks/identify.py [--seeds 24] [--only NAME ...]
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "benchmarks")]

from identify_tank import BAND, drawn_truth, jonswap, sail, tank, with_waves
from validation import table

import radiation_ss as rss
from radiation_ss.filter.channels import motion_channels
from radiation_ss.filter.motion_only import do_nothing
from radiation_ss.filter.parameters import parametrise
from radiation_ss.filter.spectral import spectral_likelihood

START = with_waves(tank())
FORM = parametrise(START.fit, START.A_inf, 0.15)


def two_peaks(w):
    return 0.5 * jonswap(w, 0.01, 1.35) + 0.5 * jonswap(w, 0.01, 0.85)


def other_tail(w):
    return jonswap(w) * np.maximum(w / 6.5, 1.0)


def wiggles(w):
    return jonswap(w) * (1.0 + 0.3 * np.sin(2.0 * np.pi * np.log(np.maximum(w, 0.1)) / 0.25))


def seas(w, number):
    return jonswap(w, 0.01, (0.95, 1.1, 1.3)[number])


def fisher_bound(truth, record):
    """Return (trace of the bound of K's covariance, trace of its prior covariance), linearised at the truth."""
    fit = truth.fit.frequency_response(BAND)[:, 0, 0]
    theta = np.linalg.lstsq(*rows(fit), rcond=None)[0]
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


def study(method, duration, seeds, *, spectra=(jonswap,), bound=False, **sailing):
    """Return statistics over seeds of one method."""
    out = {key: [] for key in ("ratio", "e", "e0", "K", "theta", "force", "idle", "force_cover", "bound", "prior", "s")}
    for seed in range(seeds):
        rng = np.random.default_rng([seed, 77])
        truth = drawn_truth(START, rng)
        runs = [sail(truth, duration, rng, spectrum=spectrum, with_force=method == "prediction-error", **sailing)
                for spectrum in spectra]
        began = time.process_time()
        found = rss.identify(START, [record for record, _ in runs], method, omega=BAND, seed=seed)
        out["s"].append(time.process_time() - began)
        true, before = truth.fit.frequency_response(BAND), START.fit.frequency_response(BAND)
        out["e"].append(np.linalg.norm(found.K.mean - true))
        out["e0"].append(np.linalg.norm(before - true))
        out["ratio"].append(out["e"][-1] / out["e0"][-1])
        low, high = found.K.lower, found.K.upper
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
    return {key: np.array(value) for key, value in out.items()}


def line(label, asked, found):
    """Return a table row."""
    def cover(key):
        return f"{100 * found[key].mean():.0f}" if found[key].size else ""

    pooled = np.sqrt(np.sum(found["e"] ** 2) / np.sum(found["e0"] ** 2))
    bound = f"{np.sqrt(found['bound'].mean() / found['prior'].mean()):.2f}" if found["bound"].size else ""
    force = f"{np.median(found['force']):.3f}" if found["force"].size else ""
    digits = 3 if np.median(found["ratio"]) < 0.1 else 2
    return [label, asked, f"{np.median(found['ratio']):.{digits}f}", f"{pooled:.{digits}f}", bound, cover("K"),
            cover("theta"), force, cover("force_cover"), f"{found['s'].mean():.1f}"]


HEADER = ["case", "asked", "median after/before", "pooled", "Fisher bound", "band of K covers %", "of parameters %",
          "force error", "force band covers %", "cpu s"]
THREE = [lambda w, i=i: seas(w, i) for i in range(3)]
CASES = {
    "force": [("force known, 30 s", "<= .12", "prediction-error", 30.0, {}),
              ("force known, 600 s", "<= .01", "prediction-error", 600.0, {})],
    "motion": [("motion only, 30 s", "<= .80", "spectral", 30.0, {"bound": True}),
               ("motion only, 120 s", "<= .55", "spectral", 120.0, {"bound": True}),
               ("motion only, 600 s", "<= .30", "spectral", 600.0, {"bound": True})],
    "three": [("three seas, 30 s each", "<= .60", "spectral", 30.0, {"spectra": THREE}),
              ("three seas, 120 s each", "<= .45", "spectral", 120.0, {"spectra": THREE})],
    "other": [("two peaks, 30 s", "<= .85", "spectral", 30.0, {"spectra": (two_peaks,)}),
              ("two peaks, 120 s", "<= .85", "spectral", 120.0, {"spectra": (two_peaks,)}),
              ("tail w^-4, 120 s", "<= .85", "spectral", 120.0, {"spectra": (other_tail,)}),
              ("wiggles of 30 %, 120 s", "<= .85", "spectral", 120.0, {"spectra": (wiggles,)})],
    "joint": [("joint, recursive, 30 s", "<= 1", "joint", 30.0, {}),
              ("joint, recursive, 120 s", "<= 1", "joint", 120.0, {}),
              ("joint, recursive, 600 s", "<= 1", "joint", 600.0, {})],
}


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
        out.append([Path(free).name.split(".")[0], f"{w:.3f}", f"{B.mean[0, 0, 0]:.1f}",
                    f"{B.lower[0, 0, 0]:.1f} to {B.upper[0, 0, 0]:.1f}", f"{Z.imag / w:.1f}",
                    f"{found.prior['B'][0, 0, 0]:.1f}", f"{A.mean[0, 0, 0]:.1f}",
                    f"{A.lower[0, 0, 0]:.1f} to {A.upper[0, 0, 0]:.1f}",
                    f"{(data.C[0, 0] - Z.real) / w**2 - data.M[0, 0]:.1f}", f"{found.prior['A'][0, 0, 0]:.1f}",
                    f"{abs(Z) / w * np.pi / 180:.1f}"])
    return out


FLUME_HEADER = ["run", "w [rad/s]", "B33 [kg/s]", "band", "B33, steady part alone", "B33, panel method", "A33 [kg]",
                "band", "A33, steady part alone", "A33, panel method", "1 degree of phase in B33"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--only", nargs="+", choices=[*CASES, "flume"], default=[*CASES, "flume"])
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    args = parser.parse_args()
    for group in args.only:
        if group == "flume":
            lines, header = flume(args.data / "ntnu_section"), FLUME_HEADER
        else:
            lines, header = [], HEADER
            for label, asked, method, duration, options in CASES[group]:
                lines.append(line(label, asked, study(method, duration, args.seeds, **options)))
                print(lines[-1], flush=True)
        print(table(header, lines), end="\n\n")


if __name__ == "__main__":
    main()
