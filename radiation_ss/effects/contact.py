"""Forces of lines, stops and friction, and what parameters of several effects begin with."""

from collections.abc import Callable
from typing import Any

import casadi as ca

from radiation_ss.effects.definition import Parameter, Scales

P = Parameter
SIDES = P("1", 0, starts=lambda s: (1.0, -1.0), fixed=True)
NEAR = P("X", 1, starts=lambda s: (0.0125 * s.x,), fixed=True)  # a smoothing width: what is wider shows as a stiffness


def power_of_size(value: Any, exponent: Any) -> Any:
    """|value|^exponent, with derivatives that are finite at 0."""
    return (value * value + 1e-12) ** (0.5 * exponent)


def ramp(value: Any, width: Any) -> Any:
    """max(value, 0), smoothed over `width`."""
    return 0.5 * (value + ca.sqrt(value * value + width * width))


def touching(value: Any, width: Any) -> Any:
    """1 where value > 0, 0 elsewhere, smoothed over `width`: the slope of `ramp`."""
    return 0.5 * (1.0 + value / ca.sqrt(value * value + width * width))


def outwards(s: Scales) -> tuple[float, ...]:
    """Where a force may set in on the way out: to three quarters of the largest motion."""
    return tuple(share * s.farthest for share in (0.5, 0.25, 0.75))


def onset() -> Parameter:
    """The velocity over which dry friction sets in, fitted along; the rms of records that end at rest is small."""
    return P("X/s", 1, lambda s: 0.3 * s.v, lambda s: (0.05 * s.v, 0.3 * s.v), lower=lambda s: 0.002 * s.v,
             upper=lambda s: 1.0 * s.v)


def line(*, both: bool) -> dict[str, Parameter]:
    """Return the parameters of a line that is taut on one side of `slack`, which may be on both sides of the middle."""
    def starts(s: Scales) -> tuple[float, ...]:
        return (*outwards(s), 0.0, *(-x for x in outwards(s) if both))

    return {"stiffness": P("F/X", 1, slab=lambda s: s.force / s.x),
            "slack": P("X", 0, lambda s: s.farthest, starts, lower=lambda s: -s.farthest, upper=lambda s: s.farthest),
            "side": SIDES, "width": NEAR}


def taut(s: Any, p: Any) -> Any:
    """Return the force of a line beyond its slack."""
    return -p.side * p.stiffness * ramp(p.side * s.x - p.slack, p.width)


def stops() -> dict[str, Parameter]:
    """Return the parameters of stops on both sides of the stroke."""
    return {"stiffness": P("F/X", 1, slab=lambda s: 2.0 * s.force / s.x),
            "damping": P("F/(X/s)", 1, slab=lambda s: 0.5 * s.force / s.v),
            "gap": P("X", 1, lambda s: s.farthest, outwards, lower=lambda s: 0.1 * s.farthest,
                     upper=lambda s: s.farthest), "width": NEAR}


def stopped(s: Any, p: Any) -> Any:
    """Return the force of stops on both sides; without a gap it is a spring's and a damper's."""
    beyond, before = s.x - p.gap, -s.x - p.gap
    return (-p.stiffness * (ramp(beyond, p.width) - ramp(before, p.width))
            - p.damping * (touching(beyond, p.width) + touching(before, p.width)) * s.v)


def bouc_wen(s: Any, p: Any, beta: Any = 0.5, gamma: Any = 0.5, delta: Any = None) -> list[Any]:
    """Return the rate of Bouc and Wen's state; by default exponent 1 + sharpness: rounded at 0, elastic-plastic at oo.

    Past twice its limit the state comes back no faster than it moves within: steps too coarse for it stay bounded.
    """
    z = s.z[0]
    bent = (beta * ca.sign(s.v * z) + gamma) * power_of_size(z, 1.0 + p.sharpness if delta is None else delta)
    return [s.v * (1.0 - ca.fmin(bent, 2.0)) / p.reach]


def restoring_left(power: int, reach: float = 3.0) -> Callable[[Scales], float]:
    """The softening -k x^power at which the linear restoring is used up at `reach` times the motion's rms."""
    return lambda s: -s.force / (s.x * (reach * s.x) ** (power - 1))
