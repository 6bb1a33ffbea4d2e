"""Sample times and values that cannot be: not ascending, a clock that jumps, numbers beyond all sensors."""

from __future__ import annotations

import numpy as np

from radiation_ss.arrays import FloatArray


def time_fault(time: FloatArray, *, longest_gap: float = 3600.0, share: float = 10.0,
               lasting: tuple[float, float] = (1e-6, 3.2e8)) -> tuple[int, str] | None:
    """Return the sample at which times do not ascend or jump, and what is wrong with it; None if they are sound.

    A gap is a jump of the clock if it is longer than `longest_gap` and than 1000 median steps, and if all such gaps
    together last `share` times longer than the rest of the record. An even grid over such times would be almost empty,
    and can be larger than the memory of the machine.

    Parameters
    ----------
    time : ndarray, shape (nt,)
        [s]
    longest_gap : float
        [s]
    share : float
    lasting : tuple of float
        Shortest and longest time [s] that a record can last, a microsecond and ten years; others are in another unit.

    Examples
    --------
    >>> import numpy as np
    >>> at, what = time_fault(np.array([0.0, 0.1, 0.2, 2592000.3, 2592000.4]))
    >>> at, what
    (3, 'the clock jumps by 2.592e+06 s (30 days) after 0.2 s')
    """
    steps = np.diff(time)
    if steps.size == 0:
        return None
    if steps.min() <= 0.0:
        at = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        what = "is there twice" if steps[at - 1] == 0.0 else f"comes after {time[at - 1]:.10g} s"
        return at, f"{time[at]:.10g} s {what}; times must ascend without repeats"
    gaps = steps > max(longest_gap, 1000.0 * float(np.median(steps)))
    if gaps.any() and steps[gaps].sum() > share * steps[~gaps].sum():
        at = int(np.argmax(steps)) + 1
        size = steps[at - 1]
        return at, f"the clock jumps by {size:.4g} s ({_spoken(size)}) after {time[at - 1]:.10g} s"
    whole = float(time[-1] - time[0])
    if not lasting[0] <= whole <= lasting[1]:
        return time.size - 1, f"{whole:.4g} s ({_spoken(whole)}) after the first; the unit of time is the second"
    return None


def value_fault(values: FloatArray, *, largest: float = 1e60) -> tuple[int, str] | None:
    """Return the first sample that no sensor gives, and what is wrong with it; powers of larger ones overflow."""
    beyond = np.flatnonzero(np.abs(values) > largest)
    return (int(beyond[0]), f"{values[beyond[0]]:.4g} is beyond {largest:g}") if beyond.size else None


def _spoken(seconds: float) -> str:
    """Return a long time in hours, days or years."""
    for unit, length in (("years", 31557600.0), ("days", 86400.0)):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.3g} {unit}"
    return f"{seconds / 3600.0:.3g} hours"
