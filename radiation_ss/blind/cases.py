"""Sealed cases: a random body, a set of records, a hidden cause of stated strength, or none."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from radiation_ss.blind import bodies
from radiation_ss.blind.bodies import Body
from radiation_ss.blind.causes import ALL, CAUSES, Hidden, candidates
from radiation_ss.blind.experiments import Sensors, happen, plans, write_down
from radiation_ss.blind.strength import TOLERANCE, distance, hide, of_size
from radiation_ss.errors import InputError, SolverError
from radiation_ss.hydro.data import HydroData
from radiation_ss.records.record import Record

# Shares of the classes of cases and of the bodies.
MIX = {"none": 0.25, "single": 0.35, "pair": 0.15, "outside": 0.15, "formula": 0.10}
MIXES = {"standard": MIX, "nulls": {"none": 1.0}}
SHARES = {"heave": 0.5, "sway-roll": 0.3, "roll": 0.2}


@dataclass(frozen=True)
class Case:
    """A case: what is given away, and the label that is sealed."""

    data: HydroData  # The nominal model
    records: tuple[Record, ...]
    unseen: Record  # One more test, not for the diagnosis
    label: dict[str, Any]


def sensors(body: Body, kind: str, hidden: Sequence[Hidden], rng: np.random.Generator,
            drift: float | None = None) -> Sensors:
    """Return random sensors, their zeros wandering by a given share of the motion or a random one.

    Motion only shows a faulty sensor by a sound one beside it: an accelerometer.
    """
    period = 2 * np.pi / float(body.frequencies().max())
    faults = {item.cause for item in hidden if item.cause.startswith("sensor_")}
    wanders = rng.uniform(0.005, 0.02) * (rng.random() < 0.3) if drift is None else drift
    both = bool(rng.random() < 0.3) or (kind == "motion-only" and bool(faults))
    return Sensors(step=period / rng.uniform(24, 48), jitter=0.3 * (rng.random() < 0.15),
                   noise=rng.uniform(0.004, 0.015), missing=0.02 * (rng.random() < 0.15),
                   acceleration=both and not any(item.cause in ("clock_drift", "cross_axis") for item in hidden),
                   drift=wanders, lasting=period * rng.uniform(0.1, 1.0))


def make(seed: np.random.SeedSequence, group: str, body_kind: str, kind: str, drift: float | None = None,
         sizes: Sequence[float] = (0.05, 0.1, 0.2)) -> Case:
    """Return one case, its gap one of `sizes`; the same seed (and drift, if given) gives the same case."""
    rng = np.random.default_rng(seed)
    pool = candidates(group, kind, body_kind) if group != "none" else []
    while True:
        nominal = bodies.BODIES[body_kind](rng)
        body, off = bodies.truth(nominal, TOLERANCE, rng)
        tests, last = plans(kind, body, rng)
        target = float(rng.choice(sizes))
        count = {"none": 0, "pair": 2, "triple": 3}.get(group, 1)
        names = [str(name) for name in rng.choice(pool, count, replace=False)] if count else []
        try:
            hidden, gaps = (of_size(names, body, tests, rng) if len(body.dofs) > 2 else
                            hide(names, body, tests, target, rng))
        except SolverError:
            continue
        runs = [happen(body, test, hidden) for test in (*tests, last)]
        if all(np.isfinite(run.x).all() for run in runs):
            break
    calm = [happen(body, test) for test in tests]
    kit = sensors(nominal, kind, hidden, rng, drift)
    *records, unseen = (write_down(run, test, nominal, kit, rng) for run, test in zip(runs, (*tests, last)))
    causes = [{"cause": item.cause, "names": list(CAUSES[item.cause].names), "group": CAUSES[item.cause].group,
               "linear": CAUSES[item.cause].linear, "dof": nominal.dofs[item.dof], "gap": gap,
               "law": item.law() or [item.cause, item.strength * item.parameters[0]]}
              for item, gap in zip(hidden, gaps)]
    label = {"group": group, "body": body_kind, "kind": kind, "causes": causes, "tolerance": TOLERANCE,
             "gap": min(gaps, default=0.0), "opened": distance(runs[:-1], calm, tests), "noise": kit.noise,
             "drift": kit.drift, "acceleration": kit.acceleration, "errors": off}
    return Case(nominal.data(), tuple(records), unseen, label)


def mix_of(text: str) -> dict[str, float]:
    """Return the shares of the classes: of a mix by its name, or of 'none=.5,single=.5'.

    InputError if a class or mix is unknown or the shares do not add up to 1.
    """
    if text in MIXES:
        return dict(MIXES[text])
    known = f"use {', '.join(MIXES)}, or shares of {', '.join(MIX)} that add up to 1 (none=.5,single=.5)"
    try:
        shares = {name.strip(): float(value) for name, _, value in (part.partition("=") for part in text.split(","))}
    except ValueError:
        raise InputError(f"mix {text!r}: not understood; {known}") from None
    if not set(shares) <= set(MIX) or min(shares.values()) < 0.0 or abs(sum(shares.values()) - 1.0) > 1e-6:
        raise InputError(f"mix {text!r}: {known}")
    return shares


def schedule(count: int, rng: np.random.Generator, kinds: Sequence[str] = ALL,
             groups: Sequence[str] | None = None, some: Sequence[str] | None = None,
             mix: str = "standard") -> list[tuple[str, str, str]]:
    """Return (class, body, kind of records) of each case, shuffled; kinds in turn, the rest by share or in turn.

    Where nothing is hidden in any case, the bodies come in turn too, so that every kind of records meets each body
    equally often.
    """
    if groups is None:
        shares = mix_of(mix)
        classes = [group for group, share in shares.items() for _ in range(round(share * count))]
        classes = (classes + [next(iter(shares))] * count)[:count]
        some = list(SHARES) if some is None and set(classes) == {"none"} else some
    else:
        classes = [groups[i % len(groups)] for i in range(count)]
    plan = []
    for i, group in enumerate(classes):
        allowed = [kind for kind in kinds if kind != "motion-only" or group in ("none", "single")] or ["decays+waves"]
        body = some[i % len(some)] if some else str(rng.choice(list(SHARES), p=list(SHARES.values())))
        plan.append((group, body, allowed[i % len(allowed)]))
    return [plan[i] for i in rng.permutation(count)]
