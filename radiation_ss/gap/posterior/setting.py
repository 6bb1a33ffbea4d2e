"""What stays the same through a diagnosis: model, prepared records, tolerances, typical sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radiation_ss.arrays import FloatArray
from radiation_ss.body.model import Model
from radiation_ss.effects import Active, Effect, Scales, library, outlines, prior_scale
from radiation_ss.effects.nominal import natural_frequency, nominal_effects
from radiation_ss.errors import InputError
from radiation_ss.records.record import Record
from radiation_ss.simulation.prepare import Channel, Prepared, prepare, step_size
from radiation_ss.simulation.start import Start, motion_size, start_of


@dataclass(frozen=True, eq=False)
class Term:
    """An effect as a term of a fit: where its parameters start, how far the prior lets them go.

    Parameters
    ----------
    active : Active
        With strengths 0 and shapes at their start.
    spread : tuple of float
        Prior standard deviation of each parameter; 0 for one that is not fitted.
    alternatives : int
        Number of starts that the shape was chosen from.
    bound : float
        How far a number of the model's own may be off at most, in `spread`.
    """

    active: Active
    spread: tuple[float, ...]
    alternatives: int = 1
    bound: float = np.inf

    @property
    def key(self) -> tuple[str, str, str]:
        """What names the term apart from its start."""
        return self.active.name, self.active.dof, self.active.other

    @property
    def signs(self) -> tuple[int, ...]:
        """Sign limit of each parameter."""
        return tuple(p.sign for p in self.active.effect.parameters.values())

    @property
    def free(self) -> list[int]:
        """Positions of the fitted parameters."""
        return [k for k, spread in enumerate(self.spread) if spread > 0.0]

    @property
    def strengths(self) -> list[int]:
        """Positions of the parameters with which the effect vanishes."""
        return [k for k, p in enumerate(self.active.effect.parameters.values()) if p.strength]


@dataclass(frozen=True, eq=False)
class Setting:
    """Everything that the fits share.

    Parameters
    ----------
    model : Model
    records : tuple of Prepared
    starts : tuple of Start
    nominal : tuple of Term
        The model's own numbers within tolerance.
    scales : mapping of dof to Scales
    h : float
        Integrator step [s].
    slow : tuple of ndarray, shape (nk, nc)
        For each channel of each record what its motion says nothing about: `slow_part`.
    tolerance : mapping of name to float
        Relative tolerance of mass, stiffness, A_inf, kernel and force.
    discrepancy : tuple of ndarray, shape (nk, nd)
        For each channel what can add to the readings although no nominal number describes it, one standard deviation
        each: tolerated errors of the model, then the noise of recorded forces; empty if there is nothing.
    tolerated : int
        How many of these directions are tolerated errors of the model.
    halvings : int
        How often the step has been halved.
    """

    model: Model
    records: tuple[Prepared, ...]
    starts: tuple[Start, ...]
    nominal: tuple[Term, ...]
    scales: Mapping[str, Scales]
    h: float
    slow: tuple[FloatArray, ...]
    tolerance: Mapping[str, float] = field(default_factory=dict)
    discrepancy: tuple[FloatArray, ...] = ()
    tolerated: int = 0
    halvings: int = 0

    @cached_property
    def finer(self) -> Setting:
        """The same with half the step."""
        h = 0.5 * self.h
        # What was measured stays: simulated nulls have readings of their own.
        records = tuple(replace(prepare(self.model, r.record, h), channels=r.channels) for r in self.records)
        return replace(self, h=h, records=records, halvings=self.halvings + 1)

    def fine_enough(self, terms: Sequence[Term]) -> Setting:
        """Return the same with the step halved as often as every one of the terms asks for."""
        wanted = max((term.active.effect.halvings for term in terms), default=0)
        return self if self.halvings >= wanted else self.finer.fine_enough(terms)

    @property
    def unnamed(self) -> int:
        """Number of directions of the discrepancy."""
        return self.discrepancy[0].shape[1] if self.discrepancy else 0

    @cached_property
    def stacked(self) -> FloatArray:
        """All channels' directions of the discrepancy in one table."""
        return np.concatenate(self.discrepancy)

    @cached_property
    def blocks(self) -> tuple[tuple[NDArray[np.intp], FloatArray], ...]:
        """Of each channel the directions of the discrepancy that move it: `filled`."""
        return filled(self.discrepancy)

    @cached_property
    def squares(self) -> FloatArray:
        """The product of each channel's directions with themselves, shape (channels, nd, nd)."""
        return np.stack([part.T @ part for part in self.discrepancy])

    def without_slow(self, channel: int, values: FloatArray) -> FloatArray:
        """Return residuals or derivatives of a channel without the part that a slow unknown force could make."""
        return without(self.slow[channel], values)

    @property
    def drift_unknown(self) -> bool:
        """Whether every known force that is not zero comes from the elevation, which does not hold its slow part."""
        return self.forced and not any(r.forced and r.record.get("force", self.model.dofs) is not None
                                       for r in self.records)

    @property
    def forced(self) -> bool:
        """Whether any record has a known exciting force that is not zero."""
        return any(record.forced for record in self.records)


def filled(tables: Sequence[FloatArray]) -> tuple[tuple[NDArray[np.intp], FloatArray], ...]:
    """Return of each table which columns are not zero, and these."""
    there = [np.flatnonzero(table.any(axis=0)) for table in tables]
    return tuple((columns, table[:, columns]) for columns, table in zip(there, tables))


def setting_of(model: Model, records: Sequence[Record], tolerance: Mapping[str, float]) -> Setting:
    """Prepare records with known force (or none acting) for fitting."""
    h = step_size(model, list(records))
    prepared = tuple(prepare(model, record, h) for record in records)
    for item in prepared:
        if item.force is None:
            raise InputError(f"record {item.record.name}: the exciting force is unknown; use it as motion-only")
    forced = any(item.forced for item in prepared)
    nominal = tuple(Term(own.active, (own.spread,), bound=own.bound)
                    for own in nominal_effects(model, tolerance, force=forced))
    return Setting(model, prepared, tuple(start_of(model, item) for item in prepared), nominal,
                   {dof: scales_of(model, prepared, i) for i, dof in enumerate(model.dofs)}, h,
                   tuple(slow_part(model, item, c) for item in prepared for c in item.channels), dict(tolerance))


def slow_part(model: Model, item: Prepared, channel: Channel) -> FloatArray:
    """Return orthonormal slow cosines, from the constant up to the sea; none if the force is recorded.

    The elevation does not hold the force below its own band: second-order drift, wind, what X leaves out there. A
    free amplitude of each cosine, the same for every candidate, is the same as leaving that part out.
    """
    return slow_cosines(model, item.record, channel.time) if item.forced else np.zeros((channel.time.size, 0))


def without(basis: FloatArray, values: FloatArray) -> FloatArray:
    """Return values without what lies in the space of an orthonormal basis; as they are if it is empty."""
    return values - basis @ (basis.T @ values) if basis.size else values


def slow_cosines(model: Model, record: Record, time: FloatArray) -> FloatArray:
    """Return orthonormal cosines from the constant up to a record's sea, shape (nk, number); none if it has a force."""
    elevation = record.channels.get("wave_elevation")
    if elevation is None or record.get("force", model.dofs) is not None:
        return np.zeros((time.size, 0))
    edge, (first, last) = lowest_frequency(record.time, elevation), time[[0, -1]]
    count = min(int(edge * (last - first) / np.pi) + 1, time.size // 4)
    table = np.cos(np.pi * np.outer((time - first) / (last - first), np.arange(count)))
    return np.asarray(np.linalg.qr(table)[0])


def lowest_frequency(time: FloatArray, values: FloatArray) -> float:
    """Return the circular frequency [rad/s] below which a hundredth of a signal's variance lies."""
    there = np.isfinite(values)
    dt = float(np.median(np.diff(time)))
    even = np.interp(np.arange(time[0], time[-1], dt), time[there], values[there])
    power = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(even.size))) ** 2
    share = np.cumsum(power) / max(power.sum(), 1e-300)
    return float(2.0 * np.pi * np.fft.rfftfreq(even.size, dt)[np.searchsorted(share, 0.01)])


def scales_of(model: Model, records: Sequence[Prepared], i: int) -> Scales:
    """Return typical sizes of one degree of freedom over the records."""
    sizes = [motion_size(model, record, i) for record in records]
    x = float(np.sqrt(np.mean([size**2 for size, _ in sizes])))
    omega = float(np.mean([omega for _, omega in sizes]))
    u = [np.sqrt(np.mean(r.force[i](r.grid[r.grid <= r.force[i].x[-1]]) ** 2)) for r in records if r.force is not None]
    duration = float(np.mean([r.grid[-1] - r.grid[0] for r in records]))
    inertia = model.M[i, i] + model.A_inf[i, i]
    force = max(model.C[i, i], inertia * omega**2) * x
    return Scales(x, omega * x, omega**2 * x, float(np.sqrt(np.mean(np.square(u)))) if u else 0.0, float(force), omega,
                  duration, natural_frequency(model, i))


def channel_omegas(setting: Setting) -> list[float]:
    """Return the typical frequency of each channel's degree of freedom, in the order of residuals."""
    dofs = setting.model.dofs
    return [setting.scales[dofs[c.dof]].omega for record in setting.records for c in record.channels]


def terms_of(setting: Setting, effects: Sequence[Effect] | None = None) -> list[Term]:
    """Return every effect on every place it can act and from every start of its shape; all there are by default."""
    dofs = setting.model.dofs
    found = []
    for effect in [*library().values(), *outlines().values()] if effects is None else effects:
        if effect.needs == "force" and not setting.forced:
            continue
        if effect.name == "slow_drift" and setting.drift_unknown:
            continue  # not testable: the slow force of these records is unknown anyway
        for dof, other in effect.places(dofs):
            found += shapes_of(effect, dof, other, at_place(setting.scales, dof or dofs[0], other))
    return found


def at_place(scales: Mapping[str, Scales], dof: str, other: str) -> Scales:
    """Return the sizes of a degree of freedom and of the one that an effect couples it with."""
    return replace(scales[dof], other=scales[other]) if other else scales[dof]


def shapes_of(effect: Effect, dof: str, other: str, scales: Scales) -> list[Term]:
    """Return one term for each combination of starts of the shape parameters."""
    grids = [list(p.starts(scales)) if p.starts is not None else [0.0] for p in effect.parameters.values()]
    combinations = np.stack([g.ravel() for g in np.meshgrid(*grids, indexing="ij")], axis=1)
    spreads = tuple(0.0 if p.fixed else prior_scale(effect, name, scales) for name, p in effect.parameters.items())
    return [Term(Active(effect, dof, dict(zip(effect.parameters, map(float, values))), other), spreads,
                 len(combinations)) for values in combinations]
