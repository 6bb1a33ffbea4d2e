"""Effects of joints between two bodies, of machinery and of material."""

from __future__ import annotations

from typing import Any

import casadi as ca

from radiation_ss.effects.catalogue import TINY, ramp
from radiation_ss.effects.definition import Effect, Parameter, Scales

P = Parameter


def mechanical() -> list[Effect]:
    """Return the effects of machinery and material."""
    return [
        # Exponent delta, w = z / reach: with z' = alpha v - (b |v| |z|^(d-1) z + c v |z|^d) and d = 1, beta = b reach.
        Effect("bouc_wen",
               {"alpha": P("F/X", 1, lambda s: 0.3 * s.force / s.x),
                "beta": P("1", 1, lambda s: 1.0, lambda s: (0.5, 1.0), upper=20.0),
                "gamma": P("1", 0, lambda s: 1.0, lambda s: (0.5, -0.5, 0.0), lower=-20.0, upper=20.0),
                "delta": P("1", 1, lambda s: 1.0, lambda s: (1.0, 2.0), lower=1.0, upper=10.0),
                "reach": P("X", 1, starts=lambda s: (s.x,), fixed=True)},
               lambda s, p: -p.alpha * p.reach * s.z[0], rates=bouc_wen, states=1, family="damping", halvings=2,
               unrest=lambda s: (0.5,), rare=True, rate_free=True,
               summary="Bouc and Wen's hysteresis, all free: -alpha reach w, "
                       "reach w' = v - (beta |v| w |w|^(delta - 1) + gamma v |w|^delta)"),
        Effect("delayed_feedback",
               {"damping": P("F/(X/s)", 1, slab=lambda s: 0.12 * s.force / s.v),
                "stiffness": P("F/X", slab=lambda s: 0.12 * s.force / s.x),
                "delay": P("s", 1, lambda s: 0.3 / s.omega, lambda s: (0.3 / s.omega, 1.0 / s.omega),
                           lower=lambda s: 0.05 / s.omega, upper=lambda s: 3.0 / s.omega)},
               delayed, rates=delayed_rates, states=2, linear=True, unrest=lambda s: (s.x, s.v), rare=True,
               summary="a power take-off that answers late: -(b v + k x) at t - delay (Pade 2, 2)"),
        Effect("lagged_feedback",
               {"damping": P("F/(X/s)", 1, slab=lambda s: 0.12 * s.force / s.v),
                "lag": P("s", 1, lambda s: 0.3 / s.omega, lambda s: (0.3 / s.omega, 1.0 / s.omega),
                         lower=lambda s: 0.05 / s.omega, upper=lambda s: 10.0 / s.omega)},
               lambda s, p: -p.damping * s.z[0], rates=lambda s, p: [(s.v - s.z[0]) / p.lag], states=1, linear=True,
               unrest=lambda s: (s.v,), rare=True,
               summary="a power take-off behind a first-order lag: -b z, lag z' = v - z"),
        *joints(),
    ]


def bouc_wen(s: Any, p: Any) -> list[Any]:
    """Return the rate of Bouc and Wen's state; past twice its limit it comes back no faster than it moves within."""
    z = s.z[0]
    bent = (p.beta * ca.sign(s.v * z) + p.gamma) * (z * z + TINY) ** (0.5 * p.delta)
    return [s.v * (1.0 - ca.fmin(bent, 2.0)) / p.reach]


def delayed(s: Any, p: Any) -> Any:
    """Return the force of delayed displacement and velocity: x(t - T) ~ x - T q', q + T q'/2 + T^2 q''/12 = x."""
    q_rate, q_rate_rate = delayed_rates(s, p)
    return -(p.stiffness * (s.x - p.delay * q_rate) + p.damping * (s.v - p.delay * q_rate_rate))


def delayed_rates(s: Any, p: Any) -> list[Any]:
    """Return the rates of the delay's states q and q'."""
    return [s.z[1], 12.0 / p.delay**2 * (s.x - s.z[0] - 0.5 * p.delay * s.z[1])]


def gaps(s: Scales) -> tuple[float, ...]:
    """How far two bodies move freely against each other, in the relative motion's sizes."""
    return tuple(reach * s.x for reach in (0.7, 0.0, 1.3))


def joints() -> list[Effect]:
    """Return what joins the same motion of two bodies: x, v, a are the first one's minus the second one's."""
    side = P("1", starts=lambda s: (1.0, -1.0), fixed=True)
    width = P("X", 1, starts=lambda s: (0.05 * s.x,), fixed=True)
    gap = P("X", 0, lambda s: s.x, gaps, lower=lambda s: -4.0 * s.x, upper=lambda s: 4.0 * s.x)
    between: dict[str, Any] = {"scope": "between", "optional": True}

    return [
        Effect("relative_damping", {"coefficient": P("F/(X/s)", 1)}, lambda s, p: -p.coefficient * s.v, linear=True,
               summary="power take-off or damper between two bodies: -b (v1 - v2)", **between),
        Effect("relative_drag", {"coefficient": P("F/(X/s)^2", 1)}, lambda s, p: -p.coefficient * ca.fabs(s.v) * s.v,
               summary="hydraulic resistance between two bodies: -c |v1 - v2| (v1 - v2)", **between),
        Effect("relative_stiffness", {"stiffness": P("F/X")}, lambda s, p: -p.stiffness * s.x, linear=True,
               family="stiffness", summary="spring between two bodies: -k (x1 - x2)", **between),
        Effect("relative_friction",
               {"force": P("F", 1, slab=0.05),
                "width": P("X/s", 1, lambda s: 0.05 * s.v, lambda s: (0.05 * s.v,), lower=lambda s: 0.002 * s.v,
                           upper=lambda s: 0.3 * s.v)},
               lambda s, p: -p.force * ca.tanh(s.v / p.width), halvings=1, rate_free=True,
               summary="dry friction of a guide between two bodies: -F sign(v1 - v2), rounded", **between),
        Effect("relative_end_stop",
               {"stiffness": P("F/X", 1), "gap": P("X", 1, lambda s: s.x, gaps, upper=lambda s: 4.0 * s.x),
                "width": width},
               lambda s, p: -p.stiffness * (ramp(s.x - p.gap, p.width) - ramp(-s.x - p.gap, p.width)),
               family="stiffness", summary="end stops on both sides of the stroke between two bodies", **between),
        Effect("relative_slack_line", {"stiffness": P("F/X", 1), "slack": gap, "side": side, "width": width},
               lambda s, p: -p.side * p.stiffness * ramp(p.side * s.x - p.slack, p.width), family="stiffness",
               summary="a line between two bodies that pulls only when taut", **between),
    ]
