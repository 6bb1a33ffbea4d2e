"""Motion of a model, with effects, under a record's force and from its start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from radiation_ss.arrays import FloatArray, read_only
from radiation_ss.body.composite import signal_names
from radiation_ss.body.convert import as_model
from radiation_ss.body.model import Model, linear_terms
from radiation_ss.effects import Active, activated
from radiation_ss.effects.definition import vector_of
from radiation_ss.errors import InputError
from radiation_ss.methods import accepting
from radiation_ss.records.columns import QUANTITIES
from radiation_ss.records.convert import as_record_or_force
from radiation_ss.records.record import Record
from radiation_ss.records.signals import unread
from radiation_ss.simulation.driven import equilibrium
from radiation_ss.simulation.prepared import LARGEST, Channel, Prepared, driven_at, prepare
from radiation_ss.simulation.pushes import let_go
from radiation_ss.simulation.rollout import Motion, Rollout, reading
from radiation_ss.simulation.start import effect_rate, fitted_start, step_size

if TYPE_CHECKING:
    import control as ct


@accepting(model=as_model, record_or_force=as_record_or_force)
def simulate(model: Model, record_or_force: Record | tuple[ArrayLike, ArrayLike], effects: Any = (), *,
             start: ArrayLike | Mapping[str, float] | None = None, step: float | None = None) -> ct.TimeResponseData:
    """Simulate the model with effects.

    Parameters
    ----------
    model : Model, control.StateSpace or path
    record_or_force : Record, path, pandas.DataFrame, or (time, force)
        A static record gives steady forces, and the answer is where the body rests under each. Any other gives
        force (its own, zero in a decay, or from the wave elevation), sample times, and the start:
        displacement, velocity and memory are fitted to its first 1.5 natural periods; without any motion the body
        starts at rest. A decay whose record begins before the release starts there; until then the body stays where
        it is held.
        Or times (nt,) [s] and the exciting force (n, nt) [N, N m]; the body then starts at rest.
    effects : iterable, optional
        Active effects, (name, dof, {parameter: value}) tuples, or rows of corrected.json; or a diagnosis's `corrected`.
    start : mapping of dof to number, or array_like of shape (m + 2 n,), optional
        Displacements at the first sample [m, rad], at rest; or its state: radiation states, displacements, velocities.
        Overrides the record's own.
    step : float, optional
        Longest step of the integrator [s]; by default 0.45 rad of the fastest natural motion or 0.7 rad of the force's
        band edge, which leaves some 1e-3 of the motion. The error falls with its fourth power. Where an effect sets in
        abruptly, steps are shorter.

    Returns
    -------
    control.TimeResponseData
        Outputs `<dof>`, `<dof>_vel`, `<dof>_acc` as the sensors read them; inputs `<dof>_force`.

    Raises
    ------
    InputError
        If the record holds nothing that moves the model, its force is unknown or missing over more than three steps,
        shapes do not fit, or an effect is so steep that it takes more than five million steps.
    SolverError
        If the motion grows without bounds.

    Examples
    --------
    A mass on a spring, released at 0.1 m, is back after a period.

    >>> import numpy as np
    >>> import radiation_ss as rss
    >>> model = rss.body(dof="Heave", mass=2.0, added_mass=0.0, C=8.0)
    >>> time = np.linspace(0.0, np.pi, 200)
    >>> motion = rss.simulate(model, (time, np.zeros((1, 200))), start={"Heave": 0.1})
    >>> round(float(motion.outputs[0, -1]), 5)
    0.1
    """
    if isinstance(record_or_force, Record):
        record = record_or_force
    else:
        time, force = (np.asarray(values, dtype=float) for values in record_or_force)
        if (forces := np.atleast_2d(force)).shape != (model.n, time.size):
            raise InputError(f"force: shape {forces.shape} found, ({model.n}, {time.size}) needed")
        known = {f"{dof}_force": row for dof, row in zip(model.dofs, forces)}
        record = Record(time, known, kind="forced", name="force")
    if step is not None and not (isinstance(step, int | float | np.number) and 0.0 < step < np.inf):
        raise InputError(f"step: {step!r} found; a positive time [s] is needed, or None")
    if record.kind == "prescribed":
        raise InputError(f"record {record.name}: its motion is prescribed; prescribed_force predicts the force")
    if record.kind == "static":
        return at_rest(model, record, activated(effects, model))
    check_force_is_whole(model, record)
    begin: ArrayLike | None = start if not isinstance(start, Mapping) else np.r_[
        np.zeros(model.fit.states), np.diag(linear_terms(start, model.dofs, "start")), np.zeros(model.n)]
    unmoved = all(record.get(quantity, model.dofs) is None for quantity in QUANTITIES)
    if unmoved:
        if start is None:
            check_something_moves(model, record)
        record = record.with_channels(**{dof: np.zeros(record.time.size) for dof in model.dofs})
    if begin is None and (unmoved or record_or_force is not record):
        begin = np.zeros(model.fit.states + 2 * model.n)
    actives = activated(effects, model)
    if (steps := steps_of(model, record, actives)) > LARGEST:
        raise InputError(f"record {record.name}: an effect sets in so abruptly that {steps:.3g} steps are needed, more "
                         f"than {LARGEST}; make it softer (a larger width), or take a window of the record")
    free = record if begin is not None else let_go(model, record)[0]
    rollout, prepared, motion, p = run(model, free, actives, begin, trim=begin is None, step=step)
    outputs = read_all(rollout, prepared, motion, p, record.time)
    held, early = record.time < free.time[0], record.time < prepared.grid[0]
    if held.any():
        outputs[:, held] = 0.0
        for i, dof in enumerate(model.dofs):  # held where the sensors say it is, or where it is released from
            read = record.channels.get(dof, np.full(held.size, np.nan))[held]
            outputs[i, held] = np.nanmean(read) if np.isfinite(read).any() else outputs[i, ~held][0]
    elif early.any():  # the force of the first waves is unsure, and so is this part
        outputs[:, early] = read_all(*run(model, record, actives, None, trim=False, step=step), record.time[early])
    assert prepared.force is not None
    inside = np.clip(record.time, prepared.force[0].x[0], prepared.force[0].x[-1])
    return response(model, record.time, outputs, np.stack([f(inside) for f in prepared.force]), record.name)


def check_something_moves(model: Model, record: Record) -> None:
    """Raise InputError if a record without motion of the model has neither a force on it nor an elevation."""
    forces = [f"{dof}_force" for dof in model.dofs]
    if not record.channels.keys() & {*forces, "wave_elevation"}:
        raise InputError(f"record {record.name}: its columns, {', '.join(record.channels) or 'none'}, hold nothing "
                         f"that moves the model; needed is one of {', '.join((*model.dofs, *forces))} or "
                         "wave_elevation, or `start` (--decay DOF=X instead of the record)")


def check_force_is_whole(model: Model, record: Record, missed: float = 3.5) -> None:
    """Raise InputError if the force, or the elevation that makes it, has an interval of so many of its steps.

    An elevation that is carried to the body begins later or ends sooner than the record: its ends are held there.
    """
    carried = record.get("force", model.dofs) is None
    for at in driven_at(model, record):
        gaps = [gap for gap in unread(record, at, 0.0, missed) if not carried or at[0] <= gap[0] < at[-1]]
        for first, last in gaps:
            raise InputError(f"record {record.name}: force or elevation has no sample from {first:.6g} to {last:.6g} "
                             "s; take a part without gaps, record.window(start, end)")


def steady_force(model: Model, record: Record) -> FloatArray:
    """Return the force (n, rows) of a static test; InputError if it has none."""
    force = record.get("force", model.dofs)
    if force is None:
        raise InputError(f"record {record.name}: a static test needs the steady force, columns <Dof>_force [N, N m]")
    return force


def at_rest(model: Model, record: Record, actives: tuple[Active, ...]) -> ct.TimeResponseData:
    """Return where the body rests under each row's force, as the sensors read it; its velocity is zero."""
    steady = np.nan_to_num(steady_force(model, record))
    timeless = tuple(a for a in actives if a.effect.clock_out is None)
    x = equilibrium(model, steady.T, timeless)
    rollout, row, n = Rollout(model, timeless, 1.0), np.arange(float(record.time.size)), model.n
    state = np.zeros((row.size, rollout.ns))
    state[:, model.fit.states:model.fit.states + n] = x
    p = vector_of(timeless)
    outputs = read_all(rollout, Prepared(record, row, (), None), Motion(state, np.zeros((row.size, n))), p, row)
    return response(model, record.time, outputs, steady, record.name)


def run(model: Model, record: Record, actives: tuple[Active, ...], start: ArrayLike | None, *, trim: bool = True,
        step: float | None = None, halvings: int = 6, near: FloatArray | None = None,
        ) -> tuple[Rollout, Prepared, Motion, FloatArray]:
    """Roll a model with effects through a record, without the ends where its force is unsure if `trim`.

    A fitted start is sought near the state `near`, too. Where an effect is not linear or has states of its own, steps
    are halved, and halved again where it sets in at once: so many times at most, or as often as a force as steep as
    that of a brake needs to be followed at all.
    """
    linear = tuple(a for a in actives if a.effect.linear)
    h = step_size(model, [record], linear) if step is None else step
    if all((a.effect.linear and not a.effect.states) or a.effect.family == "nominal"
           or not (a.effect.force or a.effect.input) for a in actives):
        return run_in_steps(model, record, actives, start, h, trim, near)
    always = 1 + max(a.effect.halvings for a in actives)
    steps = min(steps_of(model, record, actives), LARGEST) * h / max(float(np.ptp(record.time)), h)
    stable = int(np.ceil(np.log2(max(steps, 1.0))))
    return run_in_steps(model, record, actives, start, h / 2**always, trim, near, max(halvings, stable) - always)


def steps_of(model: Model, record: Record, actives: Sequence[Active]) -> float:
    """Return in how many steps what is steep of effects can be followed: two for each time of their rate."""
    rate = effect_rate(model, [record], [a for a in actives if not a.effect.linear])
    return 0.5 * rate * float(np.ptp(record.time))


def run_in_steps(model: Model, record: Record, actives: tuple[Active, ...], start: ArrayLike | None, h: float,
                 trim: bool, near: FloatArray | None = None,
                 halvings: int = 0) -> tuple[Rollout, Prepared, Motion, FloatArray]:
    """Roll a model with effects through a record in steps of h [s], halved so many times where that is needed."""
    prepared = prepare(model, record, h, trim=trim)
    if prepared.force is None:
        raise InputError(f"record {record.name}: its exciting force is unknown (no <Dof>_force column, and no "
                         "wave_elevation with X in the model); a motion cannot be predicted")
    rollout = Rollout(model, actives, h, halvings)
    p = vector_of(actives)
    drive = rollout.drive(prepared, p)
    if start is None:
        start = fitted_start(rollout, prepared, drive, p, near)
    full = np.zeros(rollout.ns)
    given = read_only(start, "start", (None,))
    if given.shape not in ((rollout.ns - rollout.own,), (rollout.ns,)):
        raise InputError(f"start: shape {given.shape} found, ({rollout.ns - rollout.own},) needed: radiation states, "
                         "displacements, velocities")
    full[: given.size] = given
    return rollout, prepared, rollout.run(full, drive, prepared.grid, p), p


def read_all(rollout: Rollout, prepared: Prepared, motion: Motion, p: FloatArray, time: FloatArray) -> FloatArray:
    """Return displacement, velocity and acceleration of every degree of freedom, shape (3 n, nt)."""
    return np.stack([reading(rollout, motion, prepared.grid, Channel(i, quantity, time, np.zeros(time.size)), p)[0]
                     for quantity in QUANTITIES for i in range(rollout.model.n)])


def response(model: Model, time: FloatArray, outputs: FloatArray, inputs: FloatArray, name: str) -> ct.TimeResponseData:
    """Wrap the result as python-control has it."""
    import control as ct

    labels, names = signal_names(model.dofs)
    return ct.TimeResponseData(time, outputs, inputs=inputs, issiso=False, output_labels=list(names), title=name,
                               input_labels=list(labels), sysname=model.name, success=True)
