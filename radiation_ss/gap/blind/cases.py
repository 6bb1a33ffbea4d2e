"""Sealed cases: a random body, a set of records, a hidden cause of stated strength, or none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from radiation_ss.arrays import FloatArray
from radiation_ss.errors import SolverError
from radiation_ss.gap.blind import bodies
from radiation_ss.gap.blind.bodies import Body
from radiation_ss.gap.blind.causes import ALL, CAUSES, Hidden, Typical, candidates, draw
from radiation_ss.gap.blind.experiments import Plan, Run, Sensors, happen, plans, write_down
from radiation_ss.hydro.data import HydroData
from radiation_ss.simulate.record import Record

# Shares of the classes of cases and of the bodies.
MIX = {"none": 0.25, "single": 0.35, "pair": 0.15, "outside": 0.15, "formula": 0.10}
SHARES = {"heave": 0.5, "sway-roll": 0.3, "roll": 0.2}
TOLERANCE = 0.02
GAPS = (0.05, 0.1, 0.2)


@dataclass(frozen=True)
class Case:
    """A case: what is given away, and the label that is sealed.

    Parameters
    ----------
    data : HydroData
        The nominal model.
    records : tuple of Record
    unseen : Record
        One more test, not for the diagnosis.
    label : dict
    """

    data: HydroData
    records: tuple[Record, ...]
    unseen: Record
    label: dict[str, Any]


def distance(one: Sequence[Run], other: Sequence[Run], tests: Sequence[Plan]) -> float:
    """Return the gap: rms of the difference of two motions over the rms of the first, each dof by its own rms."""
    terms = []
    for i in range(one[0].x.shape[0]):
        kept = [(a.x[i][a.time >= p.cut], b.x[i][b.time >= p.cut]) for a, b, p in zip(one, other, tests)]
        power = sum(float(np.sum(a**2)) for a, _ in kept)
        terms.append(sum(float(np.sum((a - b) ** 2)) for a, b in kept) / power)
    return float(np.sqrt(np.mean(terms)))


def typical(runs: Sequence[Run], body: Body, dof: int) -> Typical:
    """Return typical sizes of a degree of freedom in the tests."""

    def rms(rows: Sequence[FloatArray]) -> float:
        return float(np.sqrt(np.mean(np.concatenate(rows) ** 2)))

    return Typical(rms([r.x[dof] for r in runs]), rms([r.v[dof] for r in runs]), rms([r.a[dof] for r in runs]),
                   rms([r.force[dof] for r in runs]), float((body.M + body.A_inf)[dof, dof]), float(body.C[dof, dof]),
                   float(body.frequencies()[dof]), runs[0].time[-1])


def at_gap(item: Hidden, target: float, body: Body, tests: Sequence[Plan], calm: Sequence[Run]) -> tuple[Hidden, float]:
    """Return the cause at the strength that opens the wanted gap on these tests, and the gap reached.

    Raises
    ------
    SolverError
        If no strength gives the gap within a factor of 1.5.
    """
    weak, strong = 0.0, np.inf
    for _ in range(9):
        gap = distance([happen(body, test, [item]) for test in tests], calm, tests)
        if np.isfinite(gap) and 0.8 < gap / target < 1.25:
            break
        if gap < target:
            weak = item.strength
        else:
            strong = item.strength
        step = float(np.clip(target / gap, 0.2, 5.0)) if np.isfinite(gap) and gap > 0.0 else 2.0
        guess = item.strength * step
        if not weak < guess < strong or (weak > 0.0 and np.isfinite(strong)):
            guess = float(np.sqrt(weak * strong)) if weak > 0.0 else 0.5 * strong
        item = replace(item, strength=guess)
    if not np.isfinite(gap) or not 1 / 1.5 < gap / target < 1.5:
        raise SolverError(f"{item.cause}: no strength gives a gap of {target}")
    return item, gap


def hide(names: Sequence[str], body: Body, tests: Sequence[Plan], target: float, rng: np.random.Generator,
         ) -> tuple[list[Hidden], list[float]]:
    """Return causes at strengths that open the wanted gap, each by itself."""
    calm = [happen(body, test) for test in tests]
    found, gaps = [], []
    for name in names:
        dof = int(rng.integers(len(body.dofs)))
        if CAUSES[name].law in ("clip", "soft_clip"):
            dof = 0
        item = draw(name, dof, typical(calm, body, dof), rng)
        relative = within(item, body)
        if relative:
            # A cause like a parameter is drawn by its size, at least four times the tolerance.
            item = replace(item, strength=TOLERANCE * rng.uniform(4.0, 10.0) / relative)
            gap = distance([happen(body, test, [item]) for test in tests], calm, tests)
        else:
            item, gap = at_gap(item, target, body, tests, calm)
        found.append(item)
        gaps.append(gap)
    return found, gaps


def within(item: Hidden, body: Body) -> float:
    """Return the relative size of a parameter-like cause at strength 1; 0 for other causes."""
    d = item.dof
    scale = {"linear_stiffness": body.C[d, d], "added_inertia": body.M[d, d], "radiation_damping": 1.0,
             "excitation_gain": 1.0, "sensor_gain": 1.0, "coupling_inertia": 1.0}.get(item.cause)
    return abs(item.parameters[0]) / float(scale) if scale else 0.0


def sensors(body: Body, kind: str, hidden: Sequence[Hidden], rng: np.random.Generator) -> Sensors:
    """Return random sensors. Motion only shows a faulty sensor by a sound one beside it: an accelerometer."""
    period = 2 * np.pi / float(body.frequencies().max())
    faults = {item.cause for item in hidden if item.cause.startswith("sensor_")}
    both = bool(rng.random() < 0.3) or (kind == "motion-only" and bool(faults))
    return Sensors(step=period / rng.uniform(24, 48), jitter=0.3 * (rng.random() < 0.15),
                   noise=rng.uniform(0.004, 0.015), missing=0.02 * (rng.random() < 0.15),
                   acceleration=both and not any(item.cause in ("clock_drift", "cross_axis") for item in hidden))


def make(seed: np.random.SeedSequence, group: str, body_kind: str, kind: str) -> Case:
    """Return one case; the same seed gives the same case."""
    rng = np.random.default_rng(seed)
    pool = candidates(group, kind, body_kind) if group != "none" else []
    while True:
        nominal = bodies.BODIES[body_kind](rng)
        body, off = bodies.truth(nominal, TOLERANCE, rng)
        tests, last = plans(kind, body, rng)
        target = float(rng.choice(GAPS))
        count = {"none": 0, "pair": 2}.get(group, 1)
        names = [str(name) for name in rng.choice(pool, count, replace=False)] if count else []
        try:
            hidden, gaps = hide(names, body, tests, target, rng)
        except SolverError:
            continue
        runs = [happen(body, test, hidden) for test in (*tests, last)]
        if all(np.isfinite(run.x).all() for run in runs):
            break
    calm = [happen(body, test) for test in tests]
    kit = sensors(nominal, kind, hidden, rng)
    *records, unseen = (write_down(run, test, nominal, kit, rng) for run, test in zip(runs, (*tests, last)))
    causes = [{"cause": item.cause, "names": list(CAUSES[item.cause].names), "group": CAUSES[item.cause].group,
               "linear": CAUSES[item.cause].linear, "dof": nominal.dofs[item.dof], "gap": gap,
               "law": item.law() or [item.cause, item.strength * item.parameters[0]]}
              for item, gap in zip(hidden, gaps)]
    label = {"group": group, "body": body_kind, "kind": kind, "causes": causes, "tolerance": TOLERANCE,
             "gap": distance(runs[:-1], calm, tests), "noise": kit.noise, "acceleration": kit.acceleration,
             "errors": off}
    return Case(nominal.data(), tuple(records), unseen, label)


def schedule(count: int, rng: np.random.Generator, kinds: Sequence[str] = ALL,
             groups: Sequence[str] | None = None, some: Sequence[str] | None = None) -> list[tuple[str, str, str]]:
    """Return (class, body, kind of records) of each case, shuffled; kinds in turn, the rest by share or in turn."""
    if groups is None:
        classes = [group for group, share in MIX.items() for _ in range(round(share * count))]
        classes = (classes + ["none"] * count)[:count]
    else:
        classes = [groups[i % len(groups)] for i in range(count)]
    plan = []
    for i, group in enumerate(classes):
        allowed = [kind for kind in kinds if kind != "motion-only" or group in ("none", "single")] or ["decays+waves"]
        body = some[i % len(some)] if some else str(rng.choice(list(SHARES), p=list(SHARES.values())))
        plan.append((group, body, allowed[i % len(allowed)]))
    return [plan[i] for i in rng.permutation(count)]
