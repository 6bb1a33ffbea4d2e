"""What the data acquisition makes of the truth: filter, sampling, noise, offsets, rounding, gaps; and the record's file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from hydro import ROTATIONS
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter

from tests import Test


@dataclass(frozen=True)
class Instruments:
    """The instruments of one case, drawn once."""

    noise: float  # standard deviation as a part of the displacement's rms
    colour: float  # coefficient of the noise's first-order recursion at the sample rate
    filtered: float  # cut-off over the frequency of the motion, 0 without
    rate: float  # samples per period
    jitter: float  # part of a sample interval
    bits: int  # of the converter, 0 without rounding
    offset: np.ndarray  # of each degree of freedom, as part of its rms
    trend: float  # over the longest record, as part of rms
    gaps: int  # at most, in every record
    extra: set  # "v", "a"
    clocked: bool  # time goes on from the start of the test after a cut

    @classmethod
    def draw(cls, rng: np.random.Generator, n: int) -> Instruments:
        noise = float(np.exp(rng.uniform(np.log(0.002), np.log(0.03))))
        extra = {k for k, p in (("v", 0.2), ("a", 0.2)) if rng.random() < p}
        return cls(noise, rng.uniform(0.5, 0.9) * (rng.random() < 0.4), rng.uniform(12, 30) * (rng.random() < 0.35),
                   rng.uniform(14, 40), 0.03 * (rng.random() < 0.2), int(rng.choice([0, 11, 12, 14, 16])),
                   noise * rng.uniform(-0.7, 0.7, n) * (rng.random() < 0.5), noise * rng.uniform(-1, 1) * (rng.random() < 0.3),
                   int(rng.choice([0, 0, 0, 1, 3])), extra, bool(rng.random() < 0.5))


def grain(y: np.ndarray, bits: int, span: float) -> np.ndarray:
    """Round to the converter's step, of 2^bits over twice the span."""
    step = 2 * span / 2**bits if bits and span else 0.0
    return np.round(y / step) * step if step else y


def record(rng: np.random.Generator, box: Instruments, test: Test, dofs: tuple, said: dict, rms: dict,
           lost: float) -> dict:
    """Return the columns of a record, without `lost` seconds at its end.

    `rms` of every channel over the case sets noise and the converter's range.
    """
    fine = np.arange(test.steps + 1) * test.h
    dt = test.period / box.rate
    t = np.arange(test.cut, fine[-1] - lost - 2 * dt, dt)
    seen = np.clip(t + box.jitter * dt * rng.standard_normal(len(t)), 0, fine[-1])

    def sampled(y: np.ndarray) -> np.ndarray:
        if box.filtered:
            b, a = butter(2, min(box.filtered / test.period * 2 * test.h, 0.9))
            y = y[0] + lfilter(b, a, y - y[0])
        return CubicSpline(fine, y)(seen)

    def noisy(y: np.ndarray, level: float, part: float = 1.0) -> np.ndarray:
        e = rng.standard_normal(len(t))
        e = lfilter([np.sqrt(1 - box.colour**2)], [1, -box.colour], e)
        return grain(y + box.noise * part * level * e, box.bits, 8 * level)

    columns = {"time [s]": t - (0 if box.clocked else t[0])}
    for i, d in enumerate(dofs):
        unit = "rad" if d in ROTATIONS else "m"
        y = sampled(said["x"][:, i]) + rms["x"][i] * (box.offset[i] + box.trend * (t / fine[-1] - 0.5))
        columns[f"{d} [{unit}]"] = noisy(y, rms["x"][i], 0.3 if test.kind == "prescribed" else 1.0)
        for k, name, per in (("v", "velocity", "s"), ("a", "acceleration", "s^2")):
            if k in box.extra and test.kind != "static":
                columns[f"{d}_{name} [{unit}/{per}]"] = noisy(sampled(said[k][:, i]), rms[k][i])
        if "force" in test.show:
            unit = "N m" if d in ROTATIONS else "N"
            y = said["f"][:, i] if test.kind == "prescribed" else test.known[::2, i]
            level = rms["f"][i] if test.kind == "prescribed" else np.sqrt(np.mean(y**2)) * 0.3
            columns[f"{d}_force [{unit}]"] = noisy(sampled(y), level) if level else np.zeros(len(t))
    if "eta" in test.show:
        columns["wave_elevation [m]"] = noisy(sampled(test.eta[::2]), np.std(test.eta), 0.7)
    for _ in range(int(rng.integers(box.gaps + 1)) if len(t) > 120 else 0):
        name = str(rng.choice([c for c in columns if c.split(" ")[0] in dofs]))
        at, long = int(rng.integers(len(t) // 8, len(t))), int(rng.integers(2, max(3, len(t) // 40)))
        columns[name] = columns[name].copy()
        columns[name][at : at + long] = np.nan
    return columns


def write(path: Path, test: Test, columns: dict, name: str) -> None:
    """Write a record's file."""
    head = [f"# kind: {test.kind}", f"# name: {name}"] + ([f"# speed: {test.speed:g}"] if test.speed is not None else [])
    rows = np.column_stack(list(columns.values()))
    lines = [",".join("" if np.isnan(q) else f"{q:.9g}" for q in row) for row in rows]
    path.write_text("\n".join([*head, ",".join(columns), *lines]) + "\n")
