"""Check cases: python check.py OUT [--bodies DIR] [--effects]

Every case: model and records load with radiation_ss, the label has the right form, decays without a cause lose energy, and
the records of nulls agree with the written model, simulated here (start from the first samples, memory empty).
--effects: every cause at a middling strength with the step and half of it, and how far both are apart.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path

import causes as catalogue
import make
import numpy as np
from hydro import Body, kernel
from outside import OUTSIDE
from simulate import march
from truth import Truth, memory, run

import radiation_ss as rss
from tests import Setup, lively, programme


def body_of(path: Path) -> Body:
    """Return the linear coefficients of a written model."""
    d = rss.read_hydro(path)
    D = np.zeros_like(d.M) if d.D is None else d.D
    return Body(d.dofs, d.omega, d.A, d.B, d.A_inf, d.X[:, 0], d.M, d.C, D, 0.0, d.rho, d.depth, 0.0, 1.0)


def columns(path: Path) -> tuple[str, dict]:
    """Return kind and columns (names without unit) of a record's file."""
    lines = path.read_text().splitlines()
    head = [q for q in lines if q.startswith("#")]
    names = [q.split(" ")[0] for q in lines[len(head)].split(",")]
    rows = np.array([[float(q) if q else np.nan for q in line.split(",")] for line in lines[len(head) + 1:]])
    return head[0].split(": ")[1], dict(zip(names, rows.T))


def exciting(body: Body, t: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Return the force of an elevation by the model's X, with Fourier's transform."""
    w = 2 * np.pi * np.fft.rfftfreq(len(t), t[1] - t[0])
    X = np.column_stack([np.interp(w, body.omega, body.X[:, i], right=0) for i in range(body.n)])
    return np.fft.irfft(np.fft.rfft(eta)[:, None] * X, len(t), axis=0)


def null_gap(body: Body, path: Path) -> float:
    """Return the gap of a record against the written model, by the integrator of this package."""
    kind, c = columns(path)
    h = 2 * np.pi / body.natural().max() / make.STEPS
    t = np.arange(c["time"][0], c["time"][-1], h)
    x = np.column_stack([np.interp(t, c["time"][ok], c[d][ok]) for d in body.dofs for ok in [~np.isnan(c[d])]])
    half = np.linspace(t[0], t[-1], 2 * len(t) - 1)
    F = np.zeros((len(half), body.n))
    if f"{body.dofs[0]}_force" in c:
        F = np.column_stack([np.interp(half, c["time"], c[f"{d}_force"]) for d in body.dofs])
    elif kind == "waves":
        F = exciting(body, half, np.interp(half, c["time"], c["wave_elevation"]))
    soft = np.array([np.convolve(q, np.ones(9) / 9, "same") for q in x.T]).T
    v = np.gradient(soft, h, axis=0)
    a = np.gradient(np.array([np.convolve(q, np.ones(9) / 9, "same") for q in v.T]).T, h, axis=0)
    guided = kind == "prescribed"
    y, vy, ay, E = x.copy(), v.copy(), a.copy(), np.zeros_like(x)
    none = np.zeros(0, np.int64)
    v0 = (x[6] - x[0]) / (6 * h) if kind != "decay" or abs(x[6] - x[0]).max() > 0.05 * abs(x[0]).max() else np.zeros(body.n)
    march(h, len(t) - 1, x[0], v0, body.M + body.A_inf, body.C, body.D,
          kernel(body, h / 2, 14 * 2 * np.pi / np.median(body.omega)), 0 * F if guided else F, none, none, np.zeros((0, 8)),
          np.zeros((0, len(half))), np.zeros((0, 2)), y, vy, ay, E, guided)
    one, other = (E[20:-20], F[::2][20:-20]) if guided else (y, x)
    late = slice(len(one) // 4 if kind == "waves" else 0, None)  # what the start left is over
    on = np.sqrt(np.mean(other**2, axis=0)) > 0
    scale = np.maximum(np.sqrt(np.mean(other[:, on] ** 2, axis=0)), 1e-300)
    return float(np.sqrt(np.mean(((one - other)[late][:, on] / scale) ** 2)))


def check_case(case: Path, label: dict) -> list[str]:
    """Return what is wrong with a case."""
    wrong, model = [], rss.read_model(case / "model.nc")
    if not {"null", "accept", "causes"} <= set(label) or len(label["accept"]) != len(label["causes"]):
        wrong.append("label's form")
    if label["null"] != (not label["causes"]) or any(not {"name", "dof", "outside"} <= set(c) for c in label["causes"]):
        wrong.append("label's causes")
    for path in sorted(case.glob("*.csv")):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            rss.read_record(path)
        wrong += [f"{path.name}: {str(c.message)[:90]}" for c in caught]
        kind, c = columns(path)
        if not set(model.dofs) <= set(c):
            wrong.append(f"{path.name}: lacks a degree of freedom")
        if kind == "decay" and label["null"]:
            x, m = np.nan_to_num(np.column_stack([c[d] for d in model.dofs])), len(c["time"]) // 3
            if np.any(x[-m:].std(axis=0).max() > x[:m].std(axis=0).max()):
                wrong.append(f"{path.name}: a decay that grows")
    return wrong


def check_effects(tables: Path) -> None:
    """Print how far half the step moves every cause's motion, rms over rms."""
    names = list(make.NEEDS) + [o.__name__ for o in OUTSIDE]
    for name in names:
        worst, tried = 0.0, 0
        for attempt in range(40):
            found = []
            for steps in (make.STEPS, 2 * make.STEPS):
                rng = np.random.default_rng([7, attempt])
                family, nominal, true, _ = make.draw_body(rng, tables)
                w = nominal.natural()
                h = min(2 * np.pi / w.max() / make.STEPS, 2 * np.pi / nominal.omega[-1] / 24) * make.STEPS / steps
                s = Setup(nominal, true, h, lively(family, nominal), w, 1.0)
                kind, seen, _ = programme(s, rng)
                ctx = catalogue.Context(s, {t.kind for t in seen}, set().union(*(t.show for t in seen)),
                                        len({t.speed for t in seen}), max(np.std(seen[-1].eta), 1e-3 * s.lively[0]),
                                        seen[0].span, kind != "regular")
                if name in make.NEEDS and not make.eligible(name, ctx):
                    break
                draw = make.maker(name) if name in make.NEEDS else next(o for o in OUTSIDE if o.__name__ == name)
                cause, truth = draw(ctx, rng), Truth.plain(s, memory(s, true))
                cause.put(truth, (cause.low * cause.high) ** 0.5)
                moved = run(truth, seen[0])
                found.append((moved[0], moved[4] if seen[0].guide else moved[1]))
            if len(found) == 2:
                (t1, x1), (t2, x2) = found
                m = min(t1[-1], t2[-1])
                x2 = np.column_stack([np.interp(t1[t1 <= m], t2, q) for q in x2.T])
                x1 = x1[: len(x2)]
                worst, tried = max(worst, float(np.sqrt(np.mean((x1 - x2) ** 2) / np.mean(x2**2)))), tried + 1
            if tried == 3:
                break
        print(f"{name:35s} half the step: {worst:.2e} ({tried} draws)", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=Path)
    parser.add_argument("--bodies", type=Path, default=Path(__file__).parent / "bodies")
    parser.add_argument("--effects", action="store_true")
    given = parser.parse_args()
    if given.effects:
        return check_effects(given.bodies)
    for path in sorted((given.out / "labels").glob("*.json")):
        label, case = json.loads(path.read_text()), given.out / "cases" / path.stem
        wrong = check_case(case, label)
        if label["null"]:
            body = body_of(case / "model.nc")
            gaps = [null_gap(body, p) for p in sorted(case.glob("record*.csv"))]
            wrong.append(f"null: gaps {np.round(gaps, 3)}, of noise and coefficients {np.round(label['gap_without_cause'], 3)}")
        print(path.stem, "; ".join(wrong) or "good", flush=True)


if __name__ == "__main__":
    main()
