"""What a diagnosing process does with a case: diagnose it with the public functions and predict the unseen test."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import made_folder, write_whole
from radiation_ss.body.model import Model
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import read_record


def carry_out_one(folder: Path, task: str, tolerance: float) -> str:
    """Do one task, "003" or, told the effect's name, "003:quadratic_drag"; return its status in one line.

    Whatever goes wrong is this case's error, for it must not lose the others.
    """
    name, _, told = task.partition(":")
    case, out = folder / "cases" / name, result_file(folder, task)
    made_folder(out.parent)
    result: dict[str, Any] = {}
    try:
        if told:
            status = tell(case, out, told, tolerance, result)
        else:
            status = answer(case, out.parent, tolerance, result)
    except Exception as error:
        status = result["error"] = f"{type(error).__name__}: {error}"
    write_whole(out, json.dumps(result))
    return status.splitlines()[0]


def result_file(folder: Path, task: str) -> Path:
    """Return the file that is there when a task is done."""
    name, _, told = task.partition(":")
    return folder / "oracle" / f"{name}.json" if told else folder / "answers" / name / "answer.json"


def answer(case: Path, out: Path, tolerance: float, result: dict[str, Any]) -> str:
    """Diagnose a case; put predictions and processor seconds into the result; return the verdict's status."""
    import radiation_ss as rss

    model = rss.read_model(case / "MODEL.nc")
    began = time.process_time()
    diagnosis = rss.diagnose(model, records_of(case), tolerance=tolerance, seed=0)
    result["seconds"] = time.process_time() - began
    report = diagnosis.to_dict()
    write_whole(out / "report.json", json.dumps(report))
    diagnosis.corrected.write(out / "corrected.json")
    result["predictions"] = predictions(model, out / "corrected.json", read_record(case / "unseen.csv"))
    return str(report["verdict"]["status"])


def tell(case: Path, out: Path, name: str, tolerance: float, result: dict[str, Any]) -> str:
    """Diagnose a case told the name of its effect; put the prediction of the unseen test into the result."""
    import radiation_ss as rss

    model, corrected = rss.read_model(case / "MODEL.nc"), out.with_name(f"{case.name}-corrected.json")
    told = rss.diagnose(model, records_of(case), [name], present=[name], tolerance=tolerance)
    told.corrected.write(corrected)
    result["oracle"] = predictions(model, corrected, read_record(case / "unseen.csv"))["corrected"]
    return f"told {name}"


def records_of(case: Path) -> list[Record]:
    """Return the records of a case, without the unseen test."""
    return [read_record(path) for path in sorted(case.glob("*.csv")) if path.name != "unseen.csv"]


def predictions(model: Model, corrected: Path, unseen: Record) -> dict[str, list[list[float]]]:
    """Return the displacements of the unseen test, nominal and corrected; nothing where its force is unknown."""
    import radiation_ss as rss
    from radiation_ss.simulation.corrected import read_corrected

    if unseen.kind == "motion-only":
        return {}
    effects = read_corrected(corrected, model).actives(model)
    return {name: np.asarray(rss.simulate(model, unseen, items).outputs)[: model.n].tolist()
            for name, items in (("nominal", ()), ("corrected", effects))}
