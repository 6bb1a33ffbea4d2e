"""The hidden causes: which law, how strong, what the library would call it, and where a record can show it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from radiation_ss.blind.physics import LAWS

WAVES = ("waves", "decays+waves", "elevation")
KNOWN = ("waves", "decays+waves")
ANY = ("decays", *WAVES)
ALL = (*ANY, "motion-only")


@dataclass(frozen=True)
class Typical:
    """Typical sizes of a degree of freedom without the cause: rms of motion, velocity, force, and of the `other`."""

    x: float
    v: float
    u: float
    mass: float
    stiffness: float
    omega: float
    duration: float
    other: float = 0.0


@dataclass(frozen=True)
class Hidden:
    """One cause at work on one degree of freedom."""

    cause: str  # Key of CAUSES
    dof: int
    # Five numbers of the law; those of the cause's `scaled` positions are per unit of strength
    parameters: tuple[float, ...]
    strength: float = 1.0

    def law(self) -> tuple[int, int, tuple[float, ...]] | None:
        """Return (code, dof, parameters) for the integrator; None if the cause is not a force."""
        kind = CAUSES[self.cause]
        if not kind.law:
            return None
        p = [v * self.strength if i in kind.scaled else v for i, v in enumerate(self.parameters)]
        if kind.inverse:
            p[0] = self.parameters[0] / max(self.strength, 1e-9)
        return LAWS[kind.law], self.dof, tuple(p)


@dataclass(frozen=True)
class Cause:
    """What a hidden cause is."""

    # What the library may call it: the first is its own name, the rest what it cannot be told from, or its family
    names: tuple[str, ...]
    group: str  # structure, parameter, confounded (exact twins exist), outside or formula
    law: str = ""  # Name in physics.LAWS; "" if it acts on the input or a sensor
    kinds: tuple[str, ...] = ALL  # Sets of records in which it can be seen
    scaled: tuple[int, ...] = (0,)  # Positions of the law's parameters that grow with the strength
    inverse: bool = False  # Parameter 0 falls with the strength (a limit)
    linear: bool = False  # Absorbed by an unknown force
    bodies: tuple[str, ...] = ("heave", "roll", "sway-roll")


STRUCTURE = {
    "quadratic_drag": Cause(("quadratic_drag",), "structure", "square_drag"),
    "coulomb_friction": Cause(("coulomb_friction",), "structure", "dry"),
    "cubic_stiffness": Cause(("cubic_stiffness",), "structure", "cube_spring"),
    "quadratic_stiffness": Cause(("quadratic_stiffness",), "structure", "even_spring"),
    "slack_mooring": Cause(("slack_mooring",), "structure", "taut_line"),
    "parametric_stiffness": Cause(("parametric_stiffness",), "structure", "beating_spring", WAVES),
    "tank_resonance": Cause(("tank_resonance",), "structure", "carried_mass", ANY, (0, 1, 2),
                            linear=True),
    "hysteresis": Cause(("hysteresis",), "structure", "rubber", ANY),
    "slow_drift": Cause(("slow_drift",), "structure", "swell", KNOWN),  # not in an elevation, so not to be seen there
    "actuator_saturation": Cause(("actuator_saturation",), "structure", "clip", KNOWN, (), inverse=True),
    "clock_drift": Cause(("clock_drift",), "structure", "", KNOWN),
    "cross_axis": Cause(("cross_axis",), "structure", "", ANY, bodies=("sway-roll",)),
}
CONFOUNDED = {
    # Under an elevation alone the mean force of the sea is unknown.
    "constant_force": Cause(("constant_force", "sensor_bias"), "confounded", "steady", ("decays", *KNOWN)),
    "sensor_bias": Cause(("sensor_bias", "constant_force"), "confounded", "", ("decays", *KNOWN)),
    "excitation_delay": Cause(("excitation_delay", "sensor_delay", "common_excitation_delay", "common_sensor_delay"),
                              "confounded", "", WAVES, linear=True),
    "sensor_delay": Cause(("sensor_delay", "excitation_delay"), "confounded", "", (*WAVES, "motion-only")),
}
PARAMETER = {
    "linear_damping": Cause(("linear_damping", "radiation_damping"), "parameter", "viscous", linear=True),
    "radiation_damping": Cause(("radiation_damping", "linear_damping"), "parameter", "", linear=True),
    "linear_stiffness": Cause(("linear_stiffness", "added_inertia"), "parameter", "spring", linear=True),
    "added_inertia": Cause(("added_inertia", "linear_stiffness"), "parameter", "", linear=True),
    "excitation_gain": Cause(("excitation_gain", "sensor_gain"), "parameter", "", WAVES, linear=True),
    "sensor_gain": Cause(("sensor_gain", "excitation_gain"), "parameter", "", (*WAVES, "motion-only")),
    "coupling_inertia": Cause(("coupling_inertia",), "parameter", "", ANY, linear=True,
                              bodies=("sway-roll",)),
}
OUTSIDE = {
    "sloshing_tank": Cause(("tank_resonance",), "outside", "sloshing", ANY, (0, 1, 2)),
    "flooding": Cause(("added_inertia",), "outside", "flooding", WAVES),
    "leaking_stiffness": Cause(("linear_stiffness", "parametric_stiffness"), "outside", "leaking", ANY),
    "buffers": Cause(("end_stop", "slack_mooring", "cubic_stiffness"), "outside", "buffer", ANY),
    "wall_echo": Cause(("tank_resonance", "radiation_damping"), "outside", "echo", ANY),
    "backlash": Cause(("cubic_stiffness", "slack_mooring"), "outside", "backlash", ANY),
    "grounding": Cause(("coulomb_friction",), "outside", "grounding", ANY),
    "ramp_load": Cause(("slow_drift",), "outside", "ramp_load", ("decays", *KNOWN)),  # slow, as slow_drift
    "gust": Cause(("slow_drift",), "outside", "burst", ("decays", *KNOWN)),
    "sensor_hold": Cause(("sensor_delay",), "outside", "", ANY),  # a held reading is late by half the hold on average
}
FORMULA = {
    "stribeck_friction": Cause(("coulomb_friction",), "formula", "stribeck", ANY, (0, 2)),
    "drag_power_1.7": Cause(("quadratic_drag",), "formula", "power_drag", ANY),
    "catenary_line": Cause(("cubic_stiffness", "slack_mooring"), "formula", "catenary", ANY),
    "smooth_flare": Cause(("quadratic_stiffness", "slack_mooring"), "formula", "flare", ANY),
    "soft_saturation": Cause(("actuator_saturation",), "formula", "soft_clip", KNOWN, (), inverse=True),
}
SIX = ("quadratic_drag", "coulomb_friction", "cubic_stiffness", "quadratic_stiffness")  # of bodies with six motions
CAUSES: Mapping[str, Cause] = {**STRUCTURE, **CONFOUNDED, **PARAMETER, **OUTSIDE, **FORMULA}


def candidates(group: str, kind: str, body: str) -> list[str]:
    """Return the causes of a class of case that a set of records of a body can show."""
    pool = {"single": {**STRUCTURE, **CONFOUNDED, **PARAMETER}, "pair": STRUCTURE, "triple": STRUCTURE,
            "outside": OUTSIDE, "formula": FORMULA}[group]
    if kind == "motion-only" and group != "single":
        return []
    if body.startswith("six"):
        pool, body = {name: STRUCTURE[name] for name in SIX}, "heave"
    return [name for name, cause in pool.items() if kind in cause.kinds and body in cause.bodies]


def draw(name: str, dof: int, size: Typical, rng: np.random.Generator) -> Hidden:
    """Return a cause with random shape, at a strength whose force is a tenth of the restoring force or so."""
    f = 0.1 * (size.stiffness + size.mass * size.omega**2) * size.x
    x, v, u = size.x, size.v, max(size.u, 1e-12)
    sign = float(rng.choice([-1.0, 1.0]))
    stiff = f / x
    reach = x * rng.uniform(0.3, 1.0)
    phase = rng.uniform(0.0, 2 * np.pi)
    beat = size.omega * rng.uniform(1.6, 2.2)
    mass = 0.05 * size.mass
    near = size.omega * rng.uniform(0.7, 1.4)
    slow = size.omega * rng.uniform(0.05, 0.12)
    period = 2 * np.pi / size.omega
    share = sign * 0.1 * x / size.other if size.other else 0.0
    shapes: dict[str, tuple[float, ...]] = {  # by law, or by the name of a cause without one
        "square_drag": (f / v**2,), "viscous": (f / v,), "dry": (f, 0.03 * v), "spring": (sign * stiff,),
        "cube_spring": (sign * stiff / x**2,), "even_spring": (sign * stiff / x,),
        "taut_line": (2 * stiff, reach, sign), "beating_spring": (stiff, beat, phase), "steady": (sign * f,),
        "swell": (f, slow, phase), "carried_mass": (mass * near**2, 2 * 0.03 * mass * near, mass),
        "rubber": (f, 0.6 * reach), "clip": (1.8 * u,), "soft_clip": (1.8 * u,),
        "stribeck": (f, 0.05 * v, 0.5 * f, 0.4 * v), "power_drag": (f / v**1.7,),
        "catenary": (stiff, 0.8 * x), "flare": (sign * stiff / x, sign * 0.5 * x),
        "sloshing": (mass * near**2, 2 * 0.02 * mass * near, mass, 4 * x, 4 * x),
        "flooding": (0.2 * size.mass, size.duration),
        "leaking": (2 * stiff, size.duration), "buffer": (4 * stiff, 1.2 * x),
        "echo": (f / v, period * rng.uniform(1.3, 2.7)),
        "backlash": (stiff, 0.7 * x), "grounding": (2 * f, 0.5 * x, 0.03 * v), "ramp_load": (sign * f, size.duration),
        "burst": (2 * sign * f, 0.5 * size.duration, period),
        "clock_drift": (sign * 0.3 / (size.omega * size.duration),), "cross_axis": (share,),
        "sensor_bias": (sign * 0.1 * x,), "excitation_delay": (0.1 / size.omega,), "sensor_delay": (0.1 / size.omega,),
        "radiation_damping": (sign * 0.2,), "added_inertia": (sign * 0.05 * size.mass,),
        "excitation_gain": (sign * 0.1,),
        "sensor_gain": (sign * 0.1,), "coupling_inertia": (sign * 0.1,), "sensor_hold": (0.1,),
    }
    given = shapes[CAUSES[name].law or name]
    return Hidden(name, dof, tuple(given) + (0.0,) * (5 - len(given)))
