"""Make blind cases of diagnosis: a nominal model, measured records, and labels that say what was left out.

    python make.py SEED PREFIX COUNT OUT [--bodies DIR]

writes OUT/cases/<PREFIX>01/{model.nc, record_1.csv, ..., unseen.csv} and OUT/labels/<PREFIX>01.json. Everything is
drawn from the seed. About 20 % of the cases have no cause, 10 % one that no library holds, the others one to three.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import causes as catalogue
import gauges
import hydro
import instruments
import numpy as np
from outside import OUTSIDE
from truth import Truth, memory, read, run, target

from tests import Setup, lively, programme

PLANE = [["Surge"], ["Heave"], ["Heave"], ["Surge", "Heave"], ["Surge", "Pitch"], ["Surge", "Heave", "Pitch"], ["Pitch"]]
SHIP = [["Heave"], ["Roll"], ["Roll"], ["Pitch"], ["Heave", "Pitch"], ["Heave", "Pitch"], ["Sway", "Roll"],
        ["Heave", "Roll"], ["Sway", "Heave", "Roll"], ["Surge", "Heave", "Pitch"]]
FAMILIES = {  # name: tables that tell of the same body, sets of degrees of freedom
    "sphere": (["sphere_fine", "sphere_coarse", "hulme"], [["Heave"], ["Heave"], ["Surge", "Heave"]]),
    "cylinder": (["cylinder_fine", "cylinder_coarse", "yeung_1_20"], PLANE),
    "disc": (["yeung_0.5_4"], [["Heave"]]), "drum": (["yeung_2_8"], [["Heave"]]),
    "spar": (["spar_fine", "spar_coarse"], PLANE), "barge": (["barge_fine", "barge_coarse"], SHIP),
    "ship": (["ship_fine", "ship_coarse"], SHIP),
    "semi": (["semi_fine", "semi_coarse"], SHIP)}
NEEDS = {  # what the seen records must offer: f a known input, e elevation, p anything but prescribed motion only
    "quadratic_drag": "", "linear_damping": "", "coulomb_friction": "", "linear_stiffness": "", "cubic_stiffness": "",
    "quadratic_stiffness": "", "slack_mooring": "", "added_inertia": "", "hysteresis": "", "end_stop": "",
    "viscous_memory": "broad", "tank_resonance": "", "mooring_lines": "horizontal", "crossflow_drag": "Heave Pitch",
    "radiation_damping": "broad", "coupling_inertia": "two", "constant_force": "p", "sensor_bias": "p",
    "delayed_feedback": "p broad", "slow_drift": "waves", "wave_drift": "e irregular", "parametric_stiffness": "e",
    "morison_drag": "e water", "relative_damping": "e water", "water_on_deck": "e Heave", "slamming": "e Heave",
    "lift_damping": "speeds", "excitation_gain": "f", "excitation_delay": "f", "clock_offset": "f", "clock_drift": "f",
    "sensor_gain": "f", "sensor_delay": "f", "cross_axis": "p two", "actuator_saturation": "forced"}
STEPS = 120  # a natural period


class Dropped(Exception):
    """This draw is not to be used."""


def draw_body(rng: np.random.Generator, tables: Path) -> tuple[str, hydro.Body, hydro.Body, dict]:
    """Return a family's name, the nominal and the true body, and what the label says of them."""
    name = str(rng.choice(list(FAMILIES), p=[0.12, 0.15, 0.05, 0.05, 0.14, 0.17, 0.2, 0.12]))
    files, sets = FAMILIES[name]
    dofs = list(sets[rng.integers(len(sets))])
    files = [f for f in files if set(dofs) <= set(np.load(tables / f"{f}.npz")["dofs"])]
    mine = str(rng.choice(files))
    unit = np.load(tables / f"{mine}.npz")["M"][0, 0]
    low, high = (2, 500) if rng.random() < 0.55 else (2e4, 2e7)
    size, rho = float((np.exp(rng.uniform(np.log(low), np.log(high))) / unit) ** (1 / 3)), float(rng.choice([1000.0, 1025.0]))
    heading = int({"Sway", "Roll"} & set(dofs) != set())
    nominal = hydro.moored(hydro.load(tables / f"{mine}.npz", tuple(dofs), heading, size, rho), rng)
    sd, source, apart = float(rng.choice([0.004, 0.01, 0.02])), mine, 0.0
    others = [f for f in files if f != mine and f != "hulme"]
    base, other = nominal, str(rng.choice(others)) if others and rng.random() < 0.6 else ""
    if other:
        b = hydro.load(tables / f"{other}.npz", tuple(dofs), heading, size, rho)
        source, (base, apart) = other, hydro.toward(nominal, b, 1.5 * sd)
    true = hydro.perturbed(base, rng, sd, 0.3 * sd if other else None)
    return name, nominal, true, {"body": name, "mass": float(nominal.M[0, 0]) if dofs[0] not in hydro.ROTATIONS else None,
                                 "size": size, "dofs": dofs, "nominal": mine, "true": source, "apart": apart, "sd": sd}


def eligible(name: str, ctx: catalogue.Context) -> bool:
    """Return whether a cause can show in these records."""
    said = {"f": bool(ctx.kinds & {"waves", "forced"}), "e": "eta" in ctx.columns, "p": ctx.kinds != {"prescribed"},
            "two": ctx.n > 1, "waves": "waves" in ctx.kinds, "irregular": ctx.irregular, "forced": "forced" in ctx.kinds,
            "broad": bool(ctx.kinds & {"waves", "forced", "prescribed"}), "speeds": ctx.speeds > 1 and bool(
                set(ctx.dofs) & {"Roll", "Heave", "Pitch"}), "horizontal": bool(set(ctx.dofs) & {"Surge", "Sway"}),
            "water": bool(set(ctx.dofs) & set(catalogue.WATER)), "Heave": "Heave" in ctx.dofs, "Pitch": "Pitch" in ctx.dofs}
    return all(said[k] for k in NEEDS[name].split())


def maker(name: str):
    """Return what draws a cause of this name."""
    return getattr(catalogue, name, None) or getattr(gauges, name)


class Bench:
    """The seen tests, simulated with any set of causes, and gaps between what they give."""

    def __init__(self, setup: Setup, tests: list, noise: float) -> None:
        self.setup, self.tests = setup, tests
        self.K = memory(setup, setup.true)
        bare = replace(setup, true=setup.nominal)
        nominal = Truth.plain(bare, memory(bare, setup.nominal))
        self.plain = self.simulate([])
        self.nominal = [target(t, self.one(nominal, replace(t, force=t.known))) for t in tests]
        self.scale = np.sqrt(np.mean(np.concatenate([p**2 for p in self.plain]), axis=0))
        if not np.all(np.isfinite(self.scale)):
            raise Dropped("unstable without a cause")
        self.base = np.sqrt(np.square(self.gaps(self.plain, self.nominal)) + 1.5 * noise**2)

    def one(self, truth: Truth, test) -> dict:
        return read(truth, test, run(truth, test))

    def truth(self, causes: list) -> Truth:
        truth = Truth.plain(self.setup, self.K)
        for cause, s in causes:
            cause.put(truth, s)
        return truth

    def simulate(self, causes: list) -> list:
        truth = self.truth(causes)
        return [target(t, self.one(truth, t)) for t in self.tests]

    def gaps(self, one: list, other: list) -> np.ndarray:
        """Return the gap of every record: rms over time and degrees of freedom, each over its rms in all records."""
        return np.array([np.sqrt(np.mean(((a - b) / self.scale) ** 2)) for a, b in zip(one, other)])

    def ratio(self, one: list, other: list) -> tuple[float, float]:
        """Return the gap over that of noise and coefficients, pooled over records that a cause moves; and the gap."""
        g = self.gaps(one, other)
        if not np.all(np.isfinite(g)) or not g.max() > 0:
            return (np.inf, np.inf) if g.size and not np.all(np.isfinite(g)) else (0.0, 0.0)
        on = g > 0.25 * g.max()
        size, base = np.sqrt(np.mean(g[on] ** 2)), np.sqrt(np.mean(self.base[on] ** 2))
        return float(size / base), float(size)

    def fit_strength(self, cause, want: float, most: float) -> float:
        """Return the strength that gives this ratio, though no gap beyond `most`; by bisection of its logarithm."""
        def reach(s: float) -> float:
            r, g = self.ratio(self.simulate([(cause, s)]), self.plain)
            return r if g < most else np.inf
        low, high = cause.low, cause.high
        if reach(low) > want:
            raise Dropped(f"{cause.name}: too strong at its least")
        for _ in range(6):
            mid = np.sqrt(low * high)
            low, high = (mid, high) if reach(mid) < want else (low, mid)
        return float(low)


def physical(setup: Setup, tests: list, truth: Truth) -> bool:
    """Return whether no motion is beyond what a test or a hull allows."""
    limit = np.array([{"Roll": 0.55, "Pitch": 0.3}.get(d, 3.0 * x) for d, x in zip(setup.nominal.dofs, setup.lively)])
    limit[[d in ("Surge", "Sway") for d in setup.nominal.dofs]] *= 2
    return all(np.all(abs(run(truth, t)[1]).max(axis=0) < limit) for t in tests)


def draw_causes(rng, plan, ctx: catalogue.Context, bench: Bench) -> list:
    """Return the drawn causes with their strengths; plan is a number of causes or "outside"."""
    if plan == "outside":
        makers = [OUTSIDE[rng.integers(len(OUTSIDE))]]
    else:
        names = [n for n in NEEDS if eligible(n, ctx)]
        makers = [maker(str(n)) for n in rng.permutation(names)]
    found, tries = [], 0
    for make in makers:
        if len(found) == (1 if plan == "outside" else plan) or tries > 5:
            break
        cause = make(ctx, rng)
        if any(set(cause.accept) & set(c.accept) for c, _ in found):
            continue
        tries += 1
        want, most = float(np.exp(rng.uniform(np.log(3.6), np.log(25)))), float(rng.uniform(0.4, 0.9))
        try:
            s = bench.fit_strength(cause, want, most)
        except Dropped:
            continue
        if bench.ratio(bench.simulate([(cause, s)]), bench.plain)[0] >= 3.3:
            found.append((cause, s))
    if len(found) < (1 if plan == "outside" else plan):
        raise Dropped("causes are too weak here")
    return found


def draw_case(rng: np.random.Generator, plan, tables: Path) -> dict:
    """Return a case: set-up, tests, truth, label; Dropped where the draw is of no use."""
    name, nominal, true, told = draw_body(rng, tables)
    w = nominal.natural()
    h = 2 * np.pi / w.max() / STEPS
    setup = Setup(nominal, true, min(h, 2 * np.pi / nominal.omega[-1] / 24), lively(name, nominal), w,
                  1 + told["sd"] * float(np.clip(rng.normal(), -2.5, 2.5)))
    kind, seen, unseen = programme(setup, rng)
    box = instruments.Instruments.draw(rng, nominal.n)
    bench = Bench(setup, seen, box.noise)
    waves = [t for t in seen if t.kind == "waves"]
    columns = set().union(*(t.show for t in waves)) if waves else set()
    ctx = catalogue.Context(setup, {t.kind for t in seen}, columns, len({t.speed for t in seen}),
                            float(np.mean([np.std(t.eta) for t in waves])) if waves else 1.0, max(t.span for t in seen), kind != "regular")
    causes = draw_causes(rng, plan, ctx, bench) if plan else []
    truth, whole = bench.truth(causes), bench.simulate(causes)
    if not physical(setup, seen + unseen, truth):
        raise Dropped("the motion is beyond bounds")
    said = []
    for k, (cause, s) in enumerate(causes):
        ratio, size = bench.ratio(whole, bench.simulate(causes[:k] + causes[k + 1:]))
        if ratio < 3.0 or not size < 1.4:
            raise Dropped(f"{cause.name} hides behind others or grows with them")
        said.append({"name": cause.name, "dof": cause.dof, "outside": cause.outside, "parameters": cause.tell(s),
                     "strength": s, "gap": size, "over_noise_and_coefficients": ratio})
    label = {"null": not causes, "accept": [c.accept for c, _ in causes], "causes": said, **told, "programme": kind,
             "records": [t.kind for t in seen], "noise": box.noise, "gap_without_cause": bench.base.tolist()}
    return {"setup": setup, "seen": seen, "unseen": unseen, "truth": truth, "label": label, "box": box}


def write_case(rng: np.random.Generator, case: dict, folder: Path, label: Path) -> None:
    """Simulate and write all records, the model and the label."""
    setup, truth, box = case["setup"], case["truth"], case["box"]
    folder.mkdir(parents=True, exist_ok=True)
    hydro.write(setup.nominal, folder / "model.nc")
    tests = case["seen"] + case["unseen"]
    all_said = [read(truth, t, run(truth, t)) for t in tests]
    rms = {k: np.sqrt(np.mean(np.concatenate([s[k] ** 2 for s in all_said[: len(case["seen"])]]), axis=0)) for k in "xvaf"}
    names = [f"record_{k + 1}" for k in range(len(case["seen"]))] + ["unseen", "unseen_2"]
    for test, said, name in zip(tests, all_said, names):
        columns = instruments.record(rng, box, test, setup.nominal.dofs, said, rms, truth.lost(test.span))
        instruments.write(folder / f"{name}.csv", test, columns, name)
    label.parent.mkdir(parents=True, exist_ok=True)
    label.write_text(json.dumps(case["label"], indent=1))


def plans(rng: np.random.Generator, count: int) -> list:
    """Return what to draw in each case: 20 % nulls, 10 % outside, the rest one, two or three causes."""
    nulls, outs = round(0.2 * count), round(0.1 * count)
    rest = rng.choice([1, 2, 3], count - nulls - outs, p=[0.64, 0.26, 0.1])
    return [([0] * nulls + ["outside"] * outs + [int(r) for r in rest])[k] for k in rng.permutation(count)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seed", type=int)
    parser.add_argument("prefix")
    parser.add_argument("count", type=int)
    parser.add_argument("out", type=Path)
    parser.add_argument("--first", type=int, default=1, help="go on from this case")
    parser.add_argument("--bodies", type=Path, default=Path(__file__).parent / "bodies")
    given = parser.parse_args()
    dropped: dict[str, int] = {}
    for k, plan in enumerate(plans(np.random.default_rng([given.seed]), given.count)):
        if k + 1 < given.first:
            continue
        began = time.process_time()
        for attempt in range(60):
            rng = np.random.default_rng([given.seed, k + 1, attempt])
            try:
                case = draw_case(rng, plan, given.bodies)
            except Dropped as why:
                dropped[str(why)] = dropped.get(str(why), 0) + 1
                continue
            name = f"{given.prefix}{k + 1:02d}"
            write_case(rng, case, given.out / "cases" / name, given.out / "labels" / f"{name}.json")
            print(f"{name}: {attempt + 1} draws, {time.process_time() - began:.1f} s", flush=True)
            break
        else:
            raise RuntimeError(f"no draw for case {k + 1} was of use")
    (given.out / "dropped.json").write_text(json.dumps(dropped, indent=1))


if __name__ == "__main__":
    main()
