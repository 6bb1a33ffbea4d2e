"""Every number that decides a verdict, in one place; report.json holds them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from scipy.stats import norm

from radiation_ss.inference.motion import Resolution
from radiation_ss.inference.odds import SearchRules
from radiation_ss.inference.problem import Discrepancy
from radiation_ss.inference.trajectory_fit import FitRules


@dataclass(frozen=True)
class Rules:
    """What a verdict depends on.

    Parameters
    ----------
    matters : float
        Gap that matters, of the motion's rms: less than this is no gap, and no effect that closes less is named.
    false_alarm : float
        Accepted rate of named effects that are not there; named is what has a probability of at least 1 - 10 of these.
    unexplained : float
        Share of the gap that may be left unexplained beside a name.
    plausible : float
        Stated tolerances by which a nominal number may be off beside a name: two standard deviations where they are
        three times too small.
    slow : float
        Probability that a slow force of unknown course is what `slow_drift` means: a drift of waves or of a sensor's
        zero, not wind, a passing ship or a load that shifts, of which these records tell nothing else.
    visible : float
        Information on an effect, in units of its prior, below which records are said not to show it.
    tail : float
        Share of each record, of a decay until it is over, that no fit sees where none is withheld.
    credible : float
        Told beside the first are sets at least 1 - credible times as probable, and of tolerances one that holds with
        less than 1 - credible.
    told : int
        Sets told at most.
    refinements : int
        Rounds in which shapes of effects are fitted and the search is repeated with them.
    resolution, discrepancy, search, fit
        Of the records, of what no effect explains, of the search with its learned sizes, and of the trajectory fits.
    """

    matters: float = 0.01
    false_alarm: float = 0.02
    unexplained: float = 0.5
    plausible: float = 6.0
    slow: float = 0.5
    visible: float = 0.5
    tail: float = 1.0 / 3.0
    credible: float = 0.95
    told: int = 5
    refinements: int = 2
    resolution: Resolution = field(default_factory=Resolution)
    discrepancy: Discrepancy = field(default_factory=Discrepancy)
    search: SearchRules = field(default_factory=SearchRules)
    fit: FitRules = field(default_factory=FitRules)

    @property
    def sure(self) -> float:
        """Inclusion probability from which an effect is named."""
        return 1.0 - 10.0 * self.false_alarm

    @property
    def confirmed(self) -> float:
        """Standard deviations by which a named effect's strength differs from zero once trajectories are fitted."""
        return float(norm.isf(0.5 * self.false_alarm))

    def to_dict(self) -> dict[str, Any]:
        """Return the form of report.json."""
        return flat(asdict(self))


def flat(values: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return nested mappings as one, keys joined by dots."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= flat(value, f"{before}{key}.") if isinstance(value, Mapping) else {f"{before}{key}": value}
    return found
