"""python-control's paths beside ours, the same answer from both, and how cost grows.

Run: OMP_NUM_THREADS=1 python benchmarks/control_paths.py [--quick]
Processor time on one core, best of several repeats: only ratios within one run mean something.
"""

from __future__ import annotations

import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from datetime import date
from pathlib import Path

import control as ct
import numpy as np
from scipy.linalg import block_diag

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss
from radiation_ss.fit.rational import frequency_response
from radiation_ss.simulation import exact_step, linear_response, propagate

SIX = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
Row = tuple[str, float, float, float, float]


def clock(run: Callable[[], object], repeats: int) -> tuple[float, object]:
    """Return the best processor time [s] of several runs after a first one, and the result."""
    result = run()
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        result = run()
        best = min(best, time.process_time() - start)
    return best, result


def difference(ours: object, theirs: object) -> float:
    """Return the largest difference relative to the largest value."""
    a, b = np.asarray(ours), np.asarray(theirs)
    return float(np.abs(a - b).max() / np.abs(b).max())


def entry(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return one subsystem of order 3: a pair and a real pole of a radiation memory."""
    rng = np.random.default_rng(seed)
    w, z = rng.uniform(0.5, 1.5), rng.uniform(0.3, 0.8)
    a = block_diag([[-2.0 * z * w, -w], [w, 0.0]], [[-2.0 * w]])
    b = rng.uniform(0.5, 1.0, (3, 1))
    return a, b, b.T.copy()


def memory(dofs: tuple[str, ...], order: int, seed: int = 0) -> rss.RadiationFit:
    """Return a passive memory with `order` states for each degree of freedom, fully coupled."""
    rng = np.random.default_rng(seed)
    n = len(dofs)
    pairs = [(rng.uniform(0.4, 2.0), rng.uniform(0.3, 0.9)) for _ in range(n * order // 2)]
    a = block_diag(*[np.array([[-2.0 * z * w, -w], [w, 0.0]]) for w, z in pairs])
    b = np.zeros((a.shape[0], n))
    b[::2] = 400.0 * rng.standard_normal((len(pairs), n))
    return rss.RadiationFit(dofs, a, b, b.T.copy(), order)


def model(dofs: tuple[str, ...], order: int) -> rss.Model:
    """Return a body with that memory."""
    n = len(dofs)
    half = np.random.default_rng(1).standard_normal((n, n)) * 0.2
    M = 1e6 * (np.eye(n) + half @ half.T / n)
    return rss.Model(dofs, M, 0.6 * M, 1e6 * np.diag(np.linspace(0.5, 1.5, n)), memory(dofs, order))


def frequency_rows(repeats: int) -> list[Row]:
    """Frequency responses: one subsystem at 1e4 frequencies, 36 at 1e3, and a joint memory."""
    a, b, c = entry(0)
    one, w = ct.ss(a, b, c, 0), np.geomspace(0.01, 100.0, 10_000)
    theirs, ref = clock(lambda: ct.frequency_response(one, w).frdata[0, 0], 2)
    ours, got = clock(lambda: frequency_response(a, b, c, w)[:, 0, 0], repeats)
    rows: list[Row] = [("frequency_response, order 3, 1e4 frequencies", theirs, ours, 300, difference(got, ref))]
    w = np.geomspace(0.01, 100.0, 1000)
    entries = [entry(seed) for seed in range(36)]
    many = [ct.ss(*abc, 0) for abc in entries]
    A, B, C = (np.stack(part) for part in zip(*entries))
    theirs, ref = clock(lambda: [ct.frequency_response(s, w).frdata[0, 0] for s in many], 2)
    ours, got = clock(lambda: frequency_response(A, B, C, w)[:, :, 0, 0], repeats)
    rows.append(("frequency_response, 36 subsystems, 1e3 frequencies", theirs, ours, 500, difference(got, ref)))
    joint = memory(SIX, 6)
    theirs, ref = clock(lambda: np.moveaxis(ct.frequency_response(joint.to_ss(), w).frdata, -1, 0), 2)
    ours, got = clock(lambda: joint.frequency_response(w), repeats)
    rows.append(("frequency_response, joint 6 x 6 of 36 states, 1e3", theirs, ours, np.nan, difference(got, ref)))
    return rows


def simulation_rows(repeats: int) -> list[Row]:
    """Long simulations under a sampled force with an initial state."""
    rows: list[Row] = []
    heave = model(("Heave",), 4)
    for name, system, asked in (("one subsystem, order 3", ct.ss(*entry(0), 0), 300.0),
                                ("heave composite, 6 states, 3 outputs", rss.cummins(heave), np.nan),
                                ("6-dof composite, 48 states, 18 outputs", rss.cummins(model(SIX, 6)), np.nan)):
        rng = np.random.default_rng(0)
        t = 0.02 * np.arange(100_000)
        u, x0 = rng.standard_normal((system.ninputs, t.size)), rng.standard_normal(system.nstates)
        theirs, ref = clock(lambda: ct.forced_response(system, t, u, x0).y, 2)  # noqa: B023
        ours, got = clock(lambda: linear_response(system, t, u, x0=x0).y, repeats)  # noqa: B023
        rows.append((f"forced_response, 1e5 samples, {name}", theirs, ours, asked, difference(got, ref)))
    return rows


def by_interconnect(body: ct.StateSpace, parts: list[ct.StateSpace], stems: list[str]) -> ct.StateSpace:
    """Return the composite from blocks by signal names: the body, its memory, a sum of forces for each dof."""
    radiation = {s: [f"-{label}" for part in parts for label in part.output_labels if label.split("_rad")[0] == s]
                 for s in stems}
    sums = [ct.summing_junction([f"{s}_wave", *radiation[s]], f"{s}_force") for s in stems]
    return ct.interconnect([body, *parts, *sums], inputs=[f"{s}_wave" for s in stems], outputs=body.output_labels)


def assembly_rows(repeats: int) -> list[Row]:
    """Composite of six degrees of freedom: one joint memory, and 36 subsystems connected by name."""
    rows: list[Row] = []
    stems = [d.lower() for d in SIX]
    for order in (2, 6):
        plant = model(SIX, order)
        body, radiation = rss.rigid_body(plant), plant.fit.to_ss()
        theirs, ref = clock(lambda: by_interconnect(body, [radiation], stems), 2)  # noqa: B023
        ours, got = clock(lambda: rss.cummins(plant), 5 * repeats)  # noqa: B023
        rows.append((f"ct.interconnect, 6 dof, joint radiation model of {plant.fit.states} states", theirs, ours, 100.0,
                     difference(got(1.3j), ref(1.3j))))
    entries = [entry(seed) for seed in range(36)]
    parts, b, c = [], np.zeros((108, 6)), np.zeros((6, 108))
    for k, (ak, bk, ck) in enumerate(entries):
        i, j = divmod(k, 6)
        scale = 2e5 if i == j else 1e4
        parts.append(ct.ss(ak, bk, scale * ck, 0, inputs=[f"{stems[j]}_vel"], outputs=[f"{stems[i]}_rad{j}"],
                           name=f"k{k}"))
        b[3 * k:3 * k + 3, j], c[i, 3 * k:3 * k + 3] = bk[:, 0], scale * ck[0]
    fit = rss.RadiationFit(SIX, block_diag(*[ak for ak, _, _ in entries]), b, c, 3)
    plant = model(SIX, 2).replace(fit=fit)
    body = rss.rigid_body(plant)
    theirs, ref = clock(lambda: by_interconnect(body, parts, stems), 1)
    ours, got = clock(lambda: rss.cummins(plant), 5 * repeats)
    rows.append(("ct.interconnect, 6 dof, 36 subsystems of order 3", theirs, ours, 100.0,
                 difference(got(1.3j), ref(1.3j))))
    return rows


def growth(quick: bool) -> dict[str, tuple[str, list[float], dict[str, list[float]]]]:
    """Return time [s] against degrees of freedom, order and record length: name -> (unit, sizes, series)."""
    dofs = [1, 2, 3, 6, 12]
    names = tuple(f"b{i // 6}__{SIX[i % 6]}" for i in range(12))
    w, t = np.geomspace(0.01, 100.0, 1000), 0.1 * np.arange(20_000)
    tables = {}
    for label, sizes, build in (("degrees of freedom (order 4)", dofs, lambda n: model(names[:n], 4)),
                                ("order (6 degrees of freedom)", [2, 4, 6, 8, 10], lambda n: model(SIX, n))):
        series: dict[str, list[float]] = {}
        for size in sizes:
            plant = build(size)
            u = np.random.default_rng(0).standard_normal((plant.n, t.size))
            for key, run in (("assembly", lambda: rss.cummins(plant)),  # noqa: B023
                             ("response, 1e3 frequencies", lambda: plant.fit.frequency_response(w)),  # noqa: B023
                             ("simulation, 2e4 samples", lambda: linear_response(plant, t, u))):  # noqa: B023
                series.setdefault(key, []).append(clock(run, 8)[0])
        tables[label] = ("size", [float(s) for s in sizes], series)
    lengths = [10.0**k for k in range(3, 6 if quick else 8)]
    heave = model(("Heave",), 4)
    taken = []
    for length in lengths:
        long = 0.1 * np.arange(int(length))
        u = np.random.default_rng(0).standard_normal(long.size)
        taken.append(clock(lambda: linear_response(heave, long, u), 5 if length < 1e6 else 1)[0])  # noqa: B023
    tables["samples (heave, order 4)"] = ("samples", lengths, {"simulation": taken})
    return tables


def streamed_memory(lengths: tuple[int, ...]) -> list[tuple[int, float]]:
    """Return the peak memory [MB] of a simulation that is fed and read in pieces of 1e4 samples."""
    plant, found, piece = model(("Heave",), 4), [], 10_000
    step = exact_step(*plant.matrices(), 0.1)
    for length in lengths:
        rng, x, total = np.random.default_rng(0), np.zeros(step.F.shape[0]), 0.0
        last = np.zeros((1, 1))
        tracemalloc.start()
        for _ in range(length // piece):
            u = np.concatenate([last, rng.standard_normal((piece, 1))])
            states = propagate(step, u, x)
            x, last = states[-1], u[-1:]
            total += float(np.sum(states[1:, -2] ** 2))
        found.append((length, tracemalloc.get_traced_memory()[1] / 1e6))
        tracemalloc.stop()
    return found


def slope(sizes: list[float], times: list[float]) -> float:
    """Return the exponent of the growth between the last two sizes."""
    return float(np.log(times[-1] / times[-2]) / np.log(sizes[-1] / sizes[-2]))


def draw(tables: dict[str, tuple[str, list[float], dict[str, list[float]]]], path: Path) -> None:
    """Draw cost against size, log-log."""
    from radiation_ss import style

    figure, axes = style.figure(1, len(tables))
    for panel, (label, (_, sizes, series)) in zip(axes[0], tables.items()):
        for (name, times), colour in zip(series.items(), style.COLOURS):
            panel.loglog(sizes, times, "o-", color=colour, label=name, ms=3)
        panel.set(xlabel=label, ylabel="processor time [s]", xlim=(0.8 * sizes[0], 1.25 * sizes[-1]),
                  ylim=(None, 30.0 * max(max(times) for times in series.values())))
        if sizes[-1] < 100.0:
            panel.set_xticks(sizes, [f"{size:g}" for size in sizes], minor=False)
            panel.set_xticks([], minor=True)
        panel.legend(fontsize=7, loc="upper left")
    figure.savefig(path)


PROFILE = """
`difference` is the largest one relative to the largest value; 1e-10 is asked.

## How cost grows

![cost](control_paths.svg)
"""

EXPLANATION = """
Peak memory of a simulation fed and read in pieces of 1e4 samples (`exact_step` once, `propagate` for each piece):
"""


def report(rows: list[Row], tables: dict[str, tuple[str, list[float], dict[str, list[float]]]],
           held: list[tuple[int, float]]) -> str:
    """Return the page as markdown."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True,
                            check=True)
    lines = ["# python-control's paths against ours", "",
             f"{date.today().isoformat()}, commit {commit.stdout.strip()}, control {ct.__version__}, "
             f"numpy {np.__version__}. Processor time on one core, best of several repeats, one run.", "",
             "Rerun: `OMP_NUM_THREADS=1 python benchmarks/control_paths.py`", "",
             "| what | python-control [ms] | ours [ms] | ratio | asked | difference |", "|---|---|---|---|---|---|"]
    for name, theirs, ours, asked, error in rows:
        goal = "" if np.isnan(asked) else f">= {asked:.0f}"
        lines.append(f"| {name} | {1e3 * theirs:.3g} | {1e3 * ours:.3g} | {theirs / ours:.0f} | {goal} | {error:.0e} |")
    lines += PROFILE.splitlines() + [""]
    for label, (_, sizes, series) in tables.items():
        lines.append(f"* {label}, {sizes[0]:g} to {sizes[-1]:g}: " + "; ".join(
            f"{name} {1e3 * times[0]:.3g} to {1e3 * times[-1]:.3g} ms, slope at the end {slope(sizes, times):.1f}"
            for name, times in series.items()))
    lines += ["", *EXPLANATION.strip().splitlines()]
    lines[-1] += " " + ", ".join(f"{length:g} samples {size:.1f} MB" for length, size in held) + "."
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the table and write the page."""
    quick = "--quick" in sys.argv
    repeats = 5 if quick else 20
    rows = frequency_rows(repeats) + simulation_rows(repeats) + assembly_rows(repeats)
    tables = growth(quick)
    held = streamed_memory((100_000,) if quick else (100_000, 1_000_000, 10_000_000))
    page = report(rows, tables, held)
    print(page)
    if not quick:
        target = ROOT / "docs" / "validation"
        target.mkdir(parents=True, exist_ok=True)
        (target / "control_paths.md").write_text(page, encoding="utf-8")
        draw(tables, target / "control_paths.svg")


if __name__ == "__main__":
    main()
