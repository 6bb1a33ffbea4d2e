"""The result of a diagnosis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from radiation_ss.diagnosis.prediction import Error
from radiation_ss.diagnosis.rules import Rules
from radiation_ss.diagnosis.shares import Budget
from radiation_ss.diagnosis.where import Where
from radiation_ss.methods import Shown, later
from radiation_ss.simulation.corrected import Corrected

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

SCHEMA = "radiation_ss.diagnosis/1"


@dataclass(frozen=True)
class Named:
    """An effect with its numbers.

    Parameters
    ----------
    name, dof : str
        Of a pair of degrees of freedom "Sway,Roll".
    parameters : mapping of str to (value, standard deviation)
    units : mapping of str to str
    inclusion : float
        Probability that it is there.
    channels : tuple of str
        Of a fault of second sensors alone: their channels in the records.
    """

    name: str
    dof: str
    parameters: Mapping[str, tuple[float, float]]
    units: Mapping[str, str] = field(default_factory=dict)
    inclusion: float = 1.0
    channels: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"name": self.name, "dof": self.dof,
                "parameters": {key: list(value) for key, value in self.parameters.items()},
                **({"channels": list(self.channels)} if self.channels else {})}


@dataclass(frozen=True)
class Answer:
    """The verdict.

    Parameters
    ----------
    status : str
        no_gap, effect, ambiguous or unknown_effect.
    effects : tuple of Named
    probability : float
        That all of `effects` are there; of no_gap that none is.
    indistinguishable : tuple of tuple of str
        Sets of names that the records cannot tell apart. Beside `effects`: what else is not improbable, the named set
        among it; or the named set with each of the zeros, of force or of sensor, that may be off.
    not_testable : tuple of str
        Effects that these records cannot show, whether they are there or not.
    next_record : str
        What to measure to tell them apart.
    """

    status: str
    effects: tuple[Named, ...]
    probability: float
    indistinguishable: tuple[tuple[str, ...], ...]
    not_testable: tuple[str, ...]
    next_record: str

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"status": self.status, "effects": [e.to_dict() for e in self.effects], "probability": self.probability,
                "indistinguishable": [list(s) for s in self.indistinguishable],
                "not_testable": list(self.not_testable), "next_record": self.next_record}


@dataclass(frozen=True)
class Choice:
    """One row of the list of candidates; gaps are relative errors of the equation of motion, in the fit."""

    effects: tuple[Named, ...]
    probability: float
    log_evidence: float
    gap_before: float
    gap_after: float

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"effects": [e.to_dict() for e in self.effects], "probability": self.probability,
                "log_evidence": self.log_evidence, "gap_before": self.gap_before, "gap_after": self.gap_after}


@dataclass(frozen=True)
class HowFar:
    """Gaps on records that no fit has seen: nominal, recalibrated, with the effects, and the noise."""

    gap_before: float
    gap_retuned: float
    gap_after: float
    noise_floor: float
    shrinkage: float
    interval: tuple[float, float]
    on: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"gap_before": self.gap_before, "gap_retuned": self.gap_retuned, "gap_after": self.gap_after,
                "noise_floor": self.noise_floor, "shrinkage": self.shrinkage, "interval": list(self.interval),
                "on": list(self.on)}


@dataclass(frozen=True)
class Recalibrated:
    """A nominal number that was moved: relative change, its standard deviation and the stated tolerance."""

    name: str
    dof: str
    value: float
    std: float
    tolerance: float

    @property
    def beyond(self) -> float:
        """The change in stated tolerances."""
        return abs(self.value) / self.tolerance


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """Why model and measurement differ.

    Attributes
    ----------
    verdict : Answer
    budget : Budget
    which : tuple of Choice
        Candidates, best first.
    where : Where
    how_far : HowFar
    corrected : Corrected
    recalibrated : tuple of Recalibrated
    predictions : mapping of str to sequence of Error
        "given", "recalibrated" and "corrected" on the unseen records.
    rules : Rules
    notes : tuple of str
    misreadings : tuple of str
        What columns may be instead, of the notes, where a gap matters and no name is sure: the sentence begins with the
        first. None is sure where a known unit of a force or a motion explains the gap as well.

    Examples
    --------
    A record of the model itself: no gap is left to explain.

    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0, damping_ratio=0.02)
    >>> time, rng = np.arange(0.0, 40.0, 0.05), np.random.default_rng(0)
    >>> force = np.convolve(rng.normal(size=800), np.hanning(20), "same")
    >>> heave = rss.simulate(model, (time, force[None])).outputs[0] + 0.002 * rng.normal(size=800)
    >>> record = rss.Record(time, {"Heave": heave, "Heave_force": force}, kind="forced")
    >>> result = rss.diagnose(model, record, effects=["quadratic_drag"])
    >>> result.verdict.status, result.verdict.effects, result.dofs
    ('no_gap', (), ('Heave',))
    """

    model_name: str
    verdict: Answer
    budget: Budget
    which: tuple[Choice, ...]
    where: Where
    how_far: HowFar
    corrected: Corrected
    recalibrated: tuple[Recalibrated, ...] = ()
    predictions: Mapping[str, Sequence[Error]] = field(default_factory=dict)
    dofs: tuple[str, ...] = ()
    rules: Rules = field(default_factory=Rules)
    notes: tuple[str, ...] = ()
    misreadings: tuple[str, ...] = ()

    @property
    def not_testable(self) -> tuple[str, ...]:
        """Effects that the records cannot show."""
        return self.verdict.not_testable

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        return str(later("report.diagnosis_page:sentence", self))

    def __str__(self) -> str:
        return self.sentence

    def with_notes(self, notes: Sequence[str]) -> "Diagnosis":
        """Return a copy with more notes.

        Examples
        --------
        >>> result.with_notes(["sensor changed"]).notes[-1]
        'sensor changed'
        """
        return replace(self, notes=(*self.notes, *notes))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of report.json.

        Examples
        --------
        >>> result.to_dict()["verdict"]["status"]
        'no_gap'
        """
        return {"schema": SCHEMA, "model": self.model_name, "verdict": self.verdict.to_dict(),
                "sentence": self.sentence, "candidates": [c.to_dict() for c in self.which],
                "where": self.where.to_dict(), "budget": self.budget.to_dict(), "how_far": self.how_far.to_dict(),
                "recalibrated": [{"name": r.name, "dof": r.dof, "value": r.value, "std": r.std,
                                  "tolerance": r.tolerance} for r in self.recalibrated],
                "rules": self.rules.to_dict(), "corrected": self.corrected.to_dict(), "notes": list(self.notes)}

    def plot(self) -> "Figure":
        """Draw the budget, and the prediction before and after on the unseen records.

        Examples
        --------
        >>> result.plot().savefig("budget.svg")
        """
        return later("report.diagnosis_page:overview", self)

    def save(self, folder: "str | Path") -> None:
        """Write report.json, report.html and corrected.json.

        Examples
        --------
        >>> result.save("gap")
        """
        later("report.diagnosis_page:save", self, folder)
