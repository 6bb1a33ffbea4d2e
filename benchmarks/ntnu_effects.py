"""An effect that the library lacks, thought of after the residual was seen: sway inertia that goes with heave."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

import radiation_ss as rss
from benchmarks import ntnu_limits as limits
from benchmarks import ntnu_section as flume
from radiation_ss.gap.how_far.ledger import errors_on, pooled_gap
from radiation_ss.gap.how_far.unseen import actives_of, refit_heads
from radiation_ss.gap.posterior.setting import setting_of, terms_of
from radiation_ss.gap.which.search import search
from radiation_ss.simulation.effects import Effect, Parameter
from radiation_ss.simulation.effects.nominal import tolerances

# Kinetic energy slope x_other v^2 / 2: the force on both motions follows from it (Lagrange).
IMMERSION = Effect(
    "immersion", {"slope": Parameter("F/(X/s^2)/Y", 0, scale=lambda s: 0.3 * s.force / (s.a * s.x))},
    lambda s, p: (-p.slope * (s.other.x * s.a + s.other.v * s.v), 0.5 * p.slope * s.v**2),
    scope="pair", family="inertia", summary="an inertia that changes with the other motion: immersion")


def immersion(folder: Path, model: rss.Model, tolerance: Mapping[str, float]) -> list[str]:
    """Return gaps on unseen data without and with the effect, the guides' friction being in the force."""
    records = [flume.record(folder, *pair, model.dofs, friction=True) for pair in limits.runs_with_roll_locked(folder)]
    held = [(record, record.time[0] + 2.0 / 3.0 * np.ptp(record.time)) for record in records]
    spread = tolerances(tolerance)
    spread["kernel"] = float(np.hypot(spread["kernel"], np.nan_to_num(model.fit.relative_error)))
    setting = setting_of(model, records, spread)
    found = search(setting, terms_of(setting, [IMMERSION]), pairs=False)
    none, named = (next(c for c in found.candidates if bool(c.terms) is with_it) for with_it in (False, True))
    fits = refit_heads(model, records, held, spread, named)
    lines = [f"| last third of each run | sway | heave | together | at twice the wave's frequency in sway: "
             f"{', '.join(record.name for record in records)} |", "|---|---|---|---|---|"]
    for name, one in zip(("retuned", "with immersion"), fits):
        errors = [e for record, start in held for e in errors_on(model, actives_of(one, None), record, start)]
        gaps = [pooled_gap([e for e in errors if e.dof == dof]) for dof in range(model.n)] + [pooled_gap(errors)]
        omegas = {record.name: float(record.meta["omega"]) for record in records}
        twice = [limits.in_bands(e.time, e.error, e.measured, omegas[e.record])[2] for e in errors if e.dof == 0]
        lines.append(f"| {name} | {limits.numbers(gaps)} | {', '.join(f'{value:.3f}' for value in twice)} |")
    slopes = [a.values["slope"] for a in actives_of(fits[1], None) if a.name == IMMERSION.name]
    return [*lines, "", f"Slope on the first two thirds {slopes[0]:.0f} kg/m; log evidence over no effect, all of the "
            f"records, {named.evidence - none.evidence:.0f}.", ""]
