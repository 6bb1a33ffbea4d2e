"""Effects of waves and of the viscous flow about the body."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import nnls

from radiation_ss.arrays import FloatArray
from radiation_ss.effects.definition import Effect, Parameter, Scales

P = Parameter


def hydrodynamic() -> list[Effect]:
    """Return the effects of waves and viscous flow."""
    return [
        Effect("morison_drag", {"coefficient": P("F/(X/s)^2", 1)},
               lambda s, p: -p.coefficient * ca.fabs(s.v - s.orbital) * (s.v - s.orbital), needs="waves", rare=True,
               summary="drag of the velocity relative to the water's, with the linear wave's orbital velocity: "
                       "-c |v - w| (v - w) (Morison et al. 1950)"),
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
        Effect("slamming",
               {"coefficient": P("F/(X/s)^2", 1, slab=lambda s: s.force / s.v**2),
                "level": P("X", 0, lambda s: s.x, levels, lower=lambda s: -3.0 * s.x, upper=lambda s: 3.0 * s.x),
                "side": P("1", starts=lambda s: (1.0, -1.0), fixed=True),
                "width": P("X", 1, starts=lambda s: (0.05 * s.x,), fixed=True)},
               slam, halvings=1, rare=True,
               summary="an impact while the motion passes a level outwards: -c v^2 beyond it, 0 on the way back"),
        Effect("viscous_memory", {"coefficient": P("F/(X/s)", 1, slab=lambda s: 0.12 * s.force / s.v),
                                  "frequency": P("rad/s", 1, starts=lambda s: (s.omega,), fixed=True)},
               fractional_drag, rates=fractional_rates, states=fractional(3)[0].size, linear=True, rare=True,
               summary="laminar boundary layer: -c (d/dt / w0)^(1/2) v, c is the damping at w0 times sqrt(2)"),
    ]


def with_waves(name: str) -> Callable[[Scales], float]:
    """A tenth of the linear force at a typical elevation, or at its rate; of the motion's own sizes where unknown."""
    def size(s: Scales) -> float:
        height = s.elevation if s.elevation > 0.0 else s.x
        return 0.1 * s.force / (s.x * height * (s.omega if name == "elevation_rate" else 1.0))
    return size


def levels(s: Scales) -> tuple[float, ...]:
    """Where an impact may set in, on the way outwards: from the middle to near the end of the motion."""
    return tuple(reach * s.x for reach in (0.7, 0.0, 1.4))


def slam(s: Any, p: Any) -> Any:
    """Return an impact's force: beyond the level, against the velocity while it goes outwards."""
    beyond = 0.5 * (1.0 + ca.tanh((p.side * s.x - p.level) / p.width))
    outwards = 0.5 * (s.v * s.v + p.side * s.v * ca.fabs(s.v))
    return -p.side * p.coefficient * beyond * outwards


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
