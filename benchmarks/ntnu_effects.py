"""Effects that are not in the default library, named after residuals were seen: what they do for the flume's sway.

They are fitted on the first two thirds of each record and judged on the last.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

import radiation_ss as rss
from benchmarks import ntnu_limits as limits
from benchmarks import ntnu_section as flume
from radiation_ss.effects import Effect, Parameter, effect_named
from radiation_ss.effects.nominal import tolerances
from radiation_ss.gap.how_far.ledger import Error, errors_on, pooled_gap
from radiation_ss.gap.how_far.unseen import actives_of, refit_heads
from radiation_ss.gap.posterior.evidence import log_evidence
from radiation_ss.gap.posterior.fitting import refit
from radiation_ss.gap.posterior.setting import Term, setting_of, terms_of
from radiation_ss.gap.which.candidates import Candidate
from radiation_ss.gap.which.refits import refit_term
from radiation_ss.gap.which.score import scores
from radiation_ss.gap.which.search import Search, search

# Immersion with its two parts free: Lagrange's equations say that both slopes are one number.
SLOPE = Parameter("F/(X/s^2)/Y", 0, lambda s: 0.3 * s.force / (s.a * s.second.x))
HALVES = Effect("two_halves", {"position": SLOPE, "velocity": SLOPE},
                lambda s, p: -p.position * s.other.x * s.a - p.velocity * s.other.v * s.v, scope="directed",
                family="inertia")
SETS = (("immersion",), ("drift_force",), ("crossflow_drag",), ("immersion", "drift_force"),
        ("immersion", "crossflow_drag"), ("immersion", "drift_force", "crossflow_drag"))
PLACES = {"immersion": ("Sway", "Heave"), "crossflow_drag": ("Sway", "Heave"), "drift_force": ("Sway", ""),
          HALVES.name: ("Sway", "Heave")}


def by_name(folder: Path, model: rss.Model, tolerance: Mapping[str, float]) -> list[str]:
    """Return gaps on unseen data without and with the effects, friction and place of the force as measured."""
    records = [flume.record(folder, *pair, model.dofs, friction=True, placed=True)
               for pair in limits.runs_with_roll_locked(folder)]
    held = [(record, record.time[0] + 2.0 / 3.0 * np.ptp(record.time)) for record in records]
    spread = spread_of(model, tolerance)
    setting = setting_of(model, records, spread)

    def terms(effects):
        return [t for t in terms_of(setting, effects) if (t.active.dof, t.active.other) == PLACES[t.active.name]]

    found = search(setting, terms([effect_named(name) for (name,) in SETS[:3]]))
    none = next(c for c in found.candidates if not c.terms)
    third = one_more(found, terms([effect_named("crossflow_drag")]), SETS[3])
    lines = ["| last third of each run | sway | heave | together | wave frequency in sway | twice it | log evidence |",
             "|---|---|---|---|---|---|---|"]
    values: dict[str, str] = {}
    for names in ((), *SETS):
        one = next(c for c in (*found.candidates, third) if {t.active.name for t in c.terms} == set(names))
        fit = refit_heads(model, records, held, spread, one)[1]
        lines.append(f"| {' and '.join(names) or 'retuned'} | {row(model, fit, held)} | "
                     f"{one.evidence - none.evidence:.0f} |")
        if len(names) > 1:
            values |= {f"{a.name} {key}": f"{value:.0f} kg/m" for a in actives_of(fit, None)
                       for key, value in a.values.items() if not a.name.startswith("nominal")}
        if "drift_force" in names:
            own = [a.values["coefficient"] for k in range(len(held)) for a in actives_of(fit, k)
                   if a.name == "drift_force"]
            values["drift_force coefficient"] = ", ".join(f"{value:.0f}" for value in own) + " kg/m"
    halves = next(c for c in search(setting, terms([HALVES]), pairs=False).candidates if c.terms)
    problem, q = halves.fit.problem, halves.fit.q
    columns = problem.columns(0)
    spreads = np.array(problem.terms[0].spread)
    apart = [f"{value:.0f} ± {2.0 * deviation:.0f}" for value, deviation in
             zip(q[columns] * spreads, np.sqrt(np.diag(halves.fit.covariance)[columns]) * spreads)]
    return [*lines, "", "All three, on the first two thirds: "
            + ", ".join(f"{name} {value}" for name, value in values.items())
            + ". Evidence: whole records, over no effect. With the two parts of immersion free, whole records: "
            f"z v' {apart[0]}, z' v {apart[1]} kg/m (2 sd; the law says they are one number).", ""]


def spread_of(model: rss.Model, tolerance: Mapping[str, float]) -> dict[str, float]:
    """Return all tolerances, the kernel's with the error of its fit."""
    spread = tolerances(tolerance)
    return {**spread, "kernel": float(np.hypot(spread["kernel"], np.nan_to_num(model.fit.relative_error)))}


def one_more(found: Search, terms: list[Term], names: tuple[str, ...]) -> Candidate:
    """Return a candidate of the search with one effect more, under the same noise; no prior odds for a third effect."""
    root = next(c for c in found.candidates if {t.active.name for t in c.terms} == set(names))
    fitted = refit_term(root.fit, scores(root.fit, terms)[0], found.floors)
    again = refit(fitted, root.fit.noise)
    return Candidate(again, root.evidence + log_evidence(again) - log_evidence(root.fit))


def unseen(model, fit, held) -> list[Error]:
    """Return the errors of a fit on what it has not seen."""
    return [e for k, (record, start) in enumerate(held) for e in errors_on(model, actives_of(fit, k), record, start)]


def by_motion(model, errors: list[Error]) -> list[float]:
    """Return the gap of each motion."""
    return [pooled_gap([e for e in errors if e.dof == dof]) for dof in range(model.n)]


def row(model, fit, held) -> str:
    """Return gaps by motion and of both, and two bands of the sway's, run by run."""
    errors = unseen(model, fit, held)
    gaps = [*by_motion(model, errors), pooled_gap(errors)]
    omegas = {record.name: float(record.meta["omega"]) for record, _ in held}
    bands = [limits.in_bands(e.time, e.error, e.measured, omegas[e.record]) for e in errors if e.dof == 0]
    cells = [", ".join(f"{band[k]:.3f}" for band in bands) for k in (1, 2)]
    return f"{limits.numbers(gaps)} | {' | '.join(cells)}"
