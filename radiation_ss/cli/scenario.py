"""What `simulate` does without a record: a sea or a decay, by its options."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from shlex import join
from typing import TYPE_CHECKING

import numpy as np

import radiation_ss as rss
from radiation_ss.arrays import positive
from radiation_ss.errors import InputError
from radiation_ss.hydro.data import motion_unit
from radiation_ss.records.columns import own_dofs
from radiation_ss.units import in_si, understood
from radiation_ss.waves.force import around, energy_outside

if TYPE_CHECKING:
    from radiation_ss.body.model import Model
    from radiation_ss.records.record import Record

_NUMBER = re.compile(r"\s*([+-]?(?:inf|nan|[\d.]+(?:[eE][+-]?\d+)?)?)\s*(.*)", re.DOTALL)   # and its unit
USUAL_SEA = 600.0  # s
USUAL_DECAY = 20  # natural periods


def scenario(args: argparse.Namespace, model: Model) -> Record:
    """Return motion, velocity, acceleration and force as --sea or --decay, --duration and --corrected ask."""
    from radiation_ss.body.dynamics import natural_modes
    from radiation_ss.simulation.corrected_files import read_corrected

    actives = () if args.corrected is None else read_corrected(args.corrected, model).actives(model)
    units = own_dofs(dict.fromkeys(model.dofs, "") | kept(args))
    if unsaid := [dof for dof, unit in units.items() if not unit]:
        raise InputError(f"simulate: {unsaid[0]} is no rigid-body mode; say whether it is in m or in rad: --dofs "
                         + join(f"{dof}=m" if dof in unsaid else dof for dof in model.dofs))
    periods = natural_modes(model).period
    periods = periods[np.isfinite(periods)]
    start, channels, meta = None, {}, {"source": "simulated"}
    if args.sea is not None:
        height, peak = args.sea
        _check_sea(height, peak, args.duration)
        spectrum, dt = rss.jonswap(height, tp=peak), min([peak, *periods]) / 40.0
        towards = heading(args.heading, model)
        meta["heading"] = f"{np.degrees(towards):.10g}"
        sea = rss.realise(spectrum, lasting(args.duration, USUAL_SEA, dt), dt, seed=args.seed, directions=(towards,))
        time, force = sea.time, rss.exciting_force(model, sea, outside=args.outside)
        channels["wave_elevation"] = sea.elevation
        assert model.hydro is not None
        share, said = energy_outside(model.hydro, sea)
        if share >= 0.0005:  # less would be said as 0.0 %
            args.notes.append(f"{said} and exerts no force")
            meta["left_out"] = f"{said.removeprefix(f'{model.hydro.source}: ')} and exerts no force"
        if loose := [dof for dof, c in zip(model.dofs, np.diag(model.C)) if c == 0.0]:
            args.notes.append(f"nothing holds {', '.join(loose)}: the start from rest leaves a steady velocity that "
                              "grows to a drift; give the model a mooring stiffness, or leave them out (--dofs)")
    else:
        if not periods.size and args.duration is None:
            raise InputError("simulate: this model does not oscillate; give --duration")
        duration = lasting(args.duration, USUAL_DECAY * float(periods.max(initial=0.0)), 0.0)
        dt = min([duration, *periods]) / 60.0
        lasting(duration, 0.0, dt)
        time = dt * np.arange(int(np.ceil(duration / dt)) + 1)
        force, start = np.zeros((model.n, time.size)), release(args.decay, model, units)
    outputs = rss.simulate(model, (time, force), actives, start=start).outputs
    for i, dof in enumerate(model.dofs):
        channels |= {dof: outputs[i], f"{dof}_velocity": outputs[model.n + i],
                     f"{dof}_acceleration": outputs[2 * model.n + i], f"{dof}_force": force[i]}
    return rss.Record(time, channels, kind="waves" if args.sea is not None else "decay", name=args.out.stem,
                  meta=meta, units=units)


def kept(args: argparse.Namespace) -> dict[str, str]:
    """Return the degrees of freedom of --dofs, with the unit where it is said: flap=rad."""
    return {dof: unit for dof, _, unit in (word.partition("=") for word in args.dofs or ())}


def _check_sea(height: float, peak: float, duration: float | None, steepest: float = 1.0 / 7.0,
               fewest: float = 3.0) -> None:
    """Refuse a sea steeper than waves that break (2 pi Hs / g Tp^2), and one of fewer than some peak periods."""
    steepness = 2.0 * np.pi * height / (9.81 * peak**2) if peak > 0.0 else 0.0
    if steepness > steepest:
        raise InputError(f"--sea {height:g} {peak:g}: a sea {height:g} m high with a peak period of {peak:g} s is "
                         f"{steepness:.2g} steep, and waves break at {steepest:.2g}; HS is in m, TP in s")
    if (length := duration or USUAL_SEA) < fewest * peak:
        raise InputError(f"--sea {height:g} {peak:g}: {length:g} s hold {length / peak:.2g} peak periods, {fewest:g} "
                         "are needed; TP is in s, --duration makes the sea longer")


def lasting(given: float | None, usual: float, dt: float, most: int = 5_000_000) -> float:
    """Return the length of --duration [s], or the usual one; refused where it is none or has more steps than `most`."""
    found = positive(usual if given is None else given, "--duration", "s")
    if found > most * dt > 0.0:
        raise InputError(f"--duration {found:g}: {found / dt:.3g} steps of {dt:.3g} s, more than {most}")
    return found


def heading(given: float | None, model: Model) -> float:
    """Return the direction of --heading [rad], or the only one that the model's excitation force has, or along x."""
    known = None if model.hydro is None else model.hydro.directions
    if given is None:
        return float(known[0]) if known is not None and len(known) == 1 else 0.0
    if not np.isfinite(given):
        raise InputError(f"--heading {given:g}: a finite angle in degrees is needed")
    if model.hydro is not None and known is not None:
        try:
            around(model.hydro, float(np.radians(given)))
        except InputError:
            raise InputError(f"--heading {given:g}: the model's file has wave excitation forces from "
                             f"{np.degrees(min(known)):g} to {np.degrees(max(known)):g} deg") from None
    return float(np.radians(given))


def release(given: list[str], model: Model, units: Mapping[str, str], lean: float = 1.2,
            gravity: float = 9.81) -> dict[str, float]:
    """Return the displacements at release [m or rad], as `DOF=X` say.

    X may carry a unit, `Roll=10deg`; without one it is in m or rad. Refused are then an angle above `lean`, probably in
    degrees, and a way whose stiffness accelerates the model more than `gravity` [m/s^2], probably in millimetres.
    `units`: of degrees of freedom that are no rigid-body mode.
    """
    start: dict[str, float] = {}
    rates = np.abs(np.diag(model.C)) / np.diag(model.M + model.A_inf)
    for word in given:
        dof, _, text = word.partition("=")
        if dof in start:
            raise InputError(f"--decay {' '.join(given)}: {dof} is there twice")
        if dof not in model.dofs:
            raise InputError(f"--decay {word}: the model has {', '.join(model.dofs)}; write DOF=X, for example "
                             f"{model.dofs[0]}=0.1")
        si, parts = units.get(dof) or motion_unit(dof), _NUMBER.match(text)
        assert parts is not None    # it matches anything
        number, unit = parts.groups()
        try:
            value = float(number)
        except ValueError:
            raise InputError(f"--decay {word}: {text!r} is not a number [m or rad], nor one with a unit; write "
                             f"{dof}=0.1") from None
        factor = in_si(unit, si) if unit else 1.0
        if factor is None:
            mark = "the decimal mark is a point" if unit.startswith(",") else f"{dof} may be in {understood(si)}"
            raise InputError(f"--decay {word}: unit {unit!r} is not understood; {mark}")
        if not unit and si == "rad" and lean < abs(value) < np.inf:
            raise InputError(f"--decay {word}: an angle is in rad, and {value:g} rad is {np.degrees(value):.0f} "
                             f"degrees; write {dof}={value:g}deg, or {dof}={value:g}rad if that is meant")
        at = model.dofs.index(dof)
        if not unit and si == "m" and gravity < rates[at] * abs(value) < np.inf:
            raise InputError(f"--decay {word}: released at {value:g} m the model accelerates by "
                             f"{rates[at] * abs(value):.3g} m/s^2, more than gravity does; write {dof}={value:g}mm, or "
                             f"{dof}={value:g}m if that is meant")
        start[dof] = factor * value
    if not np.isfinite([*start.values()]).all():
        raise InputError(f"--decay {' '.join(given)}: finite numbers are needed [m or rad]")
    return start
