"""A parameter of an effect: its unit, its sign, where a fit starts, and the prior beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True)
class Scales:
    """Typical sizes of one degree of freedom in the records at hand: what a prior needs to be in the right units."""

    # x, v, a: Root mean square of displacement, velocity, acceleration [m or rad, ...]
    x: float
    v: float
    a: float
    u: float  # Root mean square of the exciting force [N or N m]; 0 in decays
    # Root mean square of the largest of restoring, inertial and exciting force [N or N m]: what an effect's force is
    # compared with
    force: float
    omega: float  # Typical circular frequency of the motion [rad/s]
    duration: float  # Length of a typical record [s]
    natural: float = 0.0  # Circular frequency of the free motion [rad/s]; 0 if it is not known
    other: Scales | None = None  # Sizes of the second degree of freedom of a pair
    elevation: float = 0.0  # Root mean square of the wave elevation at the body [m]; 0 if it is not known
    # Root mean square of the waves' orbital velocity along the degree of freedom [m/s or rad/s]; 0 if not known
    orbital: float = 0.0
    speed: float = 0.0  # Root mean square of the forward speed over the records [m/s]
    # The model's own [F/X]: no effect takes more than all of it. Infinite if it is not known.
    stiffness: float = np.inf
    inertia: float = np.inf  # The model's own, added mass and all [F/(X/s^2)]; infinite if it is not known
    # The model's own linear damping, without radiation [F/(X/s)]: a body may have less, down to none
    damping: float = 0.0
    peak: float = 0.0  # Largest displacement that is reached twice in any record [m or rad]; 0 if it is not known
    # Of an effect on the whole body: sizes of each of its motions by mode (Surge, Heave)
    modes: Mapping[str, Scales] = field(default_factory=dict)

    @property
    def farthest(self) -> float:
        """Largest displacement that is reached twice; a regular motion's where it is not known."""
        return self.peak or float(np.sqrt(2.0)) * self.x

    @property
    def mass(self) -> float:
        """The model's own inertia; if it is not known, force over acceleration."""
        return self.inertia if np.isfinite(self.inertia) else self.force / self.a

    @property
    def restored(self) -> bool:
        """Whether the model has a restoring force of its own: without one, whatever holds the body is all of it."""
        return self.stiffness != 0.0

    @property
    def second(self) -> Scales:
        """Sizes of the second degree of freedom; the first's own where there is none."""
        return self.other or self

    @property
    def relative(self) -> Scales:
        """Sizes of the first motion minus the second, taken as uncorrelated; the smaller of the two forces."""
        two = self.second
        x, v, a, peak = (float(np.hypot(getattr(self, n), getattr(two, n))) for n in ("x", "v", "a", "peak"))
        return replace(self, x=x, v=v, a=a, peak=peak, force=min(self.force, two.force), other=None)


Size = Callable[[Scales], float]


class Slab(NamedTuple):
    """Prior of a parameter where its effect is there: normal, cut at physical bounds."""

    mean: tuple[float, ...]  # 0 for a strength; the starts of a shape, one normal about each
    sd: float  # Standard deviation
    # lower, upper: Physical bounds
    lower: float
    upper: float


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect.

    Parameters
    ----------
    unit : str
        Unit with F for the force's unit (N or N m) and X for the motion's (m or rad), for example "F/(X/s)^2"; Y for
        the motion of the second degree of freedom.
    sign : int
        1: cannot be negative; 0: both signs.
    slab : float or callable, optional
        Standard deviation of the prior of `Slab`. A callable gives it from `Scales` in the parameter's own unit. A
        number is, for a strength, a share of the model's own linear force: the effect's force in a typical motion has
        that share of `Scales.force`; for a shape it is in the shape's own unit. Without it 0.12, for the
        strength of a force.
    starts : callable, optional
        Marks a shape parameter (a frequency, a gap): values from which a fit starts, from `Scales`. A parameter
        without it is a strength: at 0 the effect vanishes.
    fixed : bool
        A shape that is not fitted: its first start is used (the width of a smoothed step).
    lower, upper : float or callable, optional
        Physical bounds in the parameter's own unit, or from `Scales`. Without them a strength has none, but 0 where
        `sign` is 1, and a shape ends 4 standard deviations from its outermost start.
    """

    unit: str = "F"
    sign: int = 0
    slab: float | Size | None = None
    starts: Callable[[Scales], Sequence[float]] | None = None
    fixed: bool = False
    lower: float | Size | None = None
    upper: float | Size | None = None

    @property
    def strength(self) -> bool:
        """Whether the effect vanishes with this parameter."""
        return self.starts is None
