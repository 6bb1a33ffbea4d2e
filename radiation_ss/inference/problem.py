"""The regression problem of a model and records, and how what an effect adds along the motion becomes its columns."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array

from radiation_ss.arrays import ComplexArray, FloatArray
from radiation_ss.body.dynamics import impedance
from radiation_ss.body.model import Model
from radiation_ss.effects.definition import Active, Scales
from radiation_ss.effects.nominal import natural_frequency
from radiation_ss.inference.effect_features import Feature
from radiation_ss.inference.effect_symbols import Symbols
from radiation_ss.inference.force_errors import typical_frequency
from radiation_ss.inference.linear_model import Columns, Posterior, Rows, joined
from radiation_ss.inference.local_cosine import projected_on
from radiation_ss.inference.motion import MeasuredMotion
from radiation_ss.inference.rows import Place, about_mean, moved, projected
from radiation_ss.simulation.linear import radiation_states


@dataclass(frozen=True)
class Discrepancy:
    """Prior sizes of what no effect explains."""

    # Median of the smooth random force in each band that goes with the motion's size, of the gap
    unexplained: float = 0.1
    ambient: float = 0.02  # Median of the one that does not, of the gap
    sensors: float = 0.003  # Median of the disagreement of two sensors, of their signal
    spectrum: float = 0.3  # Median of an unknown exciting force at each frequency, of the model's own forces
    coherent: float = 0.1  # Cubic polynomials of displacement and velocity, of the gap
    wandering: float = 0.05  # Stiffness and damping that vary slowly, of the gap
    offset: float = 0.05  # Zero of a sensor, and its drift over a record, of the model's own forces
    # Force on a body let go in its first period, by the hand, the line or a flow that has yet to begin, of the model's
    # own forces: the first swing of a decay is not like the others (ITTC 7.5-02-07-04.5)
    release: float = 0.02
    # Error of one motion's row, of the model's own force, with which it may enter another's to take noise out of it
    mixing: float = 0.003
    # Coupling inertia of two motions that have none by symmetry, of their own: no body and no mesh is all symmetric
    symmetry: float = 1e-4
    # Error of the force that differs from record to record, in size and phase, of the stated tolerance; of one that
    # the model makes of the elevation in each of its bands, too
    by_record: float = 0.5
    # Number of rows beyond which more of them say little new: likelihoods are taken to 1/(1 + N/saturation). Rows count
    # by the energy of the motion around them.
    saturation: float = 300.0


@dataclass(frozen=True, eq=False)
class EquationError:
    """Rows, the columns that every candidate has, and what makes more columns."""

    model: Model
    runs: tuple[MeasuredMotion, ...]
    rows: Rows
    base: Columns  # Nominal numbers and coherent errors; what one record has for itself is `rows.own`
    labels: tuple[str, ...]  # Of the columns of `base`
    places: tuple[Place, ...]
    gap: FloatArray  # (n,): Relative size of the nominal model's equation error of each degree of freedom
    scales: Mapping[str, Scales] = field(default_factory=dict)  # mapping of dof to Scales
    discrepancy: Discrepancy = field(default_factory=Discrepancy)
    ties: csr_array | None = None  # (N, N): What each row is with multiples of other motions' rows added: see `tied`
    quiet: np.ndarray | None = None  # (N,): Rows that tell the size of noise alone, see `rather_noise`

    @cached_property
    def _symbols(self) -> dict[tuple[int, str, str], Symbols]:
        return {}

    def symbols(self, active: Active) -> Symbols:
        """Return an effect's expressions on its place: made once, they take any numbers."""
        if active.form not in self._symbols:
            self._symbols[active.form] = Symbols(self.model, active)
        return self._symbols[active.form]

    def mixed(self, values: FloatArray) -> FloatArray:
        """Return rows of the equation of motion, shape (N, ...), with other motions' rows added."""
        return values if self.ties is None else np.asarray(self.ties @ values)

    @cached_property
    def impedances(self) -> list[tuple[ComplexArray, ComplexArray]]:
        """Derivative of the error by the data of each record where the Jacobian is taken, and its inverse, (nw, n, n).

        It is Z of the record's own motions, or of a prescribed motion -1: that by the measured force.
        """
        found = []
        for run in self.runs:
            Z = impedance(self.model, run.omega_fine)
            if run.prescribed:
                Z = np.broadcast_to(-np.eye(self.model.n, dtype=complex), Z.shape)
            own, inverse = np.ix_(np.arange(len(Z)), run.free, run.free), np.zeros_like(Z)
            inverse[own] = np.linalg.inv(Z[own])
            found.append((Z, inverse))
        return found

    @cached_property
    def drifting_below(self) -> FloatArray:
        """Below what a force is slow, of motions that are mostly a drift in any record [rad/s]; else 0, (records, n).

        Of free motions with a known force.
        """
        below, own = np.zeros((2, len(self.runs), self.model.n))
        for r, run in enumerate(self.runs):
            for i in np.flatnonzero(run.free) if run.driven else ():
                below[r, i], own[r, i] = 0.5 * typical_frequency(self.model, run, int(i)), run.omega[i]
        return np.asarray(below * np.any(own < below, axis=0))

    def with_columns(self, more: Iterable[Columns]) -> Columns:
        """Return the base columns and others beside them."""
        return joined([self.base, *more])

    def residual(self, more: Sequence[Columns], posterior: Posterior, known: bool = False) -> FloatArray:
        """Return the error that is left in each row beside the base columns and `more`.

        `known`: what nothing is known of, wandering, coherent errors, a release and a slow force, is left, too.
        """
        mean, at = posterior.mean, self.base.count
        loose = [known and label.startswith("x^") for label in self.labels]
        found = self.rows.error - self.base.values @ np.where(loose, 0.0, mean[:at])
        for part in more:
            found -= part.values @ mean[at:at + part.count]
            at += part.count
        first = 0
        for own in self.rows.own:
            loose = [known and label.startswith(("wandering", "slow")) for label in own.labels]
            own.times(np.where(loose, 0.0, -posterior.own_mean[first:first + own.count]), found)
            first += own.count
        return found

    @property
    def forced(self) -> bool:
        """Whether a known force that is not zero acts in any record."""
        return any(run.force is not None and np.any(run.force != 0.0) and not run.prescribed for run in self.runs)


def nothing(rows: int, terms: int) -> Columns:
    """Return no columns."""
    return Columns(np.zeros((rows, 0)), np.zeros(0), np.zeros(0), np.zeros(0, int),
                   csc_array((terms, 0), dtype=complex))


def scales_of(model: Model, runs: Sequence[MeasuredMotion], i: int) -> Scales:
    """Return typical sizes of one degree of freedom over the records."""
    mine = [run for run in runs if run.free[i]] or list(runs)
    mine = [run for run in mine if np.any(run.x[i])] or mine
    def rms(name: str) -> float:
        return float(np.sqrt(np.mean([np.mean(getattr(run, name)[i] ** 2) for run in mine]))) + 1e-12
    moving = float(np.sqrt(np.mean([np.mean(about_mean(run, i) ** 2) for run in mine]))) + 1e-12
    u = [np.mean(run.force[i] ** 2) for run in mine if run.force is not None and not run.prescribed]
    omega = float(np.mean([run.omega[i] for run in mine]))
    inertia = model.M[i, i] + model.A_inf[i, i]
    drifts = model.C[i, i] == 0.0 and any(run.record.kind != "static" for run in mine)
    force = inertia * rms("a") if drifts else max(abs(model.C[i, i]), inertia * omega**2) * moving
    loads = [np.mean(run.force[i] ** 2) for run in mine if run.prescribed and run.force is not None]
    if loads and (model.C[i, i] == 0.0 if mine[0].record.kind == "static" else not np.any(mine[0].x[i])):
        force = max(force, float(np.sqrt(np.mean(loads))))  # inertia says nothing of what holds a body at rest
    driving = float(np.sqrt(np.mean(u))) if u else 0.0
    force = max(force, driving)  # a body that is held fast hardly moves
    duration = float(np.mean([run.time[-1] - run.time[0] for run in mine]))
    speed = float(np.sqrt(np.mean([run.record.speed**2 for run in mine])))
    waves = [(run.elevation, run.orbital[i]) for run in mine if np.any(run.elevation)]
    elevation, orbital = np.sqrt(np.mean([np.mean(np.square(pair), axis=1) for pair in waves], axis=0)
                                 ) if waves else (0.0, 0.0)
    return Scales(moving, rms("v"), rms("a"), driving, force, omega, duration,
                  natural_frequency(model, i), elevation=float(elevation), orbital=float(orbital), speed=speed,
                  stiffness=float(model.C[i, i]), inertia=float(inertia), damping=float(model.D[i, i]),
                  peak=max(reached_twice(run.x[i]) for run in mine))


def reached_twice(x: FloatArray) -> float:
    """Return the largest half swing about zero but one: where a body is let go says nothing of what is beyond it."""
    swings = np.split(np.abs(x), np.flatnonzero(np.diff(np.signbit(x))) + 1)
    return float(sorted(swing.max() for swing in swings)[-2]) if len(swings) > 1 else 0.0


class Filling:
    """One column that is filled record by record; `linear`: of what is linear in the motion, or an offset."""

    def __init__(self, problem: EquationError, linear: bool = False) -> None:
        self.problem, self.linear = problem, linear
        self.values, self.relative = np.zeros((problem.rows.error.size, 1)), list[ComplexArray]()

    def add(self, r: int, feature: Feature) -> None:
        """Add the next record."""
        problem, run, values = self.problem, self.problem.runs[r], self.values
        reading, slow = bool(np.any(feature.reading)), run.record.kind == "static"
        gains = gains_of(feature) * reading
        if run.prescribed:  # all equations that the motion enters, so that none has a quotient of the gain
            Z = impedance(problem.model, run.omega * (not slow))
            gains = gains.sum() * np.any(Z @ gains, axis=0)
        memory = (problem.model.fit.c @ radiation_states(problem.model, feature.reading, run.dt)
                  if reading and not slow else np.zeros_like(run.x))
        apart = feature.others - feature.reading
        for place in problem.places:
            if place.record != r:
                continue
            if place.order >= 0:
                if np.any(apart):
                    values[place.rows, 0] = projected_on(run.basis, apart[place.dof], place.order, place.bins).ravel()
                continue
            if not (reading or feature.force[place.dof].any()):
                continue
            gain, force = gains[place.dof], feature.force
            values[place.rows, 0] = projected(problem.model, run, place, force if run.force is None
                                              else force + gain * run.force)
            if reading:
                values[place.rows, 0] += moved(problem.model, run, place, feature.reading - gain * run.x,
                                               memory - gain * run.memory)
        change = relative_change(feature, gains, *problem.impedances[r], run.prescribed)
        self.relative.append(change.ravel() * (run.force is not None))
        if run.force is None:
            told_by_motion_alone(problem, r, values, self.linear)

    def columns(self, spread: float, lower: float = -np.inf, factor: int = 0) -> Columns:
        """Return the column."""
        if self.problem.quiet is not None:
            self.values[self.problem.quiet] = 0.0
        return Columns(self.problem.mixed(self.values), np.array([spread]), np.array([lower]), np.array([factor]),
                       csc_array(np.concatenate(self.relative)[:, None]))


def columns_of(problem: EquationError, found: Iterable[Feature], spread: float, factor: int = 0,
               linear: bool = False) -> Columns:
    """Return one column from its features in each record."""
    filling = Filling(problem, linear)
    for r, feature in enumerate(found):
        filling.add(r, feature)
    return filling.columns(spread, factor=factor)


def told_by_motion_alone(problem: EquationError, record: int, values: FloatArray, linear: bool) -> None:
    """Take from the rows of a record what its unknown force takes: offsets and what is linear in the motion."""
    for place in problem.places:
        if place.record == record and place.order < 0:
            values[place.rows] = 0.0 if linear else beyond_linear(problem.runs[record], place, values[place.rows])


def beyond_linear(run: MeasuredMotion, place: Place, values: FloatArray) -> FloatArray:
    """Return rows (m, K) without what goes with displacements, velocities and accelerations."""
    motion = [projected_on(run.basis, run.x[j], order, place.bins).ravel()
              for j in np.flatnonzero(run.free) for order in range(3)]
    basis = np.linalg.qr(np.stack(motion, axis=1))[0]
    return np.asarray(values - basis @ (basis.T @ values))


def gains_of(feature: Feature) -> FloatArray:
    """Return how many times as large each sensor reads its own motion, less one, shape (n,).

    That motion's equation is multiplied by it: then the gain stands with the force, and its product with a change of
    the impedance is none. A decay alone tells no gain.
    """
    R = np.einsum("wii->wi", feature.reading_response)
    constant = bool(R.size) and not np.any(R.imag) and np.all(R == R[:1])
    return np.asarray(R[0].real if constant else np.zeros(feature.force.shape[0]))


def relative_change(feature: Feature, gains: FloatArray, Z: ComplexArray, inverse: ComplexArray,
                    prescribed: bool) -> ComplexArray:
    """Return the diagonal of Z^-1 J, shape (nw, n), of a record's own motions; no reading is of a measured force."""
    J = feature.response
    if np.any(feature.reading_response):
        J = J + Z @ feature.reading_response * (not prescribed) - gains[:, None] * Z
    return np.asarray(np.einsum("wij,wji->wi", inverse, J)) if np.any(J) else np.zeros(Z.shape[:2], dtype=complex)


def pulled_slowly(problem: EquationError, share: float = 0.5) -> bool:
    """Whether an unknown force moves the body so slowly that any restoring and any force explain each other.

    That is where no record states a force, and each motion that something restores is slower than a share of its
    natural frequency.
    """
    if any(run.force is not None for run in problem.runs):
        return False
    restored = np.diag(problem.model.C) > 0.0
    moving = [(run.omega[i], natural_frequency(problem.model, int(i))) for run in problem.runs
              for i in np.flatnonzero(run.free & restored)]
    return bool(moving) and all(omega < share * natural for omega, natural in moving)
