"""How the flume's gap depends on the way in which the waves from the wavemaker, and a higher wave, are allowed for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import radiation_ss as rss
from benchmarks import ntnu_effects as effects
from benchmarks import ntnu_limits as limits
from benchmarks import ntnu_section as flume
from benchmarks.ntnu_waves import come_back
from radiation_ss.effects import effect_named
from radiation_ss.gap.how_far.unseen import refit_heads
from radiation_ss.gap.posterior.setting import setting_of, terms_of
from radiation_ss.gap.which.search import search
from radiation_ss.waves.realise import Sea

EMPTY = "waves/1061_1.csv.gz", "waves/1062_1.csv.gz"
SOONER = 3.0, 4.0  # s
Back = Callable[[Sea, Sea, complex], Sea]


def as_seen(folder: Path, names: tuple[str, str], dofs: tuple[str, ...], back: Back) -> rss.Record:
    """Return the record with another way of making the waves that come back, of those away, towards and the flap."""
    record = flume.record(folder, *names, dofs, returned=False, friction=True, placed=True)
    free, marks, (away, towards) = limits.beside(folder, names)
    sea = back(away, towards, limits.flap(free["time_s"], away, towards, marks))
    force = rss.exciting_force(flume.nominal().select(dofs), sea)
    return record.with_channels(**{f"{dof}_force": record.channels[f"{dof}_force"]
                                   + np.interp(record.time, free["time_s"], force[i]) for i, dof in enumerate(dofs)})


def lead_of_the_higher_wave(folder: Path) -> float:
    """Return by how much the higher of two waves of period 6 is ahead at the section's place [rad], none there."""
    runs = flume.manifest(folder)

    def at(name: str, column: str) -> complex:
        marks, run = runs[name], flume.table(folder / name)
        return flume.phasor(run["time_s"], run[column], marks["omega_rad_s"], marks["steady_from_s"],
                            marks["reflection_back_s"])

    ahead = [np.angle(at(EMPTY[1], probe) / at(EMPTY[1], "wavemaker_m") * at(EMPTY[0], "wavemaker_m")
                      / at(EMPTY[0], probe)) for probe in ("wp4_m", "wp6_m")]
    return float(np.mean(ahead))  # they stand 1.5 m before and behind it


def later(folder: Path, names: tuple[str, str], dofs: tuple[str, ...], lead: float) -> rss.Record:
    """Return the record with the force of a held run in a higher wave taken later by its lead [rad]."""
    plain = flume.record(folder, *names, dofs, friction=False, placed=True)
    full = flume.record(folder, *names, dofs, friction=True, placed=True)
    if abs(float(full.meta["wavemaker ratio"]) - 1.0) < 0.02:
        return full
    late = full.time - lead / float(full.meta["omega"])
    return full.with_channels(**{f"{dof}_force": np.interp(late, full.time, plain.channels[f"{dof}_force"])
                                 + full.channels[f"{dof}_force"] - plain.channels[f"{dof}_force"] for dof in dofs})


def gaps(model: rss.Model, records: Sequence[rss.Record], tolerance: Mapping[str, float]) -> str:
    """Return gaps of sway and heave on the last third, retuned and with immersion, as cells of a table."""
    held = [(record, record.time[0] + 2.0 / 3.0 * np.ptp(record.time)) for record in records]
    spread = effects.spread_of(model, tolerance)
    setting = setting_of(model, records, spread)
    terms = [t for t in terms_of(setting, [effect_named("immersion")])
             if (t.active.dof, t.active.other) == effects.PLACES["immersion"]]
    found = search(setting, terms, pairs=False)
    ordered = sorted(found.candidates, key=lambda c: len(c.terms))
    fits = [refit_heads(model, records, held, spread, one)[1] for one in ordered]
    cells = [effects.by_motion(model, effects.unseen(model, fit, held)) for fit in fits]
    return " | ".join(limits.numbers(two) for two in cells)


def table(folder: Path, model: rss.Model, tolerance: Mapping[str, float]) -> list[str]:
    """Return the gaps, however the records are made."""
    runs, dofs = limits.runs_with_roll_locked(folder), model.dofs

    def back(one: Back) -> list[rss.Record]:
        return [as_seen(folder, names, dofs, one) for names in runs]

    plain = [flume.record(folder, *names, dofs, returned=False, friction=True, placed=True) for names in runs]
    used = [flume.record(folder, *names, dofs, friction=True, placed=True) for names in runs]
    lead = lead_of_the_higher_wave(folder)
    made = {"nothing comes back": plain, "the flap sends all back (as used)": used,
            "as much and as late as the probes have it from the flap": back(
                lambda away, towards, flap: come_back(replace(towards, amplitudes=flap * towards.amplitudes),
                                                      flume.PLACE, flume.DEPTH)),
            "what the probes see coming": back(lambda away, towards, flap: come_back(away, flume.PLACE, flume.DEPTH)),
            f"as used, the higher wave {np.degrees(lead):.1f} deg ahead": [
                later(folder, names, dofs, lead) for names in runs]}
    for sooner in SOONER:
        for name, records in (("nothing comes back", plain), ("as used", used)):
            made[f"{name}, records end {sooner:g} s sooner"] = [
                record.window(record.time[0], record.time[-1] - sooner) for record in records]
    lines = ["| records | sway | heave | sway, with immersion | heave, with immersion |", "|---|---|---|---|---|"]
    return [*lines, *(f"| {name} | {gaps(model, records, tolerance)} |" for name, records in made.items()), ""]
