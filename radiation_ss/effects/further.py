"""Further effects: of waves and viscous flow, of joints between two bodies, of machinery, of material, of time."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import nnls

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.contact import NEAR, SIDES, bouc_wen, line, onset, outwards, ramp, stopped, stops, taut
from radiation_ss.effects.definition import DEPTHS, Effect, Parameter, Scales

P = Parameter


def effects() -> list[Effect]:
    """Return the effects of waves and viscous flow, of machinery, material, joints and of changes in time."""
    return [*hydrodynamic(), *mechanical(), *joints(), *drifts()]


def hydrodynamic() -> list[Effect]:
    """Return the effects of waves and viscous flow."""
    # The water is slower at the depth where the flow separates than at the surface, short waves' most.
    depth = P("1", 0, lambda s: 0.3, lambda s: (0.0, 0.3), lower=0.0, upper=1.0)
    return [
        Effect("morison_drag",
               {"coefficient": P("F/(X/s)^2", 1), "depth": depth},
               lambda s, p: -p.coefficient * ca.fabs(relative_to_water(s, p)) * relative_to_water(s, p),
               needs="waves", rare=True,
               summary="drag of the velocity relative to the water's: -c |u| u, u = v - w, w the linear wave's orbital "
                       "velocity at a depth, in shares of (m / rho)^(1/3) (Morison et al. 1950)"),
        Effect("linear_morison_drag",
               {"coefficient": P("F/(X/s)", 1), "depth": depth},
               lambda s, p: -p.coefficient * relative_to_water(s, p), linear=True, needs="waves", rare=True,
               summary="linear damping of the velocity relative to the water's, of perforated walls or a drag made "
                       "linear: -c u, u as in morison_drag"),
        Effect("crossflow_drag",
               {"coefficient": P("F/(X/s)^2", 1),
                "length": P("X/Y", 1, gyradius, lambda s: (2.5 * gyradius(s), 5.0 * gyradius(s)), lower=gyradius,
                            upper=lambda s: 8.0 * gyradius(s))},
               along_the_hull, scope="pair", rare=True, modes=("Heave,Pitch", "Sway,Yaw"),
               summary="drag of strips along the hull, r from -L/2 to L/2: the mean of -c |v + r w| (v + r w), and of "
                       "r times that (Faltinsen 1990, chapter 6)"),
        Effect("lift_damping", {"coefficient": P("F/(X/s)/(m/s)", 1)},
               lambda s, p: -p.coefficient * ca.fabs(s.speed) * s.v, needs="speed",
               summary="lift of hull, rudder and bilge keels under way: -c |U| v"),
        # The elevation and its rate stand for any phase of the restoring's change against the elevation.
        Effect("wave_stiffness",
               {"in_phase": P("F/X/m", slab=with_waves("elevation")),
                "quadrature": P("F/X/(m/s)", slab=with_waves("elevation_rate"))},
               lambda s, p: -(p.in_phase * s.elevation + p.quadrature * s.elevation_rate) * s.x, family="stiffness",
               needs="waves", rare=True,
               summary="restoring that follows the wave elevation, as in parametric roll: -(k1 h + k2 h') x"),
        Effect("wave_drift", {"coefficient": P("F/m^2", slab=lambda s: 0.1 * s.force / s.elevation**2)},
               lambda s, p: p.coefficient * s.envelope**2, family="input", linear=True, needs="waves", rare=True,
               summary="slowly varying drift with the squared envelope of the waves: c A^2 (Newman 1974)"),
        Effect("slamming",
               {"coefficient": P("F/(X/s)^2", 1, slab=lambda s: s.force / s.v**2),
                "level": P("X", 0, lambda s: s.farthest, lambda s: (*outwards(s), 0.0), lower=lambda s: -s.farthest,
                           upper=lambda s: s.farthest),
                "side": SIDES, "width": NEAR},
               lambda s, p: -p.side * p.coefficient * closing(p.side * s.x, p.side * s.v, p), halvings=1, rare=True,
               summary="an impact while the motion passes a level outwards: -c v^2 beyond it, 0 on the way back"),
        Effect("wave_slamming",
               {"coefficient": P("F/(m/s)^2", 1, slab=lambda s: s.force / (s.omega * s.elevation) ** 2),
                "level": P("m", 0, lambda s: s.elevation, freeboards, lower=0.0, upper=lambda s: 6.0 * s.elevation),
                "width": P("m", 1, starts=lambda s: (0.05 * s.elevation,), fixed=True)},
               lambda s, p: p.coefficient * closing(s.elevation - s.x, s.elevation_rate - s.v, p), halvings=1,
               needs="waves", rare=True, modes=("Heave",),
               summary="an impact of the water on flare or deck while it rises past a level: c (h' - v)^2 where h - x "
                       "is beyond it (von Karman 1929)"),
        Effect("water_on_deck",
               {"stiffness": P("F/X", 1),
                "freeboard": P("m", 1, lambda s: s.elevation, freeboards, lower=lambda s: 0.1 * s.elevation,
                               upper=lambda s: 6.0 * s.elevation),
                "drainage": P("s", 1, lambda s: 1.0 / s.omega, lambda s: (2.0 / s.omega, 8.0 / s.omega),
                              lower=lambda s: 0.2 / s.omega, upper=lambda s: 20.0 / s.omega)},
               lambda s, p: -p.stiffness * s.z[0],
               rates=lambda s, p: [(over_a_weir(s.elevation - s.x, p.freeboard) - s.z[0]) / p.drainage],
               states=1, family="stiffness", needs="waves", rare=True, modes=("Heave",),
               summary="weight of the waves that come over the freeboard f and drain in T: -k z, "
                       "T z' = max(h - x - f, 0)^1.5 / f^0.5 - z, the flow over a weir"),
        Effect("viscous_memory", {"coefficient": P("F/(X/s)", 1, slab=lambda s: 0.12 * s.force / s.v),
                                  "frequency": P("rad/s", 1, starts=lambda s: (s.omega,), fixed=True)},
               fractional_drag, rates=fractional_rates, states=fractional(3)[0].size, linear=True, rare=True,
               summary="laminar boundary layer: -c (d/dt / w0)^(1/2) v, c is the damping at w0 times sqrt(2)"),
    ]


def relative_to_water(s: Any, p: Any) -> Any:
    """Return the velocity relative to the water's at the depth of a drag: a cubic between those that are known."""
    flow = 0.0
    for at, velocity in zip(DEPTHS, (s.orbital, *s.below)):
        others = [other for other in DEPTHS if other != at]
        flow = flow + velocity * math.prod((p.depth - other) / (at - other) for other in others)
    return s.v - flow


def gyradius(s: Scales) -> float:
    """Radius of gyration of a rotation, the second motion, with added mass; by the motions where it is not known."""
    square = s.second.inertia / s.inertia if np.isfinite(s.second.inertia / s.inertia) else (s.x / s.second.x) ** 2
    return float(np.sqrt(square))


def along_the_hull(s: Any, p: Any, points: int = 6) -> tuple[Any, Any]:
    """Return force and moment of the drag of strips, by Gauss's points along the hull."""
    places, weights = np.polynomial.legendre.leggauss(points)
    force = moment = 0.0
    for place, weight in zip(0.5 * places, 0.5 * weights):
        arm = place * p.length
        velocity = s.v + arm * s.other.v
        drag = -weight * p.coefficient * ca.fabs(velocity) * velocity
        force, moment = force + drag, moment + arm * drag
    return force, moment


def with_waves(name: str) -> Callable[[Scales], float]:
    """A tenth of the linear force at a typical elevation, or at its rate; of the motion's own sizes where unknown."""
    def size(s: Scales) -> float:
        height = s.elevation if s.elevation > 0.0 else s.x
        return 0.1 * s.force / (s.x * height * (s.omega if name == "elevation_rate" else 1.0))
    return size


def freeboards(s: Scales) -> tuple[float, ...]:
    """How high the deck may be above calm water for waves to come over it."""
    return tuple(reach * s.elevation for reach in (0.5, 1.0, 2.0))


def over_a_weir(level: Any, freeboard: Any) -> Any:
    """Return what flows over a weir, h^1.5 of the height above the freeboard, as a height."""
    over = ramp(level - freeboard, 0.1 * freeboard)
    return over * ca.sqrt(over / freeboard)


def closing(x: Any, v: Any, p: Any) -> Any:
    """Return the square of a velocity that goes on beyond a level, 0 on the way back."""
    return 0.5 * (1.0 + ca.tanh((x - p.level) / p.width)) * 0.5 * (v * v + v * ca.fabs(v))


@cache
def fractional(poles: int, band: float = 3.0) -> tuple[FloatArray, float, FloatArray]:
    """Return poles p_k, c_0 and residues r_k >= 0 of sqrt(i w) ~ c_0 + sum r_k i w / (i w + p_k).

    Fitted by non-negative least squares to within 2 % over 1/band <= w <= band; each term dissipates, so the sum does.
    """
    w, p = np.geomspace(1.0 / band, band, 60), np.geomspace(0.1, 10.0, poles)
    target = np.sqrt(1j * w)
    terms = np.column_stack([np.ones(w.size), 1j * w[:, None] / (1j * w[:, None] + p)]) / np.abs(target)[:, None]
    unit = target / np.abs(target)
    found, _ = nnls(np.vstack([terms.real, terms.imag]), np.concatenate([unit.real, unit.imag]))
    return p, float(found[0]), found[1:]


def fractional_drag(s: Any, p: Any) -> Any:
    """Return the force of the half derivative of the velocity; a state is the velocity through a low-pass filter."""
    _, whole, residues = fractional(3)
    return -p.coefficient * (whole * s.v + sum(r * (s.v - z) for r, z in zip(residues, s.z)))


def fractional_rates(s: Any, p: Any) -> list[Any]:
    """Return the rates of the low-pass filters."""
    return [p.frequency * pole * (s.v - z) for pole, z in zip(fractional(3)[0], s.z)]


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
               lambda s, p: -p.alpha * p.reach * s.z[0], rates=lambda s, p: bouc_wen(s, p, p.beta, p.gamma, p.delta),
               states=1, family="damping", halvings=2,
               unrest=lambda s: (0.5,), rare=True, rate_free=True,
               summary="Bouc and Wen's hysteresis, all free: -alpha reach w, "
                       "reach w' = v - (beta |v| w |w|^(delta - 1) + gamma v |w|^delta)"),
        Effect("delayed_feedback",
               {"damping": P("F/(X/s)", 1, slab=lambda s: 0.12 * s.force / s.v),
                "stiffness": P("F/X", slab=lambda s: 0.12 * s.force / s.x, lower=lambda s: -max(s.stiffness, 0.0)),
                "delay": P("s", 1, lambda s: 0.3 / s.omega, lambda s: (0.3 / s.omega, 1.0 / s.omega, 2.0 / s.omega),
                           lower=lambda s: 0.05 / s.omega, upper=lambda s: 3.0 / s.omega)},
               delayed, rates=delayed_rates, states=2, linear=True, rare=True, unrest=lambda s: (s.x, s.v),
               summary="a power take-off that answers late: -(b v + k x) at t - delay (Pade 2, 2)"),
        Effect("lagged_feedback",
               {"damping": P("F/(X/s)", 1, slab=lambda s: 0.12 * s.force / s.v),
                "lag": P("s", 1, lambda s: 0.3 / s.omega, lambda s: (0.3 / s.omega, 1.0 / s.omega),
                         lower=lambda s: 0.05 / s.omega, upper=lambda s: 10.0 / s.omega)},
               lambda s, p: -p.damping * s.z[0], rates=lambda s, p: [(s.v - s.z[0]) / p.lag], states=1, linear=True,
               unrest=lambda s: (s.v,), rare=True,
               summary="a power take-off behind a first-order lag: -b z, lag z' = v - z"),
    ]


def delayed(s: Any, p: Any) -> Any:
    """Return the force of delayed displacement and velocity: x(t - T) ~ x - T q', q + T q'/2 + T^2 q''/12 = x."""
    q_rate, q_rate_rate = delayed_rates(s, p)
    return -(p.stiffness * (s.x - p.delay * q_rate) + p.damping * (s.v - p.delay * q_rate_rate))


def delayed_rates(s: Any, p: Any) -> list[Any]:
    """Return the rates of the delay's states q and q'."""
    return [s.z[1], 12.0 / p.delay**2 * (s.x - s.z[0] - 0.5 * p.delay * s.z[1])]


def joints() -> list[Effect]:
    """Return what joins the same motion of two bodies: x, v, a are the first one's minus the second one's."""
    between: dict[str, Any] = {"scope": "between", "optional": True}
    return [
        Effect("relative_damping", {"coefficient": P("F/(X/s)", 1)}, lambda s, p: -p.coefficient * s.v, linear=True,
               summary="power take-off or damper between two bodies: -b (v1 - v2)", **between),
        Effect("relative_drag", {"coefficient": P("F/(X/s)^2", 1)}, lambda s, p: -p.coefficient * ca.fabs(s.v) * s.v,
               summary="hydraulic resistance between two bodies: -c |v1 - v2| (v1 - v2)", **between),
        Effect("relative_stiffness", {"stiffness": P("F/X")}, lambda s, p: -p.stiffness * s.x, linear=True,
               family="stiffness", summary="spring between two bodies: -k (x1 - x2)", **between),
        Effect("relative_friction", {"force": P("F", 1, slab=0.05), "width": onset()},
               lambda s, p: -p.force * ca.tanh(s.v / p.width), halvings=1, rate_free=True,
               summary="dry friction of a guide between two bodies: -F sign(v1 - v2), rounded", **between),
        Effect("relative_end_stop", stops(), stopped, family="stiffness",
               summary="stops on both sides of the stroke between two bodies, with loss", **between),
        Effect("relative_slack_line", line(both=False), taut, family="stiffness",
               summary="a line between two bodies that pulls only when taut", **between),
    ]


def drifts() -> list[Effect]:
    """A body that does not stay the same through a record: flooding, a leaking air cushion, a line that slackens.

    In the records at hand a law in time can look like many laws of the motion, a drifting clock above all.
    """
    def grown(s: Any, p: Any) -> Any:
        share = s.t / p.duration
        return p.linear * share + p.quadratic * share**2

    duration = P("s", 1, starts=lambda s: (s.duration,), fixed=True)
    inertia = P("F/(X/s^2)", 0, lambda s: 0.05 * s.force / s.a)
    stiffness = P("F/X", 0, lambda s: 0.05 * s.force / s.x)
    return [
        Effect("inertia_drift", {"linear": inertia, "quadratic": inertia, "duration": duration},
               lambda s, p: -grown(s, p) * s.a, family="inertia", optional=True,
               summary="inertia that changes through a record: -(m1 t/T + m2 (t/T)^2) a"),
        Effect("stiffness_drift", {"linear": stiffness, "quadratic": stiffness, "duration": duration},
               lambda s, p: -grown(s, p) * s.x, family="stiffness", optional=True,
               summary="restoring that changes through a record: -(k1 t/T + k2 (t/T)^2) x"),
    ]
