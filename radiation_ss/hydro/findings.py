"""What a check of coefficients found: findings, and the report that holds them."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from radiation_ss.arrays import FloatArray, frequencies
from radiation_ss.hydro.transforms import Tail
from radiation_ss.methods import Shown, later

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("inertia", "irregular frequency", "negative damping", "asymmetry", "Kramers-Kronig", "A_inf offset",
         "A_inf missing", "spike", "wave phase", "scale", "negative stiffness", "depth", "Haskind", "coarse band",
         "short band", "late band", "non-radiating mode")
Bands = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Finding:
    """One thing found."""

    kind: str  # One of `KINDS`
    problem: bool  # Whether a model made from the data inherits an error of this size; else it is a remark
    value: float  # Its size, relative to the largest value of its curve
    bands: Bands  # Where [rad/s]
    dofs: tuple[str, ...]
    message: str


@dataclass(frozen=True, eq=False, repr=False)
class QualityReport(Shown):
    """What `HydroData.check` found."""

    data: Any  # HydroData, which names this class as the result of its check
    tolerance: float  # Relative size from which something is named; see `check`
    # (nw,): Of the symmetric part of B, each degree of freedom scaled by its largest damping, so that -1 is as much as
    # the largest damping, with the wrong sign. Negative: the waves give energy to the body.
    smallest_eigenvalue: FloatArray
    asymmetry: FloatArray  # (nw,): Largest |A_ij - A_ji| or |B_ij - B_ji|, scaled likewise
    # (nw, n, n): A - A_inf - (what B implies), less its median, relative to the largest |A - A_inf|
    kramers_kronig: FloatArray
    # (nw,): Largest departure of A or B from the curve through its neighbours, relative to the curve's largest value
    spikes: FloatArray
    tail: Tail  # Continuation of the damping above the band
    findings: tuple[Finding, ...]  # Problems first, in the order of `KINDS`, the largest first

    @property
    def ok(self) -> bool:
        """True if nothing is a problem."""
        return not self.problems

    @property
    def problems(self) -> tuple[Finding, ...]:
        """The findings that are problems."""
        return tuple(f for f in self.findings if f.problem)

    def __str__(self) -> str:
        return self.text()

    def to_dict(self) -> dict[str, Any]:
        """Return the findings and the measures per frequency, ready for JSON."""
        return {"source": self.data.source, "dofs": list(self.data.dofs), "ok": self.ok, "tolerance": self.tolerance,
                "findings": [asdict(finding) for finding in self.findings], "omega": self.data.omega.tolist(),
                "smallest_eigenvalue": self.smallest_eigenvalue.tolist(), "asymmetry": self.asymmetry.tolist(),
                "kramers_kronig": np.abs(self.kramers_kronig).max(axis=(1, 2)).tolist(),
                "spikes": self.spikes.tolist(), "notes": list(self.data.notes)}

    def text(self, most: int = 6) -> str:
        """Return the report as text, a line for each finding, at most `most` of a kind."""
        data = self.data
        many = "s" if data.n > 1 else ""
        head = (f"{data.source or 'coefficients'}: {data.n} degree{many} of freedom, {frequencies(data.omega.size)} "
                f"from {data.omega[0]:.3g} to {data.omega[-1]:.3g} rad/s, rho {data.rho:g} kg/m^3, depth "
                f"{data.depth:g} m")
        verdict = "no problem found" if self.ok else f"{len(self.problems)} problem(s) found"
        lines = [head, f"{verdict} (tolerance {100 * self.tolerance:g} %)"]
        kinds = [f.kind for f in self.findings]
        for k, f in enumerate(self.findings):
            if kinds[:k].count(f.kind) < most:
                lines.append(f"  {'PROBLEM' if f.problem else 'remark '}  {f.kind}: {f.message}")
        lines += [f"  ...      {kind}: {kinds.count(kind) - most} smaller ones in .findings"
                  for kind in dict.fromkeys(kinds) if kinds.count(kind) > most]
        lines += [f"  note     {note}" for note in data.notes]
        return "\n".join(lines)

    def plot(self) -> "Figure":
        """Draw the measures over frequency; see `report.plots.plot_quality`."""
        return later("report.plots:plot_quality", self)
