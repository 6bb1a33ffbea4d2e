"""Generate sealed cases, have them diagnosed in processes of their own, keep the answers."""

import json
import secrets
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import folder_written_whole, made_folder, write_first, write_whole
from radiation_ss.blind.cases import Case, make, schedule
from radiation_ss.blind.causes import ALL
from radiation_ss.blind.seal import MANIFEST, Sealed, seal_of, sealed_folder, write_seal
from radiation_ss.blind.strength import TOLERANCE
from radiation_ss.blind.worker import carry_out
from radiation_ss.errors import InputError
from radiation_ss.hydro.files import write_hydro
from radiation_ss.reading import read_json, whole_number
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import write_record

BEGUN, LABEL = "begun.json", "label.json"


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
        heave, sway-roll, roll, six-free, six-moored in turn; by default drawn by `cases.SHARES`.
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
    unknown = sorted(set(kinds) - set(ALL))
    if unknown:
        raise InputError(f"kinds: {unknown[0]!r} is unknown; use {', '.join(ALL)}")
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


def run(folder: str | Path, cases: int = 200, seed: int | None = None, *, executor: Executor | None = None,
        **drawn: Any) -> Sealed:
    """Generate sealed cases unless they are there, and diagnose those without an answer in separate processes.

    The hash of the labels is printed before the diagnosis begins. A run that was stopped goes on when called again.
    `folder`, `cases`, `seed`, and what cases to draw (kinds, groups, bodies, mix, drift): as `generate` takes them. The
    folder has to be one that the workers of the executor see. `executor`: as for `repeat`; one case after the other if
    absent. Each job starts a process of its own that is locked out of the labels, so threads are enough on one machine.
    Answers are the same for any number of workers. RadiationError if a case has no answer in the end because its
    process was ended twice.
    """
    folder = Path(folder)
    if not (folder / MANIFEST).exists():
        generate(folder, cases, seed, **drawn)
    sealed = seal_of(folder)
    print(sealed, flush=True)
    carry_out(folder, [f"{i:03d}" for i in range(sealed.cases)], executor)
    return sealed
