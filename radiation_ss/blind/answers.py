"""Answers of a blind run beside the opened labels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.blind.runner import MANIFEST, read_manifest
from radiation_ss.blind.seal import open_seal, sealed_folder
from radiation_ss.errors import InputError
from radiation_ss.reading import decoded, read_json
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import read_record


@dataclass(frozen=True)
class Scored:
    """One case, its label opened, beside the verdict on it.

    Parameters
    ----------
    label, verdict : dict
    status : str
        Status of the verdict, or "error".
    alone : tuple of str
        The names of a verdict "effect".
    within : tuple of str
        Every name that the verdict holds possible: alone, or the indistinguishable sets.
    gaps : dict of str to float
        Gap on the unseen test: nominal, corrected, noise.
    seconds : float
    """

    label: dict[str, Any]
    verdict: dict[str, Any]
    status: str
    alone: tuple[str, ...]
    within: tuple[str, ...]
    gaps: dict[str, float]
    seconds: float

    @property
    def group(self) -> str:
        """Class of the case; a single one by the class of its cause."""
        group = str(self.label["group"])
        return str(self.label["causes"][0]["group"]) if group == "single" else group

    @property
    def truth(self) -> list[tuple[str, ...]]:
        """For each hidden cause the names that are right."""
        return [tuple(cause["names"]) for cause in self.label["causes"]]

    @property
    def gap(self) -> float:
        """Gap that the hidden causes open."""
        return float(self.label["gap"])


def flat(names: Any) -> list[str]:
    """Return the strings in nested lists, without the degree of freedom that may follow the name."""
    if isinstance(names, str):
        return [names.split(" ")[0]]
    return [name for item in names for name in flat(item)]


def read_case(folder: Path, label: dict[str, Any]) -> Scored:
    """Return one case with its answer."""
    out = folder / "answers" / label["case"]
    answer = read_json(out / "answer.json", "answer of a blind run", dict)
    if "error" in answer:
        return Scored(label, {"error": answer["error"]}, "error", (), (), {}, float(answer.get("seconds", np.nan)))
    verdict = read_json(out / "report.json", "report of a diagnosis", lambda content: content["verdict"])
    return decoded(out, "answer of a blind run", lambda: _scored(folder, label, answer, verdict))


def _scored(folder: Path, label: dict[str, Any], answer: dict[str, Any], verdict: dict[str, Any]) -> Scored:
    names = tuple(effect["name"] for effect in verdict["effects"])
    alone = names if verdict["status"] == "effect" else ()
    within = tuple(dict.fromkeys([*names, *flat(verdict["indistinguishable"])]))
    if verdict["status"] in ("no_gap", "unknown_effect"):
        within = ()
    measured = read_record(sealed_folder(folder) / label["case"] / "unseen.csv")
    shown = read_record(folder / "cases" / label["case"] / "unseen.csv")
    found = dict(answer.get("predictions", {}))
    if (folder / "oracle" / f"{label['case']}.json").is_file():
        told = read_json(folder / "oracle" / f"{label['case']}.json", "answer of a blind run", dict)
        found |= {"oracle": told["oracle"]} if "oracle" in told else {}
    gaps = {name: unseen_gap(measured, shown, np.array(rows)) for name, rows in found.items()}
    return Scored(label, verdict, verdict["status"], alone, within, gaps, float(answer["seconds"]))


def unseen_gap(measured: Record, shown: Record, predicted: np.ndarray) -> float:
    """Return rms of measured - predicted over rms of measured where the motion was not shown, pooled over dofs."""
    terms = []
    for row, dof in zip(predicted, [name for name in measured.channels if name in measured.dofs]):
        values = measured.channels[dof]
        hidden = np.isfinite(values) & (measured.time > measured.time[np.isfinite(shown.channels[dof])].max())
        terms.append(np.mean((values - row)[hidden] ** 2) / np.mean(values[hidden] ** 2))
    return float(np.sqrt(np.mean(terms)))


def read_run(folder: str | Path, *, so_far: bool = False) -> list[Scored]:
    """Open the seal of a run and return its cases with their answers.

    Parameters
    ----------
    folder : path
    so_far : bool
        Take a run that was stopped: the cases answered. Their order is random, so they are a fair sample.

    Raises
    ------
    InputError
        If there is no run, labels are not the sealed ones, or an answer is missing.
    """
    folder = Path(folder)
    if not (folder / MANIFEST).is_file():
        raise InputError(f"{folder}: no blind run here; {MANIFEST} is missing")
    labels = open_seal(sealed_folder(folder), read_manifest(folder)["sha256"])
    answers = folder / "answers"
    missing = [label["case"] for label in labels if not (answers / label["case"] / "answer.json").is_file()]
    if missing and not so_far:
        raise InputError(f"{folder}: case {missing[0]} and {len(missing) - 1} more have no answer; finish the run")
    return [read_case(folder, label) for label in labels if label["case"] not in missing]
