"""The result of a diagnosis: verdict, where, which, how far; report.json, report.html, corrected.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radiation_ss.gap.where.locate import Where
from radiation_ss.methods import Shown, later
from radiation_ss.simulation.corrected import Corrected

if TYPE_CHECKING:
    import control as ct
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from radiation_ss.body.model import Model
    from radiation_ss.gap.how_far.control import ControlGap
    from radiation_ss.gap.how_far.ledger import Error, HowFar
    from radiation_ss.gap.where.residual_force import Missing

SCHEMA = "radiation_ss.diagnosis/1"


@dataclass(frozen=True)
class Named:
    """An effect with its numbers.

    Parameters
    ----------
    name, dof : str
    parameters : mapping of str to (value, standard deviation)
        Of an effect whose numbers are each record's own, those of the first record.
    units : mapping of str to str
    by_record : mapping of str to mapping
        Of such an effect the parameters in each record; of others empty.
    """

    name: str
    dof: str
    parameters: Mapping[str, tuple[float, float]]
    units: Mapping[str, str] = field(default_factory=dict)
    by_record: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        form: dict[str, Any] = {"name": self.name, "dof": self.dof, "parameters": listed(self.parameters)}
        if self.by_record:
            form["by_record"] = {record: listed(values) for record, values in self.by_record.items()}
        return form


def listed(parameters: Mapping[str, tuple[float, float]]) -> dict[str, list[float]]:
    """Return values and standard deviations as lists."""
    return {key: list(value) for key, value in parameters.items()}


@dataclass(frozen=True)
class Answer:
    """The verdict.

    Parameters
    ----------
    status : str
        no_gap, effect, ambiguous or unknown_effect.
    effects : tuple of Named
    probability : float
    indistinguishable : tuple of tuple of str
        Sets of names that the records cannot tell apart; an empty one stands for no effect, but numbers far off within
        their tolerances.
    not_testable : tuple of str
        Effects that these records cannot show, whether they are there or not.
    next_record : str
        What to measure to tell them apart.
    outline : tuple of Named
        Of unknown_effect: how the law changes in time, where that describes it.
    """

    status: str
    effects: tuple[Named, ...]
    probability: float
    indistinguishable: tuple[tuple[str, ...], ...]
    not_testable: tuple[str, ...]
    next_record: str
    outline: tuple[Named, ...] = ()


@dataclass(frozen=True)
class Choice:
    """One row of the list of candidates."""

    effects: tuple[Named, ...]
    probability: float
    log_evidence: float
    gap_before: float
    gap_after: float

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return {"effects": [e.to_dict() for e in self.effects], "probability": self.probability,
                "log_evidence": self.log_evidence, "gap_before": self.gap_before, "gap_after": self.gap_after}


@dataclass(frozen=True, eq=False)
class Diagnosis(Shown):
    """Why model and measurement differ.

    Attributes
    ----------
    verdict : Answer
    which : tuple of Choice
        Candidates, best first.
    where : Where
    how_far : HowFar
    corrected : Corrected
    missing : sequence of Missing
        The missing force along the motion.
    control : ControlGap or None
        What the gap means for a controller; see `with_controller`.
    """

    model_name: str
    verdict: Answer
    which: tuple[Choice, ...]
    where: Where
    how_far: HowFar
    corrected: Corrected
    predictions: Mapping[str, Sequence[Error]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    missing: Sequence[Missing] = ()
    control: ControlGap | None = None

    @property
    def not_testable(self) -> tuple[str, ...]:
        """Effects that the records cannot show."""
        return self.verdict.not_testable

    def with_controller(self, model: Model, controller: ct.StateSpace | ct.TransferFunction | ArrayLike,
                        measured: Sequence[str] | None = None, **options: Any) -> Diagnosis:
        """Return the diagnosis with nu-gap and margins of a negative feedback, in report.json and on the page, too.

        Parameters
        ----------
        model : Model
            The one that was diagnosed.
        controller, measured, **options
            As `radiation_ss.gap.how_far.control.control_gap` takes them.
        """
        from radiation_ss.gap.how_far.control import control_gap

        return replace(self, control=control_gap(model, self.corrected, controller, measured, **options))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of report.json."""
        v, w, h = self.verdict, self.where, self.how_far
        return {
            "schema": SCHEMA,
            "verdict": {"status": v.status, "effects": [e.to_dict() for e in v.effects], "probability": v.probability,
                        "indistinguishable": [list(names) for names in v.indistinguishable],
                        "not_testable": list(v.not_testable), "next_record": v.next_record,
                        **({"outline": [e.to_dict() for e in v.outline]} if v.outline else {})},
            "candidates": [c.to_dict() for c in self.which],
            "where": {"records": {name: {"gap_nominal": a, "gap_retuned": b, "noise": c}
                                  for name, (a, b, c) in w.records.items()},
                      "dofs": w.dofs, "bands": [list(b) for b in w.bands], "phase": w.phase,
                      "amplitude_dependent": w.amplitude_dependent, "pulls": w.pulls},
            "how_far": {"gap_before": h.gap_before, "gap_retuned": h.gap_retuned, "gap_after": h.gap_after,
                        "noise_floor": h.noise_floor, "shrinkage": h.shrinkage, "interval": list(h.interval),
                        "on": list(h.on)},
            "missing_force": [{"record": m.record, "dof": m.dof, "shares": m.shares} for m in self.missing],
            **({} if self.control is None else {"control": self.control.to_dict()}),
            "settings": dict(self.settings), "notes": list(self.notes)}

    def save(self, folder: str | Path) -> None:
        """Write report.json, report.html and corrected.json into a folder."""
        later(self, "save", folder)

    def plot(self) -> Figure:
        """Draw the prediction before and after on an unseen record, and the ledger of gaps."""
        return later(self, "plot")

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        from radiation_ss.gap.answer.words import sentence

        return sentence(self)

    def __str__(self) -> str:
        return self.sentence
