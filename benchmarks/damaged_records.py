"""Diagnose cases again with records as bad sensors and loggers would have left them: does the answer stay?

    python benchmarks/damaged_records.py CASES case ... [--only hangs]

CASES is a folder of cases as `foreign_diagnosis.py` takes them. One line a case and damage: status, effects,
probability, gap of unseen records before and after, and the noise's.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import radiation_ss as rss
from benchmarks.foreign_diagnosis import posed

Damage = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def lost(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.where(rng.random(x.size) < 0.02, np.nan, x)


def spikes(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return x + 8.0 * np.nanstd(x) * rng.choice([-1.0, 1.0], x.size) * (rng.random(x.size) < 0.004)


def nine_bits(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    step = np.nanmax(np.abs(x)) / 2**8
    return np.round(x / step) * step if step > 0.0 else x


def hangs(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One fiftieth of the record, from its middle on, shows one reading."""
    at = np.arange(x.size)
    return np.where((at > x.size // 2) & (at < x.size // 2 + x.size // 50), x[x.size // 2], x)


def hangs_at_the_end(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    first = x.size - x.size // 50
    return np.where(np.arange(x.size) > first, x[first], x)


def zeros_at_the_end(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.where(np.arange(x.size) >= x.size - x.size // 50, 0.0, x)


def clipped(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    most = 0.8 * np.nanmax(np.abs(x))
    return np.clip(x, -most, most)


DAMAGES: dict[str, Damage] = {damage.__name__: damage for damage in (
    lost, spikes, nine_bits, hangs, hangs_at_the_end, zeros_at_the_end, clipped)}


def moved(name: str) -> bool:
    """Whether a channel is of a motion."""
    return name != "wave_elevation" and not name.endswith("_force")


def damaged(record: rss.Record, damage: Damage, rng: np.random.Generator) -> rss.Record:
    """Return a record with all its channels of motion damaged."""
    channels = {name: damage(np.array(x), rng) for name, x in record.channels.items() if moved(name)}
    return record.with_channels(**channels)


def logged_fast(record: rss.Record, times: int = 4) -> rss.Record:
    """Return a record logged so many times as fast, with motions held between readings, forces joined by lines."""
    t, count = record.time, record.time.size
    at = np.arange((count - 1) * times + 1)
    time = np.interp(at, times * np.arange(count), t)
    return replace(record, time=time, channels={
        name: x[at // times] if moved(name) else np.interp(time, t, x) for name, x in record.channels.items()})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=Path)
    parser.add_argument("names", nargs="+")
    parser.add_argument("--only", default="", help="the damages whose names begin so")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in given.names:
        model, seen, unseen, options = posed(given.cases / name)
        for told in ("none", *DAMAGES, "logged_fast"):
            if not told.startswith(given.only):
                continue
            rng = np.random.default_rng(3)
            worse = {"none": lambda r: r, "logged_fast": logged_fast}.get(
                told, lambda r, told=told, rng=rng: damaged(r, DAMAGES[told], rng))
            found = rss.diagnose(model, [worse(r) for r in seen], withhold=[worse(r) for r in unseen], **options)
            far, effects = found.how_far, " + ".join(f"{e.name}@{e.dof}" for e in found.verdict.effects)
            print(f"{name} {told:16} {found.verdict.status:14} {effects or '-':50} {found.verdict.probability:.2f} gap "
                  f"{far.gap_before:.3f} to {far.gap_after:.3f}, noise {far.noise_floor:.3f}", flush=True)


if __name__ == "__main__":
    main()
