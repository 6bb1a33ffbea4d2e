"""Open the seal and score a blind run: the table of goals, for each kind of record and for each kind of body."""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy.stats import binomtest

from radiation_ss.atomic import write_whole
from radiation_ss.blind.seal import Scored, flat, read_run
from radiation_ss.blind.strength import BEYOND
from radiation_ss.blind.worker import carry_out

# Parameters that the library and the hidden law share: law's name -> (effect, parameter, position in the law).
COEFFICIENTS = {"quadratic_drag": ("coefficient", 0), "linear_damping": ("coefficient", 0),
                "coulomb_friction": ("force", 0), "cubic_stiffness": ("stiffness", 0),
                "quadratic_stiffness": ("stiffness", 0), "linear_stiffness": ("stiffness", 0),
                "constant_force": ("force", 0)}
T = TypeVar("T")
EVERYWHERE = ("clock_drift", "excitation_delay")  # the generator's belong to no single degree of freedom


@dataclass(frozen=True)
class ScoreRow:
    """One line of the table: what is asked, the goal ('>= x', '<= x' or none), what was measured, of how many.

    A share has its 95 % interval (Clopper and Pearson's, exact for the binomial).
    """

    quantity: str
    goal: str
    measured: float
    count: int
    interval: tuple[float, float] | None = None

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached; None without one."""
        if not self.goal:
            return None
        relation, limit = self.goal.split()
        reached = self.measured >= float(limit) if relation == ">=" else self.measured <= float(limit)
        return bool(reached and self.count > 0)

    def __str__(self) -> str:
        value = "-" if self.count == 0 else f"{self.measured:.3g}"
        between = "" if self.interval is None else "{:.3f} to {:.3f}".format(*self.interval)
        met = "" if self.met is None else "yes" if self.met else "no"
        return f"| {self.quantity} | {self.goal} | {value} | {self.count} | {between} | {met} |"


def share(quantity: str, goal: str, cases: Sequence[T], hit: Callable[[T], object]) -> ScoreRow:
    """Return the row of the share of cases that hit, with its interval."""
    hits, count = sum(map(bool, map(hit, cases))), len(cases)
    return ScoreRow(quantity, goal, hits / count if count else np.nan, count,
                    binomial_interval(hits, count) if count else None)


def binomial_interval(hits: int, count: int) -> tuple[float, float]:
    """Return Clopper and Pearson's 95 % interval of a share: the shares that `hits` of `count` do not reject."""
    interval = binomtest(hits, count).proportion_ci(0.95, method="exact")
    return float(interval.low), float(interval.high)


def caught(case: Scored, names: Sequence[str]) -> bool:
    """Whether the verdict holds one of the names possible."""
    return any(name in case.within for name in names)


def alarm(case: Scored) -> bool:
    """Whether a verdict says that there is an effect."""
    return case.status in ("effect", "ambiguous", "unknown_effect")


def table(cases: Sequence[Scored]) -> list[ScoreRow]:
    """Return the rows of the table of goals that these cases can fill; motion-only cases are scored apart."""
    known = [c for c in cases if c.label["kind"] != "motion-only"]
    none = [c for c in known if c.group == "none"]
    structure = [c for c in known if c.group == "structure" and c.gap >= 0.04]
    # Where retuning within two tolerances closes the gap, a cause like a nominal number is not beyond tolerance.
    parameter = [c for c in known if c.group == "parameter" and c.gap >= 0.04]
    closed = [c for c in known if c.group == "parameter" and c.gap < 0.04]
    single = [c for c in known if c.label["group"] == "single" and c.gap >= 0.04]
    outside = [c for c in known if c.group == "outside"]
    inside = [c for c in known if c.group not in ("outside", "formula")]
    formula = [c for c in known if c.group == "formula"]
    pair = [c for c in known if c.group == "pair"]
    sizes = [len(c.within) for c in single if c.gap >= 0.09 and c.within]
    coupled = [c for c in single if c.label["body"] == "sway-roll"]
    found = [c for c in coupled if c.status == "effect" and any(e["dof"] for e in c.verdict["effects"])
             and c.label["causes"][0]["cause"] not in EVERYWHERE]
    rows = [
        share("false alarms, no effect", "<= 0.02", none, alarm),
        share("structure, gap >= .05: named alone", ">= 0.97", structure,
              lambda c: c.alone == c.truth[0][:1] == c.within),
        share("parameter-like, gap >= .05: in the set", ">= 0.97", parameter, lambda c: caught(c, c.truth[0])),
        share("parameter-like: wrong single name", "<= 0.03", parameter + closed,
              lambda c: len(c.within) == 1 and not caught(c, c.truth[0])),
        share(f"parameter-like, {BEYOND:g} to 10 tolerances that retuning closes: in the set", "", closed,
              lambda c: caught(c, c.truth[0])),
        share("the same: no gap, unseen gap as the oracle's", "", closed,
              lambda c: c.status == "no_gap" and c.gaps.get("corrected", np.inf) <= 1.05 * c.gaps.get("oracle", 0.0)),
        share("set holds the truth", ">= 0.98", single, lambda c: caught(c, c.truth[0][:1])),
        ScoreRow("mean size of the set, gap >= .1", "<= 2.0", float(np.mean(sizes)) if sizes else np.nan, len(sizes)),
        share("outside: unknown or right family", ">= 0.90", outside,
              lambda c: c.status == "unknown_effect" or caught(c, c.truth[0])),
        share("unknown where it is not", "<= 0.03", inside, lambda c: c.status == "unknown_effect"),
        share("other formula: right family", ">= 0.90", formula, lambda c: caught(c, c.truth[0])),
        share("pairs: both", ">= 0.80", pair, lambda c: all(caught(c, names) for names in c.truth)),
        share("pairs: at least one", ">= 0.97", pair, lambda c: any(caught(c, names) for names in c.truth)),
        share("sway-roll: an effect", ">= 0.85", coupled, alarm),
        share("sway-roll: right degree of freedom", ">= 0.95", found,
              lambda c: c.label["causes"][0]["dof"] in " ".join(str(e["dof"]) for e in c.verdict["effects"])),
        calibration([c for c in known if c.status == "effect" and c.group != "outside"]),
        coefficients(known),
        share("errors", "<= 0.0", cases, lambda c: c.status == "error"),
    ]
    return rows + shrinkage(known) + motion_only(cases)


def calibration(cases: Sequence[Scored]) -> ScoreRow:
    """Return the mean distance of stated probability and hit rate over bins of probability."""
    pairs = np.array([(float(c.verdict["probability"]),
                       float(c.group != "none" and all(caught(c, names) for names in c.truth))) for c in cases])
    pairs = pairs.reshape(-1, 2)
    which = np.digitize(pairs[:, 0], (0.5, 0.7, 0.9, 0.97))
    bins = [pairs[which == k] for k in np.unique(which)]
    error = sum(len(b) * abs(b[:, 0].mean() - b[:, 1].mean()) for b in bins) / max(len(pairs), 1)
    return ScoreRow("calibration error of the probability", "<= 0.05", float(error), len(pairs))


def coefficients(cases: Sequence[Scored]) -> ScoreRow:
    """Return how often the 2-sd interval of a coefficient holds the hidden law's."""
    held = []
    for case in cases:
        if case.label["group"] != "single" or case.alone != (case.truth[0][0],) or case.alone[0] not in COEFFICIENTS:
            continue
        name, position = COEFFICIENTS[case.alone[0]]
        value, deviation = case.verdict["effects"][0]["parameters"][name]
        held.append(bool(abs(value - case.label["causes"][0]["law"][2][position]) <= 2.0 * deviation))
    return share("2-sd interval holds the coefficient", ">= 0.93", held, bool)


def shrinkage(cases: Sequence[Scored]) -> list[ScoreRow]:
    """Return the unseen gap over the oracle's, where a library effect is hidden and an oracle has been computed."""
    ratios = [c.gaps["corrected"] / c.gaps["oracle"] for c in cases if "oracle" in c.gaps and c.gaps.get("corrected")]
    return [ScoreRow(f"unseen gap over the oracle's, {text}", goal,
                     float(np.percentile(ratios, q)) if ratios else np.nan, len(ratios))
            for text, goal, q in (("median", "<= 1.05", 50.0), ("90th percentile", "<= 1.2", 90.0))]


def motion_only(cases: Sequence[Scored]) -> list[ScoreRow]:
    """Return the rows of records with motion only."""
    only = [c for c in cases if c.label["kind"] == "motion-only"]
    linear = [c for c in only if c.group != "none" and c.label["causes"][0]["linear"]]
    visible = [c for c in only if c.group != "none" and not c.label["causes"][0]["linear"] and c.gap >= 0.16]
    return [
        share("motion only: false alarms", "<= 0.02", [c for c in only if c.group == "none"], alarm),
        share("motion only: nonlinear and sensors at gap .2", ">= 0.90", visible, lambda c: caught(c, c.truth[0])),
        share("motion only: linear cause named", "<= 0.0", linear, lambda c: caught(c, c.truth[0])),
        share("motion only: linear cause listed as not testable", ">= 1.0", linear,
              lambda c: c.truth[0][0] in flat(c.verdict.get("not_testable", []))),
    ]


def report(cases: Sequence[Scored]) -> str:
    """Return the tables as markdown: all cases, then each kind of record and body by itself."""
    head = "| quantity | goal | measured | n | 95 % interval | met |\n|---|---|---|---|---|---|"
    parts = [("all", list(cases))]
    parts += [(f"{title}: {value}", [c for c in cases if c.label[key] == value])
              for title, key in (("records", "kind"), ("body", "body"))
              for value in dict.fromkeys(c.label[key] for c in cases)]
    text = list[str]()
    for title, some in parts:
        rows = [str(row) for row in table(some) if row.count]
        text.append("\n".join([f"### {title} ({len(some)} cases)", "", head, *rows, ""]))
    if (seconds := np.array([c.seconds for c in cases if np.isfinite(c.seconds)])).size:
        text.append(f"Processor seconds a diagnosis: median {np.median(seconds):.1f}, largest {seconds.max():.1f}.\n")
    return "\n".join(text)


@dataclass(frozen=True)
class Score:
    """A scored run; as text the tables in markdown."""

    rows: list[ScoreRow]  # The table over all cases
    text: str

    def __str__(self) -> str:
        return self.text

    def to_dict(self) -> dict[str, Any]:
        """Return the table over all cases."""
        return {"rows": [{**asdict(row), "met": row.met} for row in self.rows]}


def score(folder: str | Path, *others: str | Path, oracle: bool = False, so_far: bool = False,
          executor: Executor | None = None) -> Score:
    """Open the seal of a finished run, score it, and write score.md and score.json into the folder.

    `others`: runs to be scored together with it. `oracle`: diagnose the cases with one library effect once more, told
    its name: what the unseen gap is compared with; these diagnoses are spread over the `executor`, as those of `run`.
    `so_far`: score the cases answered of a run that was stopped.
    """
    folder, runs = Path(folder), [Path(run) for run in (folder, *others)]
    if oracle:
        for run in runs:
            carry_out(run, [f"{case.label['case']}:{case.truth[0][0]}" for case in read_run(run, so_far=so_far)
                            if case.label["group"] == "single" and case.label["kind"] != "motion-only"], executor)
    cases = [case for run in runs for case in read_run(run, so_far=so_far)]
    text = report(cases)
    write_whole(folder / "score.md", text)
    rows = [{"case": c.label["case"], "group": c.group, "kind": c.label["kind"], "body": c.label["body"],
             "hidden": [cause["cause"] for cause in c.label["causes"]], "gap": c.gap, "status": c.status,
             "alone": c.alone, "within": c.within, "gaps": c.gaps, "seconds": c.seconds} for c in cases]
    write_whole(folder / "score.json", json.dumps(rows, indent=1) + "\n")
    return Score(table(cases), text)
