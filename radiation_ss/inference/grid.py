"""The uniform times at which a record is looked at."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from radiation_ss.arrays import FloatArray
from radiation_ss.inference.sensor_noise import coloured_noise, noise_of
from radiation_ss.records.record import Record


@dataclass(frozen=True)
class Grid:
    """The uniform times at which a record is looked at: its own, closer ones between them, or means over some."""

    first: float  # [s]
    last: float  # [s]
    step: float  # Sampling interval of the record [s]
    split: int = 1  # Steps of the grid in each of the record's; between the readings goes a cubic spline
    keep: int = 1  # Samples of the record that are averaged to one

    def with_samples(self, least: int, wanted: int, period: float) -> "Grid":
        """Return the grid with at least so many samples a period, and with less than twice the wanted ones."""
        found = period / self.step
        return replace(self, keep=max(int(found / wanted), 1), split=max(int(np.ceil(least / found)), 1))

    def of_at_most(self, levels: int) -> "Grid":
        """Return the grid with less than twice so many samples in all."""
        return replace(self, keep=max(self.own.size // levels, 1))

    @cached_property
    def own(self) -> FloatArray:
        """The record's own times, made even."""
        return np.arange(self.first, self.last + 0.5 * self.step, self.step)

    @cached_property
    def even(self) -> FloatArray:
        """The times before means are taken."""
        own = self.own
        return own if self.split == 1 else own[0] + self.step / self.split * np.arange(self.split * (own.size - 1) + 1)

    @cached_property
    def time(self) -> FloatArray:
        """The grid's times."""
        return averaged(self.even, self.keep)

    def between(self, time: FloatArray, values: FloatArray) -> FloatArray:
        """Return readings at the times before means are taken."""
        if self.split == 1:
            return np.asarray(np.interp(self.even, time, values))
        return np.asarray(CubicSpline(time, values)(np.clip(self.even, time[0], time[-1])))

    def noise(self, time: FloatArray, values: FloatArray, omega: float, at: FloatArray | None = None,
              white: float = 1.0) -> FloatArray:
        """Return the standard deviation of white noise a sample of the grid that has the density of the readings'.

        At frequencies `at` [rad/s] if given, by its colour: see `coloured_noise`. Between two readings a line has less
        of it than they have: it is that of the readings from the grid's first one on.
        """
        first = time[min(int(np.searchsorted(time, self.own[0] - 1e-6 * self.step)), time.size - 1)]
        own = np.interp(np.arange(first, self.own[-1] + 0.5 * self.step, self.step), time, values)
        level = noise_of(own, self.step, omega) if at is None else coloured_noise(own, self.step, omega, at, white)
        return np.asarray(level * np.sqrt(self.split / self.keep))


def averaged(values: FloatArray, keep: int) -> FloatArray:
    """Return means over `keep` samples each."""
    count = values.shape[-1] // keep
    return np.asarray(values[..., : count * keep].reshape(*values.shape[:-1], count, keep).mean(axis=-1))


def fewest(record: Record) -> int:
    """Return how many samples a motion takes; of a static test each is a load with its place."""
    return 3 if record.kind == "static" else 16
