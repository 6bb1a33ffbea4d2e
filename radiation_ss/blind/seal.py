"""The folder of a blind run: its seal, the lock that the diagnosis cannot open, its answers beside opened labels."""

import hashlib
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from radiation_ss.atomic import made_folder, write_whole
from radiation_ss.errors import InputError
from radiation_ss.reading import decoded, number, read_json, texts, whole_number
from radiation_ss.records.record import Record
from radiation_ss.records.record_files import read_record


@dataclass(frozen=True)
class Scored:
    """One case, its label opened, beside the verdict on it."""

    label: dict[str, Any]
    verdict: dict[str, Any]
    status: str  # Status of the verdict, or "error"
    alone: tuple[str, ...]  # The names of a verdict "effect"
    within: tuple[str, ...]  # Every name that the verdict holds possible: alone, or the indistinguishable sets
    gaps: dict[str, float]  # Gap on the unseen test: nominal, corrected, noise
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
    names, status = tuple(effect["name"] for effect in verdict["effects"]), verdict["status"]
    held = () if status in ("no_gap", "unknown_effect") else (*names, *flat(verdict["indistinguishable"]))
    measured = read_record(sealed_folder(folder) / label["case"] / "unseen.csv")
    shown = read_record(folder / "cases" / label["case"] / "unseen.csv")
    found, told = dict(answer.get("predictions", {})), folder / "oracle" / f"{label['case']}.json"
    if told.is_file() and "oracle" in (content := read_json(told, "answer of a blind run", dict)):
        found["oracle"] = content["oracle"]
    gaps = {name: unseen_gap(measured, shown, np.array(rows)) for name, rows in found.items()}
    return Scored(label, verdict, status, names if status == "effect" else (), tuple(dict.fromkeys(held)), gaps,
                  float(answer["seconds"]))


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

    `so_far`: take a run that was stopped: the cases answered. Their order is random, so they are a fair sample.
    """
    folder = Path(folder)
    if not (folder / MANIFEST).is_file():
        raise InputError(f"{folder}: no blind run here; {MANIFEST} is missing")
    labels = open_seal(sealed_folder(folder), seal_of(folder).sha256)
    answers = folder / "answers"
    missing = [label["case"] for label in labels if not (answers / label["case"] / "answer.json").is_file()]
    if missing and not so_far:
        raise InputError(f"{folder}: case {missing[0]} and {len(missing) - 1} more have no answer; finish the run")
    return [read_case(folder, label) for label in labels if label["case"] not in missing]


LABELS, MANIFEST = "labels.json", "blind.json"
READS = ("open", "os.listdir", "os.scandir", "os.rename", "os.link", "os.symlink", "shutil.copyfile",
         "subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "ctypes.dlopen")


@dataclass(frozen=True)
class Sealed:
    """A folder of sealed cases: how many, when, the SHA-256 of their labels, the tolerance of the models' numbers."""

    folder: str
    cases: int
    sealed: str
    sha256: str
    tolerance: float

    def __str__(self) -> str:
        return f"{self.cases} cases sealed {self.sealed}, SHA-256 of the labels {self.sha256}"

    def to_dict(self) -> dict[str, Any]:
        """Return the fields."""
        return asdict(self)


def sealed_folder(folder: Path) -> Path:
    """Return where the labels of a folder of cases lie."""
    return folder.with_name(folder.name + "-sealed")


def write_seal(folder: Path, labels: list[dict[str, Any]]) -> str:
    """Write the labels and return their SHA-256."""
    made_folder(folder)
    raw = (json.dumps(labels, indent=1) + "\n").encode()
    write_whole(folder / LABELS, raw)
    return hashlib.sha256(raw).hexdigest()


def open_seal(folder: Path, digest: str) -> list[dict[str, Any]]:
    """Return the labels, which must be those that were sealed."""
    path = folder / LABELS
    if not path.is_file():
        raise InputError(f"{path}: no such file; the labels of a blind run lie there")
    raw = path.read_bytes()
    if hashlib.sha256(raw).hexdigest() != digest:
        raise InputError(f"{path}: its SHA-256 is not the one printed when it was sealed ({digest}); labels changed")
    return json.loads(raw)


def lock_out(folder: Path) -> None:
    """Make this process unable, for good, to read below a folder, or to start another process that could."""
    sealed = str(folder.resolve())

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in READS:
            return
        if event.startswith(("subprocess", "os.system", "os.exec", "os.posix_spawn")):
            raise PermissionError(f"the diagnosing process starts no other process ({event})")
        for item in arguments[:2]:
            if isinstance(item, (str, bytes, Path)):
                name = item.decode(errors="replace") if isinstance(item, bytes) else str(item)
                if name and str(Path(name).resolve()).startswith(sealed):
                    raise PermissionError(f"{name}: sealed")

    sys.addaudithook(hook)


def seal_of(folder: Path) -> Sealed:
    """Return what a folder of cases says of its seal."""
    def stated(content: dict[str, Any]) -> Sealed:
        sealed, digest = texts([content["sealed"], content["sha256"]], "sealed, sha256")
        return Sealed(str(folder), whole_number(content["cases"], "cases"), sealed, digest,
                      number(content["tolerance"], "tolerance"))

    return read_json(folder / MANIFEST, "description of a blind run", stated)
