"""Generate sealed cases, have them diagnosed in processes of their own, keep the answers.

A case is a random body, a set of records, a hidden cause of stated strength, or none.
"""

import json
import secrets
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import folder_written_whole, made_folder, write_first, write_whole
from radiation_ss.blind.bodies import BODIES, Body, truth
from radiation_ss.blind.causes import ALL, CAUSES, Hidden, candidates
from radiation_ss.blind.experiments import Sensors, happen, plans, write_down
from radiation_ss.blind.seal import MANIFEST, Sealed, seal_of, sealed_folder, write_seal
from radiation_ss.blind.strength import TOLERANCE, distance, hide, of_size
from radiation_ss.blind.worker import carry_out, unfinished
from radiation_ss.errors import InputError, SolverError
from radiation_ss.hydro.data import HydroData
from radiation_ss.hydro.files import write_hydro
from radiation_ss.reading import read_json, whole_number
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import write_record

BEGUN, LABEL = "begun.json", "label.json"
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
        nominal = BODIES[body_kind](rng)
        body, off = truth(nominal, TOLERANCE, rng)
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
    """Return the shares of the classes: of a mix by its name, or of 'none=.5,single=.5'."""
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


def generate(folder: str | Path, cases: int = 200, seed: int | None = None, *, kinds: Sequence[str] = ALL,
             groups: Sequence[str] | None = None, bodies: Sequence[str] | None = None, mix: str = "standard",
             drift: float | None = None) -> Sealed:
    """Write sealed cases; the labels in another folder, their SHA-256 beside the cases.

    Parameters
    ----------
    folder : path
        Gets cases/000/MODEL.nc, records and the unseen test's input; `<folder>-sealed` gets the labels and the unseen
        test's motion.
    seed : int, optional
        Fresh from the operating system if not given; kept under the seal.
    kinds : sequence of str
        Sets of records: decays, decays+waves, waves, elevation, motion-only.
    groups : sequence of str, optional
        Classes of cases, in turn; by default by the shares of `mix`.
    bodies : sequence of str, optional
        heave, sway-roll, roll, six-free, six-moored in turn; by default drawn by `SHARES`.
    mix : str
        "standard", "nulls" (nothing is hidden in any case) or shares of the classes, as in "none=.5,single=.5".
    drift : float, optional
        By which share of the motion the zero of every displacement sensor wanders; in three of ten cases, by up to 2 %,
        if not given.

    Raises
    ------
    InputError
        If the folder holds a whole run already, or one was begun there with other settings.
    """
    folder = Path(folder)
    if (folder / MANIFEST).exists():
        raise InputError(f"{folder}: holds a blind run already; opened cases are no blind check any more")
    if unknown := sorted(set(kinds) - set(ALL)):
        raise InputError(f"kinds: {unknown[0]!r} is unknown; use {', '.join(ALL)}")
    schedule(cases, np.random.default_rng(0), kinds, groups, bodies, mix)       # refused before anything is written
    sealed = sealed_folder(folder)
    seed = _seed_of(sealed / BEGUN, seed, {
        "cases": cases, "kinds": list(kinds), "groups": groups and list(groups), "bodies": bodies and list(bodies),
        "mix": mix, "drift": drift})
    plan = schedule(cases, np.random.default_rng([seed, 1]), kinds, groups, bodies, mix)
    labels = []
    for i, (group, body, kind) in enumerate(plan):
        place, hidden = folder / "cases" / f"{i:03d}", sealed / f"{i:03d}"
        if not place.is_dir():
            case = make(np.random.SeedSequence([seed, 2, i]), group, body, kind, drift)
            _write_case(case, place, hidden, {"case": f"{i:03d}", "seed": seed, **case.label})
        labels.append(read_json(hidden / LABEL, "label of a case", dict))
    digest = write_seal(sealed, labels)
    manifest = {"cases": cases, "sha256": digest, "tolerance": TOLERANCE, "kinds": list(kinds),
                "sealed": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())}
    write_whole(folder / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    return seal_of(folder)


def _seed_of(path: Path, seed: int | None, asked: dict[str, Any]) -> int:
    """Return the seed of a run, kept under the seal with its settings: of one that was stopped, its own."""
    if not path.exists():
        made_folder(path.parent)
        write_first(path, json.dumps({**asked, "seed": secrets.randbits(64) if seed is None else seed}))
    begun = read_json(path, "description of a blind run", dict)
    other = [name for name in asked if begun.get(name) != asked[name]]
    if seed is not None and begun["seed"] != seed:
        other.append("seed")
    if other:
        raise InputError(f"{path.parent}: a run with other settings was begun here ({', '.join(other)}); use another "
                         "folder")
    return whole_number(begun["seed"], "seed")


def _write_case(case: Case, place: Path, hidden: Path, label: dict[str, Any]) -> None:
    """Write one case, each of its folders whole: first what is sealed, then what is given away."""
    with folder_written_whole(hidden) as beside:
        write_record(case.unseen, beside / "unseen.csv")
        write_whole(beside / LABEL, json.dumps(label))
    with folder_written_whole(place, place.parents[1]) as beside:
        write_hydro(case.data, beside / "MODEL.nc")
        for record in case.records:
            write_record(record, beside / f"{record.name}.csv")
        write_record(start_only(case), beside / "unseen.csv")


def start_only(case: Case, start: float = 1.6, edge: float = 3.0) -> Record:
    """Return the unseen test, its motion missing but for the start that a simulation needs.

    That is `start` slowest natural periods and, where the force has to be made of the elevation before and after,
    `edge` fastest ones.
    """
    data, record = case.data, case.unseen
    assert data.M is not None and data.C is not None and data.A_inf is not None
    omega = np.sqrt(np.diag(data.C) / np.diag(data.M + data.A_inf))
    omega = omega[omega > 0.0]
    shown = start * 2 * np.pi / omega.min()
    if "wave_elevation" in record.channels:
        shown += edge * 2 * np.pi / omega.max()
    late = record.time > record.time[0] + shown
    hide = {name: np.where(late, np.nan, values) for name, values in record.channels.items()
            if not name.endswith("_force") and name != "wave_elevation"}
    return replace(record, channels={**record.channels, **hide})


def run(folder: str | Path, cases: int | None = None, seed: int | None = None, *, executor: Executor | None = None,
        **drawn: Any) -> Sealed:
    """Generate sealed cases unless they are there, and diagnose those without an answer in separate processes.

    The hash of the labels is printed before the diagnosis begins. A run that was stopped goes on when called again,
    with the cases it was sealed with; how many are left is printed.
    `folder`, `cases`, `seed`, and what cases to draw (kinds, groups, bodies, mix, drift): as `generate` takes them. The
    folder has to be one that the workers of the executor see. `executor`: as for `repeat`; one case after the other if
    absent. Each job starts a process of its own that is locked out of the labels, so threads are enough on one machine.
    Answers are the same for any number of workers. RadiationError if a case has no answer in the end because its
    process was ended twice.
    """
    folder = Path(folder)
    if not (folder / MANIFEST).exists():
        generate(folder, seed=seed, **(drawn if cases is None else {**drawn, "cases": cases}))
    sealed = seal_of(folder)
    tasks = [f"{i:03d}" for i in range(sealed.cases)]
    asked = "" if cases in (None, sealed.cases) else (f", not the {cases} asked for: its cases are sealed, and another "
                                                      "number needs another folder")
    print(f"{sealed}\n{folder}: {sealed.cases} cases, {len(unfinished(folder.resolve(), tasks))} of them to be "
          f"diagnosed{asked}", flush=True)
    carry_out(folder, tasks, executor)
    return sealed
