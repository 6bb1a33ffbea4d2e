"""The units that a file may state, and what one of each is in SI."""

import re

from radiation_ss.errors import InputError

TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0, "d": 86400.0}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048, "in": 0.0254}
ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": 0.017453292519943295}
GRAVITY = 9.80665  # standard gravity [m/s^2], by which weights are forces
FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "gf": 1e-3 * GRAVITY, "kgf": GRAVITY, "tf": 1e3 * GRAVITY,
         "lbf": 4.4482216152605}
# By the SI unit, what each unit of the same quantity is in it
UNITS = {"s": TIME, "m": LENGTH, "rad": ANGLE, "N": FORCE,
         "N m": {f"{force} {arm}": n * m for force, n in FORCE.items() for arm, m in LENGTH.items()}}
UNITS |= {f"{si}{rate}": {f"{unit}{rate}": factor for unit, factor in UNITS[si].items()}
          for si in ("m", "rad") for rate in ("/s", "/s^2")}
UNITS["m/s^2"]["g"] = GRAVITY
KNOT = 1852.0 / 3600.0  # m/s
UNITS["m/s"]["kn"] = KNOT
DENSITY = {"t/m^3": 1e3, "kN/m^3": 1e3 / GRAVITY, "slug/ft^3": 515.378818, "lb/ft^3": 16.018463}
_SPOKEN = {"sec": "s", "second": "s", "seconds": "s", "msec": "ms", "µs": "us", "μs": "us", "day": "d", "days": "d",
           "°": "deg", "º": "deg", "deg": "deg", "degs": "deg", "degree": "deg", "degrees": "deg", "radian": "rad",
           "radians": "rad", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "kt": "kn", "kts": "kn",
           "knot": "kn", "knots": "kn"}
_WORD = re.compile(r"[^\W\d_]+|°")
_PER_TIME = re.compile(r"\s*(?:/\s*s\s*/\s*s|/\s*s\s*\^?\s*2|[*·.]?\s*\bs\s*\^?-2)$")
_PER_SECOND = re.compile(r"\s*(?:/\s*s|[*·.]?\s*\bs\s*\^?-1)$")
_MOMENT = re.compile(rf"^({'|'.join(FORCE)})\s*[*·.⋅-]?\s*({'|'.join(LENGTH)})$")


def plain_unit(text: str) -> str:
    """Spell a unit one way: 'm/s²', 'm/s2' and 'm s-2' are 'm/s^2', 'Nm' and 'N·m' are 'N m', '°' and 'Degrees' 'deg'.

    Upper and lower case make a difference: mN is no MN.
    """
    for mark, plain in (("⁻", "-"), ("¹", "1"), ("²", "^2"), ("**", "^")):
        text = text.replace(mark, plain)
    text = _WORD.sub(lambda word: _SPOKEN.get(word[0].lower(), word[0]), text.strip())
    text = _PER_SECOND.sub("/s", _PER_TIME.sub("/s^2", text))
    return _MOMENT.sub(r"\1 \2", text)


def is_unit(text: str) -> bool:
    """Whether a text is a unit of anything that a record holds."""
    return any(in_si(text, si) for si in UNITS)


def in_si(text: str, si: str) -> float | None:
    """Return what one of a unit is in the SI unit `si`; None if it is none of the same quantity.

    All in capitals it is the one unit that it can be, `MM`; `MN` is MN, and `MN M` may be two.

    >>> in_si("kNm", "N m"), in_si("mm", "rad"), in_si("MM", "m"), in_si("Mm", "m")
    (1000.0, None, 0.001, None)
    """
    units, plain = UNITS[si], plain_unit(text)
    if plain not in units and text.isupper():
        alike = [unit for unit in units if unit.lower() == plain_unit(text.lower()).lower()]
        plain = alike[0] if len(alike) == 1 else plain
    return units.get(plain)


def understood(si: str) -> str:
    """Return the units that may stand for an SI unit.

    >>> understood("rad/s")
    'rad/s, mrad/s, deg/s'
    """
    return f"{', '.join(FORCE)} times {', '.join(LENGTH)}" if si == "N m" else ", ".join(UNITS[si])


def check_water(name: str, value: float, field: str, *, rho_apart: float = 2.0, g_apart: float = 1.1) -> None:
    """Refuse a density [kg/m^3] or gravity [m/s^2] as far from water's or the earth's as only another unit makes it.

    `field`: rho, at most `rho_apart` times off, or g, at most `g_apart` times; of others nothing is known.

    >>> check_water("body.AH1: rho", 1025.0, "rho")
    """
    known = {"rho": (1000.0, rho_apart, "kg/m^3", DENSITY), "g": (9.81, g_apart, "m/s^2", UNITS["m/s^2"])}
    if field not in known:
        return
    usual, apart, si, units = known[field]
    if not usual / apart < value < usual * apart:
        like = next((f"; it looks like {unit}, and the rest in such units too, where SI is read"
                     for unit, one in units.items() if abs(value * one / usual - 1.0) < 0.1), "")
        raise InputError(f"{name}: {value:g} {si} found, some {usual:g} needed{like}")
