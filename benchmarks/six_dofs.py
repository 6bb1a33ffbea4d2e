"""Bodies of six degrees of freedom, free and moored, with one to three hidden effects and with none.

The true motion is integrated here: Cummins' equation with the kernel of the BEM file's own damping by convolution, the
average-acceleration rule, and each effect's force written out. Nothing of the package's radiation models, effects or
integrators is used for it. python benchmarks/six_dofs.py --out FOLDER --cases 20 adds answers to FOLDER/answers.jsonl,
each case once; with --table it writes docs/validation/six_dofs.md from them. Needs RADIATION_SS_DATA.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
import warnings
from collections import Counter
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT)]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.interpolate import PchipInterpolator

import radiation_ss as rss
from benchmarks.tank_tests import platform

PERIODS, SAMPLES, FINE = 30, 40, 10  # heave periods of a record, samples in each, truth's steps in each sample
TOLERANCE, NOISE = 0.02, 0.005
HORIZONTAL = (0, 1, 5)


def hull(data, rng):
    """Return the semisubmersible with rotational inertias and metacentric heights of its own."""
    model = platform(data)
    inertias, heights = (np.diag([1.0] * 3 + [*rng.uniform(0.8, 1.3, 3)]) for _ in range(2))
    return model.replace(M=np.sqrt(inertias) @ model.M @ np.sqrt(inertias),
                         C=np.sqrt(heights) @ model.C @ np.sqrt(heights))


def kernel(hydro, t):
    """Return (2/pi) int B(w) cos(wt) dw by the trapezoidal rule, shape (nt, 6, 6); B is tabulated, monotone between.

    The step in w is a tenth of pi over the longest time: the sum alone would repeat itself after 2 pi over the step.
    """
    w = np.arange(0.0, hydro.omega[-1], 0.1 * np.pi / t[-1])
    weight = np.full(w.size, w[1])
    weight[[0, -1]] *= 0.5
    B = PchipInterpolator(np.append(0.0, hydro.omega), np.concatenate([np.zeros((1, 6, 6)), hydro.B]))(w)
    return 2.0 / np.pi * np.tensordot(np.cos(np.outer(t, w)) * weight, B, axes=1)


def motion(inertia, C, D, K, dt, force, start, law):
    """Return displacements (nt, 6) of inertia x'' + int K v + D v + C x = force + law(x, v) from rest at `start`."""
    nt, nk = len(force), len(K)
    flat = dt * np.concatenate(list(K), axis=1)  # acts on the newest velocity first
    lhs = np.linalg.inv(inertia + 0.5 * dt * (D + 0.5 * flat[:, :6]) + 0.25 * dt**2 * C)
    past = np.zeros((nt + nk, 6))
    x, v = np.array(start, float), np.zeros(6)
    a = np.linalg.solve(inertia, force[0] + law(x, v) - C @ x)
    found = np.empty((nt, 6))
    found[0] = x
    for k in range(1, nt):
        at = nt - k
        memory = flat[:, 6:] @ past[at + 1:at + nk].ravel()
        x0, v0 = x + dt * v + 0.25 * dt**2 * a, v + 0.5 * dt * a
        fixed = force[k] - memory - C @ x0 - (D + 0.5 * flat[:, :6]) @ v0
        for _ in range(3):
            x, v = x0 + 0.25 * dt**2 * a, v0 + 0.5 * dt * a
            a = lhs @ (fixed + law(x, v))
        x, v = x0 + 0.25 * dt**2 * a, v0 + 0.5 * dt * a
        past[at], found[k] = v, x
    return found


LAWS = {"quadratic_drag": lambda c, x, v: -c * np.abs(v) * v, "linear_damping": lambda c, x, v: -c * v,
        "linear_stiffness": lambda c, x, v: -c * x, "cubic_stiffness": lambda c, x, v: -c * x**3}


def drawn(rng, count, moored, inertia, omega, X):
    """Return hidden effects (name, position, coefficient), of a size that a decay shows."""
    found = []
    while len(found) < count:
        i, name = int(rng.integers(6)), str(rng.choice(list(LAWS)))
        if any(i == other[1] for other in found) or (not moored and i in HORIZONTAL and "stiffness" in name):
            continue
        m, u = inertia[i, i], rng.uniform()
        size = {"quadratic_drag": (0.02 + 0.04 * u) * 2.0 * m * 3.0 * np.pi / 8.0 / X[i],
                "linear_damping": (0.01 + 0.03 * u) * 2.0 * m * omega[i],
                "linear_stiffness": (0.06 + 0.09 * u) * m * omega[i] ** 2 * rng.choice([-1.0, 1.0]),
                "cubic_stiffness": (0.1 + 0.2 * u) * m * (omega[i] / X[i]) ** 2}[name]
        found.append((name, i, float(size)))
    return found


def case(data, moored, count, seed):
    """Return model, records, withheld records and the truth."""
    rng = np.random.default_rng([20, seed])
    free = hull(data, rng)
    inertia, C = free.M + free.A_inf, free.C.copy()
    heave = float(np.sqrt(C[2, 2] / inertia[2, 2]))
    gyradius = float(np.sqrt(free.M[3, 3] / free.M[0, 0]))
    for i in HORIZONTAL if moored else ():
        C[i, i] = inertia[i, i] * (heave / 6.0) ** 2
    omega = np.sqrt(np.maximum(np.diag(C), 0.0) / np.diag(inertia))
    omega[omega == 0.0] = heave
    X = np.array([0.16, 0.16, 0.06, 0.08, 0.08, 0.1]) * np.array([gyradius] * 3 + [1.0] * 3)
    D = np.diag(0.02 * np.diag(inertia) * omega)
    model = free.replace(C=C, D=D)
    effects = drawn(rng, count, moored, inertia, omega, X)
    off = [np.diag(np.sqrt(1.0 + TOLERANCE * rng.standard_normal(6))) for _ in range(2)]
    true_inertia, true_C = off[0] @ inertia @ off[0], off[1] @ C @ off[1]
    dt = 2.0 * np.pi / heave / SAMPLES / FINE
    t = dt * np.arange(PERIODS * SAMPLES * FINE)
    K = kernel(free.hydro, t[t < 5.0 * 2.0 * np.pi / heave])
    kept, shapes = t[::FINE], [(name, i, c, LAWS[name]) for name, i, c in effects]

    def law(x, v):
        force = np.zeros(6)
        for _, i, c, shape in shapes:
            force[i] += shape(c, x[i], v[i])
        return force

    def sea(level):
        w = heave * np.linspace(0.5, 2.0, 50)
        amplitude = np.exp(-(((w / heave - 1.2) / 0.35) ** 2))
        amplitude *= level * np.sqrt(2.0 / np.sum(amplitude**2))
        begun = np.sin(np.minimum(0.5 * np.pi, t * heave / 12.0))[:, None] ** 2
        return begun * np.stack([np.diag(inertia)[i] * heave**2 * X[i] / 5.0 *
                         amplitude @ np.cos(np.outer(w, t) + rng.uniform(0, 2 * np.pi, (50, 1))) for i in range(6)], 1)

    rest, still = np.zeros(6), np.zeros((t.size, 6))
    pulled = list(range(6)) if moored else [2, 3, 4]
    held = np.isin(np.arange(6), pulled)
    runs = [(f"decay of {model.dofs[i]}", held * np.where(np.arange(6) == i, X, 0.02 * X), still) for i in pulled]
    runs += [("sea 1", rest, sea(1.0))] + ([] if moored else [("sea 2", rest, sea(0.5))])
    unseen = [("mixed decay", 0.6 * held * X, still),
              ("unseen sea", rest, sea(0.8))]
    moved = [(name, motion(true_inertia, true_C, D, K, dt, force, start, law)[::FINE], force[::FINE])
             for name, start, force in runs + unseen]
    sd = NOISE * np.max([x.std(axis=0) for _, x, _ in moved], axis=0)
    made = []
    for name, x, force in moved:
        noisy = x + sd * rng.standard_normal(x.shape)
        channels = {dof: noisy[:, i] for i, dof in enumerate(model.dofs)}
        if np.any(force):
            channels |= {f"{dof}_force": force[:, i] for i, dof in enumerate(model.dofs)}
        made.append(rss.Record(kept, channels, kind="forced" if np.any(force) else "decay", name=name))
    return model, made[:len(runs)], made[len(runs):], [(n, model.dofs[i], c) for n, i, c in effects]


def answered(data, moored, count, seed):
    """Diagnose a case; return what the table needs."""
    model, records, withheld, truth = case(data, moored, count, seed)
    began = time.process_time()
    try:
        found = rss.diagnose(model, records, withhold=withheld)
        told = [(e.name, e.dof, next(iter(e.parameters.values()), (0.0, 0.0))) for e in found.verdict.effects]
        status, gaps = found.verdict.status, (found.how_far.gap_before, found.how_far.gap_after)
        sets = [list(s) for s in found.verdict.indistinguishable[:3]]
    except rss.RadiationError as error:
        told, status, gaps, sets = [], f"refused: {error}"[:200], (0.0, 0.0), []
    return {"moored": moored, "count": count, "seed": seed, "truth": truth, "status": status,
            "named": told, "sets": sets, "gaps": gaps, "seconds": time.process_time() - began,
            "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def plan(cases):
    """Return (moored, number of effects, seed): as many with effects as without."""
    return [(bool(k // 2 % 2), (1 + k // 4 % 3) * (k % 2), k) for k in range(cases)]


def rows_of(answers):
    """Return rows of the table."""
    rows = []
    for moored in (False, True):
        for count in (0, 1, 2, 3):
            mine = [a for a in answers if a["moored"] == moored and a["count"] == count]
            if not mine:
                continue
            true = [(n, d) for a in mine for n, d, _ in a["truth"]]
            hits = [(n, d) for a in mine for n, d, _ in a["named"] if [n, d] in [list(t[:2]) for t in a["truth"]]]
            wrong = sum(len(a["named"]) for a in mine) - len(hits)
            errors = [abs(v / c - 1.0) for a in mine for n, d, (v, _) in a["named"] for m, e, c in a["truth"]
                      if (n, d) == (m, e)]
            states = [a["status"] for a in mine]
            states = ", ".join(f"{states.count(s)} {s}" for s in sorted(set(states)))
            seconds = sorted(a["seconds"] for a in mine)
            rows.append("|".join(["", "moored" if moored else "free", str(count), str(len(mine)), states,
                                  f"{len(hits)} of {len(true)}" if true else "-", str(wrong),
                                  f"{np.median(errors):.1%}" if errors else "-",
                                  f"{seconds[len(seconds) // 2]:.0f}, {seconds[-1]:.0f}", ""]))
    return rows


PAGE = """# Six degrees of freedom

{day}, commit {commit}. A 15 MW turbine's semisubmersible (WAMIT file), gyradii and metacentric heights drawn; free, or
held by linear stiffness that the model has. Free: three decays, two seas with known force; moored: six decays, one sea;
two records withheld; 600 s at 2 Hz. Inertia and stiffness are off by {tolerance:.0%}, noise is {noise:.1%}. Hidden:
drag, linear damping, linear and cubic stiffness, at most one on each motion; the whole library is asked. Truth:
Cummins' equation with the tabulated damping's kernel by convolution, which the model has by a fit (relative error .07).
Asked: false alarms <= 2 %, named >= .9, motion right >= .95, 60 s.
Rerun: `python benchmarks/six_dofs.py --out FOLDER --cases 40 --table`.

|body|effects|cases|verdicts|true ones named|others named|error of coefficients|s: median, most|
|---|---|---|---|---|---|---|---|
{rows}

Named and not there: {wrong}.
"""


def write(answers):
    """Write the page of some answers."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    wrong = Counter(f"{n} on {d}" for a in answers for n, d, _ in a["named"]
                    if [n, d] not in [list(t[:2]) for t in a["truth"]])
    text = PAGE.format(day=date.today(), commit=commit.strip(), tolerance=TOLERANCE, noise=NOISE,
                       rows="\n".join(rows_of(answers)),
                       wrong=", ".join(f"{name} ({count})" for name, count in wrong.most_common()) or "none")
    (ROOT / "docs" / "validation" / "six_dofs.md").write_text(text, encoding="utf-8")
    print(text)


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--cases", type=int, default=0)
    options.add_argument("--table", action="store_true")
    chosen = options.parse_args()
    warnings.simplefilter("ignore")
    data = Path(os.environ["RADIATION_SS_DATA"])
    chosen.out.mkdir(parents=True, exist_ok=True)
    path = chosen.out / "answers.jsonl"
    answers = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    done = {a["seed"] for a in answers}
    for job in plan(chosen.cases):
        if job[-1] not in done:
            answers.append(answered(data, *job))
            with path.open("a") as file:
                file.write(json.dumps(answers[-1]) + "\n")
            print({k: answers[-1][k] for k in ("seed", "truth", "status", "named", "seconds")}, flush=True)
    if chosen.table:
        write(answers)


if __name__ == "__main__":
    main()
