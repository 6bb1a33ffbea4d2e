"""Generate sealed cases, diagnose them in a process of its own, keep the answers."""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.errors import InputError, RadiationError
from radiation_ss.gap.blind.causes import ALL
from radiation_ss.gap.blind.seal import lock_out, write_seal
from radiation_ss.hydro.files import write_hydro
from radiation_ss.plant.model import Model
from radiation_ss.simulation.record import Record, read_record, write_record

MANIFEST = "blind.json"
START_PERIODS = 1.6  # of the slowest natural period: what the unseen test shows of its motion
EDGE_PERIODS = 3.0  # of the fastest one, where the force has to be made of the elevation before and after
# A case that a diagnosis breaks on is an error in the table; it must not lose the other cases.
FAILURES = (RadiationError, ArithmeticError, LookupError, ValueError, TypeError, RuntimeError)


def sealed_folder(folder: Path) -> Path:
    """Return where the labels of a folder of cases lie."""
    return folder.with_name(folder.name + "-sealed")


@dataclass(frozen=True)
class Sealed:
    """A folder of sealed cases: how many, when, and the SHA-256 of their labels."""

    folder: str
    cases: int
    sealed: str
    sha256: str

    def __str__(self) -> str:
        return f"{self.cases} cases sealed {self.sealed}, SHA-256 of the labels {self.sha256}"

    def to_dict(self) -> dict[str, Any]:
        """Return the fields."""
        return asdict(self)


def generate(folder: str | Path, cases: int = 200, seed: int | None = None, *, kinds: Sequence[str] = ALL,
             groups: Sequence[str] | None = None, bodies: Sequence[str] | None = None,
             mix: str = "standard") -> Sealed:
    """Write sealed cases; the labels in another folder, their SHA-256 beside the cases.

    Parameters
    ----------
    folder : path
        Gets cases/000/MODEL.nc, records and the unseen test's input; `<folder>-sealed` gets the labels and the unseen
        test's motion.
    cases : int
    seed : int, optional
        Fresh from the operating system if not given; kept under the seal.
    kinds : sequence of str
        Sets of records: decays, decays+waves, waves, elevation, motion-only.
    groups : sequence of str, optional
        Classes of cases, in turn; by default by the shares of `mix`.
    bodies : sequence of str, optional
        heave, sway-roll, roll in turn; by default drawn by `cases.SHARES`.
    mix : str
        "standard", "nulls" (nothing is hidden in any case) or shares of the classes, as in "none=.5,single=.5".

    Raises
    ------
    InputError
        If the folder holds cases already.
    """
    from radiation_ss.gap.blind.cases import make, schedule
    from radiation_ss.gap.blind.strength import TOLERANCE

    folder = Path(folder)
    if (folder / MANIFEST).exists():
        raise InputError(f"{folder}: holds a blind run already; opened cases are no blind check any more")
    unknown = sorted(set(kinds) - set(ALL))
    if unknown:
        raise InputError(f"kinds: {unknown[0]!r} is unknown; use {', '.join(ALL)}")
    seed = secrets.randbits(64) if seed is None else seed
    plan = schedule(cases, np.random.default_rng([seed, 1]), kinds, groups, bodies, mix)
    sealed = sealed_folder(folder)
    labels = []
    for i, (group, body, kind) in enumerate(plan):
        case = make(np.random.SeedSequence([seed, 2, i]), group, body, kind)
        place, hidden = folder / "cases" / f"{i:03d}", sealed / f"{i:03d}"
        place.mkdir(parents=True)
        hidden.mkdir(parents=True)
        write_hydro(case.data, place / "MODEL.nc")
        for record in case.records:
            write_record(record, place / f"{record.name}.csv")
        write_record(case.unseen, hidden / "unseen.csv")
        write_record(start_only(case.unseen, case.data.C, case.data.M, case.data.A_inf), place / "unseen.csv")
        labels.append({"case": f"{i:03d}", "seed": seed, **case.label})
    digest = write_seal(sealed, labels)
    manifest = {"cases": cases, "sha256": digest, "tolerance": TOLERANCE, "kinds": list(kinds),
                "sealed": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())}
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    return seal_of(folder)


def frozen_rule() -> dict[str, float]:
    """Return the thresholds of the search and the verdict as they stand."""
    from radiation_ss.gap import search, verdict

    return {f"{module.__name__.rsplit('.', 1)[-1]}.{name}": value for module in (search, verdict)
            for name, value in vars(module).items() if name.isupper() and isinstance(value, (int, float))}


def seal_of(folder: Path) -> Sealed:
    """Return what a folder of cases says of its seal."""
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return Sealed(str(folder), manifest["cases"], manifest["sealed"], manifest["sha256"])


def start_only(record: Record, C: Any, M: Any, A_inf: Any) -> Record:
    """Return a record whose motion is missing but for the start that a simulation needs."""
    omega = np.sqrt(np.diag(C) / np.diag(M + A_inf))
    shown = START_PERIODS * 2 * np.pi / omega.min()
    if "wave_elevation" in record.channels:
        shown += EDGE_PERIODS * 2 * np.pi / omega.max()
    late = record.time > record.time[0] + shown
    hide = {name: np.where(late, np.nan, values) for name, values in record.channels.items()
            if not name.endswith("_force") and name != "wave_elevation"}
    return replace(record, channels={**record.channels, **hide})


def run(folder: str | Path, cases: int = 200, seed: int | None = None, *, kinds: Sequence[str] = ALL,
        groups: Sequence[str] | None = None, bodies: Sequence[str] | None = None, mix: str = "standard") -> Sealed:
    """Generate sealed cases unless they are there, and diagnose those without an answer in a separate process.

    The hash of the labels is printed before the diagnosis begins.

    Raises
    ------
    RadiationError
        If the diagnosing process ends before its work is done.
    """
    folder = Path(folder)
    if not (folder / MANIFEST).exists():
        generate(folder, cases, seed, kinds=kinds, groups=groups, bodies=bodies, mix=mix)
    print(seal_of(folder), flush=True)
    if not (folder / "answers").exists():
        manifest = {**json.loads((folder / MANIFEST).read_text(encoding="utf-8")), "rule": frozen_rule()}
        (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    print(f"Rule: {json.loads((folder / MANIFEST).read_text(encoding='utf-8'))['rule']}", flush=True)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run([sys.executable, "-m", "radiation_ss.gap.blind.worker", str(folder)], env=environment)
    if done.returncode != 0:
        raise RadiationError(f"{folder}: the diagnosing process ended with status {done.returncode}")
    return seal_of(folder)


def answer_all(folder: Path) -> None:
    """Diagnose every case that has no answer yet, locked out of the sealed labels; the worker's main function."""
    lock_out(sealed_folder(folder))
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    cases = sorted((folder / "cases").iterdir())
    for case in cases:
        out = folder / "answers" / case.name
        if not (out / "answer.json").exists():
            status = answer(case, out, manifest["tolerance"])
            print(f"{case.name} of {len(cases)}: {status}", flush=True)


def answer(case: Path, out: Path, tolerance: float) -> str:
    """Diagnose one case with the public functions, predict the unseen test; return the verdict's status."""
    import radiation_ss as rss

    out.mkdir(parents=True, exist_ok=True)
    records = [read_record(path) for path in sorted(case.glob("*.csv")) if path.name != "unseen.csv"]
    result: dict[str, Any] = {}
    try:
        model = rss.read_model(case / "MODEL.nc")
        began = time.process_time()
        diagnosis = rss.diagnose(model, records, tolerance=tolerance, seed=0)
        result["seconds"] = time.process_time() - began
        report = diagnosis.to_dict()
        (out / "report.json").write_text(json.dumps(report), encoding="utf-8")
        diagnosis.corrected.write(out / "corrected.json")
        status = str(report["verdict"]["status"])
        result["predictions"] = predictions(model, out / "corrected.json", read_record(case / "unseen.csv"))
    except FAILURES as error:
        status = result["error"] = f"{type(error).__name__}: {error}"
    (out / "answer.json").write_text(json.dumps(result), encoding="utf-8")
    return status


def predictions(model: Model, corrected: Path, unseen: Record) -> dict[str, list[list[float]]]:
    """Return the displacements of the unseen test, nominal and corrected; nothing where its force is unknown."""
    import radiation_ss as rss
    from radiation_ss.simulation.corrected import read_corrected

    if unseen.kind == "motion-only":
        return {}
    effects = read_corrected(corrected, model).actives(model)
    return {name: np.asarray(rss.simulate(model, unseen, items).outputs)[: model.n].tolist()
            for name, items in (("nominal", ()), ("corrected", effects))}
