"""The effects that the package knows, each defined once."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from radiation_ss.effects.contact import (
    bouc_wen,
    line,
    onset,
    power_of_size,
    ramp,
    restoring_left,
    stopped,
    stops,
    taut,
)
from radiation_ss.effects.definition import Effect, Parameter, Scales

P = Parameter


def saturating(value: Any, sharpness: Any) -> Any:
    """Value / (1 + |value|^m)^(1/m) with m = 2 + sharpness: a smooth sign at 0, value clipped to -1..1 at infinity."""
    power = 2.0 + sharpness
    return value / (1.0 + power_of_size(value, power)) ** (1.0 / power)


def no_more_than_all(share: Any) -> Any:
    """A share that stays near 1 beyond 1: what is lost cannot be more than what there is."""
    soft = 0.02
    return share - soft * ca.log1p(ca.exp((share - 1.0) / soft - 3.0))


def sharpness(start: float) -> Parameter:
    """How abruptly friction sets in: unknown of any real contact, so it is fitted along."""
    return P("1", 1, lambda s: 4.0, lambda s: (start,), upper=50.0)


def yields(s: Scales) -> tuple[float, ...]:
    """Where friction may begin to slip: at a share of the largest motion, or it is never seen to."""
    return tuple(share * s.farthest for share in (0.2, 0.07, 0.7))


def limit_starts(s: Scales) -> tuple[float, ...]:
    """Where a force may be limited: from below its rms to near its peaks."""
    return tuple(reach * acting(s) for reach in (1.3, 0.7, 2.0))


def acting(s: Scales) -> float:
    """Return the typical exciting force; the restoring one's where none acts on the degree of freedom."""
    return s.u if s.u > 0.0 else s.force


def of_period(share: float) -> Callable[[Scales], float]:
    """A time as a share of the motion's period."""
    return lambda s: share * 2.0 * np.pi / s.omega


def resonances(s: Scales) -> tuple[float, ...]:
    """Frequencies of a mass carried along: around the motion's and, where that is another one, the free motion's.

    As dense as a record can resolve, or a damping ratio of .03 makes them overlap.
    """
    apart = s.natural > 0.0 and abs(np.log(s.natural / s.omega)) > 0.5
    found: list[float] = []
    for omega in (s.omega, s.natural) if apart else (s.omega,):
        step = max(2.5 / s.duration, 0.045 * omega)
        below, above = (int(share * omega / step) for share in (0.45, 0.7))
        found += [omega + step * k for k in range(-below, above + 1)]
    return tuple(found)


def beats(s: Scales) -> tuple[float, ...]:
    """Frequencies of a restoring that beats: half the motion's to 2.5 times its own or the free one's.

    As dense as a record can resolve: what beats at twice the free frequency drives the body wherever the sea is.
    """
    first, last = 0.5 * s.omega, 2.5 * max(s.omega, s.natural)
    count = min(110, max(9, round((last - first) * s.duration / 4.0)))
    return tuple(first + (last - first) * k / (count - 1) for k in range(count))


def coupled_share(s: Scales) -> float:
    """An eighth of the coupling stiffness by which one motion would take all potential energy of the other."""
    return 0.12 * float(np.sqrt(s.force * s.second.force / (s.x * s.second.x)))


def coupled_inertia(s: Scales) -> float:
    """The coupling inertia by which one motion would take all kinetic energy of the other: none is as large."""
    return float(np.sqrt(s.mass * s.second.mass))


def effects() -> list[Effect]:
    """Return the effects that most bodies may have, and those of sensors and actuators."""
    damping = [
        Effect("quadratic_drag", {"coefficient": P("F/(X/s)^2", 1)}, lambda s, p: -p.coefficient * ca.fabs(s.v) * s.v,
               summary="separation and eddies: -c |v| v"),
        Effect("linear_damping", {"coefficient": P("F/(X/s)", 1, lower=lambda s: -s.damping)},
               lambda s, p: -p.coefficient * s.v, linear=True, rare=lambda values: values.get("coefficient", 0.0) < 0.0,
               summary="viscous friction, power take-off: -b v; less than 0 where the model has too much"),
        Effect("cubic_damping", {"coefficient": P("F/(X/s)^3", 1)}, lambda s, p: -p.coefficient * s.v**3, rare=True,
               summary="roll damping by Dalzell (1978): -c v^3"),
        Effect("angle_damping", {"coefficient": P("F/(X^3/s)", 1)}, lambda s, p: -p.coefficient * s.x**2 * s.v,
               rare=True, summary="damping that grows away from the middle: -c x^2 v, as of roll"),
        Effect("coulomb_friction",
               {"force": P("F", 1, slab=0.12), "width": onset(), "sharpness": sharpness(2.0)},
               lambda s, p: -p.force * saturating(s.v / p.width, p.sharpness), halvings=1, rate_free=True,
               summary="dry friction of guides and bearings: -F sign(v), rounded near v = 0"),
    ]
    stiffness = [
        Effect("linear_stiffness", {"stiffness": P("F/X", lower=lambda s: -max(s.stiffness, 0.0))},
               lambda s, p: -p.stiffness * s.x, family="stiffness", linear=True, summary="mooring, hydrostatics: -k x"),
        Effect("coupling_stiffness", {"stiffness": P("F/Y", 0, coupled_share)},
               lambda s, p: (-p.stiffness * s.other.x, -p.stiffness * s.x), scope="pair", family="stiffness",
               linear=True, summary="lines or buoyancy that join two degrees of freedom: -k x_other on each"),
        Effect("cubic_stiffness", {"stiffness": P("F/X^3", lower=restoring_left(3))},
               lambda s, p: -p.stiffness * s.x**3, family="stiffness", summary="hardening or softening: -k x^3"),
        Effect("quintic_stiffness", {"stiffness": P("F/X^5", lower=restoring_left(5, 2.0))},
               lambda s, p: -p.stiffness * s.x**5, family="stiffness", rare=True,
               summary="a righting lever beyond the cubic term: -k x^5"),
        Effect("quadratic_stiffness", {"stiffness": P("F/X^2", lower=restoring_left(2),
                                                      upper=lambda s: -restoring_left(2)(s))},
               lambda s, p: -p.stiffness * s.x**2, family="stiffness",
               summary="flare, an asymmetric restoring force: -k x^2"),
        Effect("slack_mooring", line(both=True),
               taut, family="stiffness", rare=True, summary="a line that pulls only when taut: -k max(x - slack, 0)"),
        Effect("end_stop", stops(), stopped, family="stiffness", rare=True,
               summary="stops on both sides of the stroke, with loss: -k (x beyond the gap) - b v there"),
        Effect("parametric_stiffness",
               {"cosine": P("F/X", slab=0.1), "sine": P("F/X", slab=0.1),
                "frequency": P("rad/s", 1, lambda s: 3.0 / s.duration, beats, lower=lambda s: 2.0 / s.duration)},
               lambda s, p: -(p.cosine * ca.cos(p.frequency * s.t) + p.sine * ca.sin(p.frequency * s.t)) * s.x,
               family="stiffness", needs="force", summary="restoring that changes with time: -k cos(w t + phase) x"),
    ]
    inertia = [
        Effect("added_inertia", {"inertia": P("F/(X/s^2)", slab=lambda s: 0.12 * s.mass,
                                           lower=lambda s: -s.inertia)},
               lambda s, p: -p.inertia * s.a, family="inertia", linear=True,
               summary="mass or added mass that the model lacks: -m a"),
        Effect("coupling_inertia", {"inertia": P("F/(X/s^2)", slab=lambda s: 0.12 * coupled_inertia(s),
                                                 lower=lambda s: -coupled_inertia(s), upper=coupled_inertia)},
               lambda s, p: (-p.inertia * s.other.a, -p.inertia * s.a), scope="pair", family="inertia", linear=True,
               summary="a static moment (centre of gravity) between two degrees of freedom"),
        # Kinetic energy slope x_other v^2 / 2: by Lagrange's equations the motion of the other feels it, too.
        Effect("immersion", {"slope": P("F/(X/s^2)/Y", 0, 0.12)},
               lambda s, p: (-p.slope * (s.other.x * s.a + s.other.v * s.v), 0.5 * p.slope * s.v**2),
               scope="directed", family="inertia", optional=True,
               summary="an inertia that changes with the other motion, as with a section's immersion"),
    ]
    return damping + stiffness + inertia + forces() + inputs() + sensors()


def forces() -> list[Effect]:
    """Forces from outside and bodies coupled to the hull."""
    return [
        Effect("constant_force", {"force": P("F", slab=0.3)}, lambda s, p: p.force, family="offset",
               summary="a steady load: current, wind, a tight cable"),
        Effect("slow_drift",
               {"cosine": P("F", 0, lambda s: 0.1 * s.force), "sine": P("F", 0, lambda s: 0.1 * s.force),
                "frequency": P("rad/s", 1, lambda s: 0.1 * s.omega,
                               lambda s: tuple(6.2832 * k / s.duration for k in (1.0, 0.5, 2.0, 3.0)),
                               lower=lambda s: 0.25 * 6.2832 / s.duration, upper=lambda s: 0.5 * s.omega)},
               lambda s, p: p.cosine * ca.cos(p.frequency * s.t) + p.sine * ca.sin(p.frequency * s.t),
               family="offset", per_record=True,
               summary="a force that varies slowly against the motion, or a sensor whose zero wanders"),
        # In a narrow band v^2 - x a is the squared amplitude of the velocity, without its part at twice the frequency.
        # The coefficient goes with the waves' frequency, so every record has its own.
        Effect("drift_force", {"coefficient": P("F/(X/s)^2", slab=0.05)},
               lambda s, p: -p.coefficient * (s.v * s.v - s.x * s.a),
               family="offset", needs="force", per_record=True, optional=True,
               summary="second-order mean force of a free body, against that of the held one: -c (v^2 - x a)"),
        Effect("tank_resonance",
               {"coupling": P("F/(X/s^2)", 1, lambda s: 0.1 * s.force / s.a),
                "frequency": P("rad/s", 1, lambda s: 0.3 * s.omega, resonances,
                               lower=lambda s: 0.3 * min(s.omega, s.natural or s.omega),
                               upper=lambda s: 3.0 * max(s.omega, s.natural)),
                "damping_ratio": P("1", 1, 0.01, lambda s: (0.02, 0.06), lower=0.004, upper=0.1),
                "rigid": P("1", 1, 0.5, lambda s: (1.0,), lower=0.0, upper=1.0)},
               lambda s, p: p.coupling * (p.frequency**2 * s.z[0] + 2 * p.damping_ratio * p.frequency * s.z[1]
                                          + p.rigid * s.a),
               rates=lambda s, p: [s.z[1], -p.frequency**2 * s.z[0] - 2 * p.damping_ratio * p.frequency * s.z[1] - s.a],
               states=2, family="resonance", linear=True, unrest=lambda s: (3.0 * s.x, 3.0 * s.v),
               summary="a lightly damped mass carried along: sloshing, moonpool, equipment; the model's inertia "
                       "holds the share `rigid` of it as if it were fixed"),
        Effect("hysteresis",
               {"force": P("F", 1, lambda s: 0.12 * s.force),
                "reach": P("X", 1, lambda s: 0.35 * s.farthest, yields, lower=lambda s: 0.003 * s.farthest,
                           upper=lambda s: 3.0 * s.farthest), "sharpness": sharpness(1.0)},
               lambda s, p: -p.force * s.z[0], rates=bouc_wen,
               states=1, family="damping", halvings=2, unrest=lambda s: (0.5,), rate_free=True,
               summary="Bouc-Wen: friction that first gives elastically"),
    ]


def inputs() -> list[Effect]:
    """Faults of the exciting force that the model is given."""
    gain: dict[str, Any] = {"parameters": {"gain": P("1", 0, lambda s: 0.3)}, "family": "input", "linear": True,
                            "needs": "force", "input": lambda s, p: (1.0 + p.gain) * s.u}
    delay: dict[str, Any] = {"parameters": {"delay": P("s", 0, of_period(0.1))}, "family": "input", "linear": True,
                             "needs": "force", "clock_in": lambda s, p: s.t - p.delay}
    return [
        Effect("excitation_gain", **gain, summary="the force acts (1 + gain) times as recorded"),
        Effect("excitation_delay", **delay, summary="the force acts later than recorded"),
        Effect("common_excitation_gain", **gain, scope="body", common=True,
               summary="all forces act (1 + gain) times as recorded: the waves are higher"),
        Effect("common_excitation_delay", **delay, scope="body", common=True,
               summary="all forces act later than recorded: the probe's place, the waves' clock"),
        Effect("actuator_saturation",
               {"share": P("1", 1, lambda s: 0.5, upper=1.0),
                "limit": P("F", 1, acting, limit_starts, upper=lambda s: 4.0 * acting(s)),
                "width": P("F", 1, starts=lambda s: (0.05 * acting(s),), fixed=True)},
               input=lambda s, p: s.u - no_more_than_all(p.share) * (ramp(s.u - p.limit, p.width)
                                                                     - ramp(-s.u - p.limit, p.width)),
               family="input", needs="force",
               summary="of the force beyond a limit this share is lost; 1 cuts it off"),
    ]


def sensors() -> list[Effect]:
    """Faults of the motion's sensors: of the displacement's, with `all_sensors` 1 of every one, -1 of every other."""
    all_sensors = P("1", 0, starts=lambda s: (0.0, 1.0, -1.0), fixed=True)
    late: dict[str, Any] = {"clock_out": lambda s, p: s.t - p.delay, "family": "sensor", "linear": True,
                            "needs": "force"}
    return [
        Effect("sensor_delay", {"delay": P("s", 1, of_period(0.1)), "all_sensors": all_sensors}, **late,
               summary="the displacement's sensor reads late, or every other one, or every one of the motion"),
        Effect("common_sensor_delay", {"delay": P("s", 1, of_period(0.1))}, **late, scope="body", common=True,
               summary="all motions are read late by the same time: a camera's or an amplifier's filter"),
        Effect("clock_offset", {"delay": P("s", 0, of_period(0.1))}, **late, per_record=True, optional=True,
               summary="the displacement's clock against the force's, by another time in each record"),
        Effect("sensor_gain", {"gain": P("1", 0, lambda s: 0.3), "all_sensors": all_sensors},
               output=lambda s, p: (1.0 + p.gain) * s.y, family="sensor", linear=True,
               summary="the displacement's sensor, every other or every one reads (1 + gain) times the motion"),
        Effect("sensor_bias", {"bias": P("X", 0, lambda s: 0.3 * s.x)}, output=lambda s, p: s.y + p.bias,
               family="offset", summary="the sensor's zero is off"),
        Effect("clock_drift", {"rate": P("1", 0, lambda s: 0.25 / (s.omega * s.duration), lower=-0.01, upper=0.01)},
               clock_out=lambda s, p: s.t * (1.0 + p.rate), scope="body", family="sensor", linear=True, needs="force",
               summary="the sensor's clock runs fast or slow"),
        Effect("cross_axis", {"share": P("X/Y", 0, lambda s: 0.1 * s.x / s.second.x), "all_sensors": all_sensors},
               output=lambda s, p: s.y + p.share * s.other.y, scope="directed", family="sensor", linear=True,
               summary="the sensor reads a part of the other motion"),
    ]
